"""The commands: what they write, and that their options are the scenario."""

import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from command_line import ROOT
from needs import needs_chromium, needs_robots
from PIL import Image

import harpy_pin as hp
from harpy_pin.cli import app as cli
from harpy_pin.cli.walk_options import read_scenario
from harpy_pin.controllers import CONTROLLERS
from harpy_pin.scenario.settings import scenario_of, settings_table


def test_walk_writes_log_and_json(command, tmp_path):
    code, out, _ = command(
        "walk", "--duration", 0.4, "--save", tmp_path / "a.npz", "--json", tmp_path / "a.json"
    )
    assert (code, out.splitlines()[-1]) == (0, f"next: harpy view {tmp_path / 'a.npz'}")
    assert "slip, mm per step" in out
    run = hp.Run.load(tmp_path / "a.npz")
    written = json.loads((tmp_path / "a.json").read_text())
    measures = hp.measure(run).as_dict()
    for name, value in measures.items():
        assert value != value or written[name] == value
    assert hp.Scenario.of(run) == hp.Scenario(controller="condensed", duration=0.4)
    assert run.metadata["versions"]["pin"]
    assert run.metadata["controller"] == "CondensedController"


PAPER = ("--set", "controller=governed")
VELOCITY = ("--set", "gait.velocity=0.3 0 0; 0.2s 0 -0.1 0.5")


def test_a_walk_goes_where_it_is_told(command, tmp_path):
    first, second = tmp_path / "a.npz", tmp_path / "b.npz"
    code, out, _ = command("walk", "--duration", 0.5, *VELOCITY, "--save", first)
    assert code == 0
    assert "commanded" in out
    run = hp.Run.load(first)
    rows = ((0.0, 0.3, 0.0, 0.0), (0.2, 0.0, -0.1, 0.5))
    scenario = hp.Scenario(controller="condensed", gait=hp.Commanded(velocity=rows), duration=0.5)
    assert hp.Scenario.of(run) == scenario
    assert command("walk", "--again", first, "--save", second)[0] == 0
    np.testing.assert_array_equal(hp.Run.load(second)["q"], run["q"])


@pytest.mark.parametrize(
    "setting", ["governor=paper", "thrust=false", "evaluate_at=tracked", "legs=feedforward"]
)
def test_a_setting_of_the_governed_controller_chooses_it(setting):
    assert read_scenario([f"controller.{setting}"], friction=0.8).controller.name == "governed"


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_every_controller_walks_in_mujoco(command, tmp_path, controller):
    path = tmp_path / "a.npz"
    settings = (f"controller={controller}", "plant.preset=stiff", "ground.stiffness=4000")
    options = [part for setting in settings for part in ("--set", setting)]
    code, _, err = command("walk", *options, "--friction", 0.6, "--duration", 0.2, "--save", path)
    assert code == 0, err
    metadata = hp.Run.load(path).metadata
    assert metadata["plant"]["name"] == "mujoco"
    assert metadata["ground"]["stiffness"] == 40e3


def test_options_are_the_scenario():
    settings = (
        *(
            "controller=wbc",
            "controller.mu=0.3",
            "controller.estimate_friction=true",
            "controller.weights.swing=0.5",
        ),
        *(
            "ground.cone=per_axis",
            "ground.slope=0.03",
            "ground.friction_strips=[0.6,1.2,0.15],[1.5,2,0.05]",
        ),
        *(
            "dt=0.00025",
            "disturbances.mass_error=0.05",
            "disturbances.noise=0.5",
            "disturbances.delay=0.002",
        ),
        *("disturbances.seed=3", "disturbances.actuators.torque_share=0.9"),
        "gait.stiffness=9000",
    )
    push = ["0.05:0,2,-1", "0.1:1.5,0,0"]
    assert read_scenario(settings, friction=0.6, speed=0.2, push=push, duration=0.2) == hp.Scenario(
        controller=hp.WholeBody(
            parameters={"estimate_friction": True, "weights": {"swing": 0.5}}, mu=0.3
        ),
        ground=hp.Ground(
            mu_s=0.6,
            cone="per_axis",
            friction_strips=((0.6, 1.2, 0.15), (1.5, 2.0, 0.05)),
            slope=0.03,
        ),
        gait=hp.Straight(speed=0.2, stiffness=9000),
        duration=0.2,
        dt=0.00025,
        disturbances=hp.Disturbances(
            mass_error=0.05,
            noise=hp.Noise.typical(0.5),
            delay=0.002,
            seed=3,
            actuators=hp.Actuators(torque_share=0.9),
            pushes=(hp.Push(0.05, (0.0, 2.0, -1.0)), hp.Push(0.1, (1.5, 0.0, 0.0))),
        ),
    )


def test_a_terrain_is_set_by_its_name_and_its_settings():
    scenario = scenario_of(
        {"ground.terrain.rise": 0.04, "ground.terrain": "stairs", "ground.terrain.steps": 3}
    )
    assert scenario.ground.terrain == hp.ground.Stairs(rise=0.04, steps=3)


def test_every_setting_is_listed_and_can_be_set(command):
    """What the table lists with its default is what a scenario has where nothing is set."""
    default = hp.Scenario()
    named = {"gait": "hand", "controller": "condensed", "plant": "compliant"}
    names = set()
    for setting in settings_table():
        assert setting.meaning, setting.name
        assert setting.name not in names
        names.add(setting.name)
        part = setting.name.partition(".")[0]
        if setting.name not in ("ground", "disturbances") and named.get(part) in (
            *setting.parts,
            None,
        ):
            scenario = scenario_of({setting.name: setting.default})
            assert replace(scenario, controller="condensed") == default, setting.name
    assert {
        "controller.weights.swing",
        "controller.joints.k_p",
        "gait.schedule",
        "disturbances.noise.position",
    } < names
    code, out, _ = command("settings", "plant", "gait.velocity")
    assert code == 0
    assert "mujoco: " in out
    assert "controller" not in out
    assert command("settings", "colour")[0] == 2


def test_a_log_is_walked_again(command, tmp_path):
    first, second = tmp_path / "a.npz", tmp_path / "b.npz"
    start = (
        "--set",
        "disturbances.start_velocity=0.05,0,0,0,0,0",
        "--set",
        "disturbances.noise=0.3",
    )
    options = ("--duration", 0.2, *start, "--set", "disturbances.seed=3", "--push", "0.1:0,1,0")
    assert command("walk", *options, "--save", first)[0] == 0
    code, _, err = command("walk", "--again", first, "--save", second)
    assert code == 0, err
    a, b = hp.Run.load(first), hp.Run.load(second)
    for name in a.signals.keys() - {"tick_ns"}:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)
    assert hp.Scenario.of(a) == hp.Scenario.of(b)
    assert hp.Scenario.of(a).disturbances.start_velocity != (0.0,) * 6
    for option in (
        ("--speed", 0.3),
        ("--set", "dt=0.0005"),
        ("--robot", "harpy"),
        ("--push", "0.1:0,1,0"),
    ):
        code, _, err = command("walk", "--again", first, *option)
        assert code == 2
        assert "--again walks the scenario of its file" in err
        assert option[0] in err


def test_a_log_without_a_scenario_is_not_walked_again(gait, command, robot, tmp_path):
    simulator = hp.Simulator(robot)
    simulator.reset(*gait.initial_state(penetration=simulator.static_penetration))
    simulator.run(hp.make_controller("wbc", gait, mu=0.3), 0.002).save(tmp_path / "a.npz")
    code, _, err = command("walk", "--again", tmp_path / "a.npz")
    assert code == 2
    assert "holds no scenario" in err


def test_version(command):
    code, out, _ = command("--version")
    assert code == 0
    assert out == f"harpy {hp.__version__}\n"
    done = subprocess.run(
        [sys.executable, "-m", "harpy_pin", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout == out


def test_a_fall_has_its_own_exit_code_and_keeps_the_log(command, tmp_path):
    code, out, err = command("walk", *PAPER, "--friction", 0.0, "--save", tmp_path / "fall.npz")
    assert code == 1
    assert "fell" in err or "diverged" in err
    assert len(hp.Run.load(tmp_path / "fall.npz")) > 0
    assert "fell" in out


def test_a_walk_that_stumbles_does_not_count(command, tmp_path):
    arguments = (*PAPER, "--duration", 1.5, "--push", "0.5:0,60,0", "--json", tmp_path / "a.json")
    code, out, err = command("walk", *arguments)
    written = json.loads((tmp_path / "a.json").read_text())
    assert written["ending"] == "completed"
    assert written["stumbled"]
    assert code == 1
    line = " ".join(err.split())
    assert line.startswith(
        f"completed, but stumbled: the body tilted by {written['tilt_max_rad']:.2f} rad"
    )
    assert line.endswith("this does not count as walking")
    assert "stumbled" in out


def test_vlip_and_info(command, tmp_path):
    code, out, _ = command("vlip", "--duration", 0.5, "--json", tmp_path / "v.json")
    assert code == 0
    assert 0.0 <= json.loads((tmp_path / "v.json").read_text())["violation_share"] <= 1.0
    assert "reversals_per_s" in out
    code, out, _ = command("info")
    assert code == 0
    assert "4.020 kg" in out
    assert "left_knee" in out
    assert out.endswith(
        f"{ROOT / 'examples'}\ntutorials: {ROOT / 'docs' / 'tutorials'}\nnext: harpy robots\n"
    )


def test_gait_is_shown_searched_and_loaded(command, tmp_path):
    code, out, _ = command("gait", "--no-stability")
    assert code == 0
    assert "found by: harpy gait --search" in out
    found = tmp_path / "found.toml"
    search = ("gait", "--search", "paper", "--budget", 3, "--seed", 5, "--out", found)
    assert command(*search, "--resume", tmp_path / "search.json")[0] == 0
    first = found.read_text()
    assert "--search paper" in first
    assert command(*search, "--resume", tmp_path / "search.json")[0] == 0
    assert found.read_text() == first
    code, out, _ = command("gait", "--load", found, "--no-stability")
    assert code == 0
    assert "--seed 5 --budget 3" in " ".join(out.split())


def test_demo_walks_three_controllers_and_writes_their_page(command, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("harpy_pin.cli.walk.SHOWN", 0.3)
    page = tmp_path / "demo.html"
    code, out, _ = command("demo", "--html", page)
    assert code == 0
    names = ["Paper's governor", "Condensed controller", "Whole-body QP, ProxQP"]
    assert all(line.startswith(name) for line, name in zip(out.splitlines(), names, strict=False))
    assert all("mm per step" in line and len(line) <= 80 for line in out.splitlines()[:3])
    assert opened == [page.as_uri()]
    assert command("demo", "--no-open", "--html", page)[0] == 0
    assert len(opened) == 1


def test_a_walk_writes_its_page(command, tmp_path):
    page = tmp_path / "walk.html"
    code, out, _ = command("walk", "--duration", "0.1", "--html", page)
    assert code == 0
    assert page.read_text().startswith("<!DOCTYPE html>")
    assert " ".join(out.split()).endswith(f"next: open {page} in a browser")


def test_info_of_harpy(command):
    assert "thrusters left_thruster, right_thruster, 53 N each" in " ".join(
        command("info")[1].split()
    )


@needs_robots
def test_info_of_go2(command):
    code, out, _ = command("info", "--robot", "go2")
    assert (code, "thrusters" in out) == (0, False)
    assert "FL_hip_joint" in out


def test_harpy_alone_shows_six_first_things_that_are_commands(command):
    code, out, _ = command()
    assert (code, len(named := re.findall(r"^  harpy (\w+)", out, re.M))) == (0, 6)
    assert {*named} <= {info.name or info.callback.__name__ for info in cli.app.registered_commands}
    assert max(map(len, out.splitlines())) <= 80


def test_view_draws_figures(command, tmp_path):
    log = tmp_path / "a.npz"
    hp.walk(hp.Scenario(controller="condensed", duration=0.05), save=log)
    assert command("view", log, "--figures", tmp_path / "a.svg")[0] == 0
    for name in ("feet", "body", "effort"):
        assert (tmp_path / f"a-{name}.svg").stat().st_size > 5000


@pytest.mark.parametrize(
    "name",
    [(), ("demo",), ("walk",), ("view",), ("vlip",), ("gait",), ("paper",), ("info",), ("robots",)],
)
def test_help(command, name):
    code, out, _ = command(*name, "--help")
    assert code == 0
    assert "Usage" in out
    assert len(out.splitlines()) > 5


@needs_robots
def test_the_table_is_of_what_the_robot_has(command):
    code, out, _ = command("walk", "--robot", "go2", "--duration", 0.1)
    assert code == 0
    assert "thrust" not in out
    assert re.search(r"steps\s+│\s+0\.\d │", out)
    assert "largest thrust, N" in command("walk", "--duration", 0.1)[1]


@needs_robots
@needs_chromium
def test_film_of_a_robot(command, tmp_path):
    path, crawls = tmp_path / "dog.gif", ("--set", "gait.schedule=crawl")
    assert (
        command("film", path, "--robot", "Solo", *crawls, "--duration", 0.85, "--size", "200x150")[
            0
        ]
        == 0
    )
    with Image.open(path) as film:
        assert film.size == (200, 150)
        assert film.n_frames >= 6
