from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import harpy_pin as hp
from harpy_pin.cli import app as cli
from harpy_pin.cli import walk as walk_command
from harpy_pin.controllers import CONTROLLERS
from reproduction.cli import app as reproduction

ROOT = Path(__file__).resolve().parents[2]


def harpy(monkeypatch, capsys, *arguments: object):
    """Run the command in this process: exit code, standard output, standard error."""
    app = reproduction if arguments[:1] and arguments[0] in ("gait", "governors", "paper", "vlip") else cli
    monkeypatch.setattr(sys, "argv", ["harpy", *map(str, arguments)])
    with pytest.raises(SystemExit) as ending:
        app.main()
    captured = capsys.readouterr()
    return ending.value.code or 0, captured.out, captured.err


@pytest.fixture
def command(monkeypatch, capsys):
    return lambda *arguments: harpy(monkeypatch, capsys, *arguments)


def test_walk_writes_log_and_json(command, tmp_path):
    code, out, _ = command("walk", "--duration", 0.4, "--save", tmp_path / "a.npz", "--json", tmp_path / "a.json")
    assert code == 0
    assert "slip, mm per step" in out
    run = hp.Run.load(tmp_path / "a.npz")
    written = json.loads((tmp_path / "a.json").read_text())
    measures = hp.measure(run).as_dict()
    for name in (
        "fell",
        "distance_m",
        "slip_mm_per_step",
        "late_slip_mm_per_step",
        "sliding",
        "low_force",
        "no_contact",
    ):
        assert written[name] == measures[name]
    assert hp.Scenario.of(run) == hp.Scenario(controller="condensed", ground=hp.Ground(mu_s=0.8), duration=0.4)
    assert run.metadata["versions"]["pin"]
    assert run.metadata["controller"] == "CondensedController"


def test_a_walk_goes_where_it_is_told(command, tmp_path):
    first, second = tmp_path / "a.npz", tmp_path / "b.npz"
    code, out, _ = command("walk", "--duration", 0.5, "--command", "0.3 0 0; 0.2s 0 -0.1 0.5", "--save", first)
    assert code == 0
    assert "commanded" in out
    run = hp.Run.load(first)
    rows = ((0.0, 0.3, 0.0, 0.0), (0.2, 0.0, -0.1, 0.5))
    scenario = hp.Scenario(
        controller="condensed", gait=hp.Commanded(velocity=rows), ground=hp.Ground(mu_s=0.8), duration=0.5
    )
    assert hp.Scenario.of(run) == scenario
    assert command("walk", "--again", first, "--save", second)[0] == 0
    np.testing.assert_array_equal(hp.Run.load(second)["q"], run["q"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0.3 0", "must look like"),
        ("0.3 0 0; 0.1 0 0", "must look like"),
        ("0.3 0 0; 2 0 0 0", "must look like"),
        ("a 0 0", "must look like"),
        ("", "must look like"),
        ("0.3 0 nan", "command"),
        ("2s 0 0 0; 1s 0 0 0", "must grow"),
    ],
)
def test_a_command_that_is_none_is_refused(command, text, message):
    code, _, err = command("walk", "--command", text)
    assert code == 2
    assert message in " ".join(err.split())


def test_a_command_is_for_the_commanded_gait(command):
    for option in (("--gait", "hand"), ("--governor", "paper"), ("--controller", "governed")):
        assert command("walk", "--command", "0.3 0 0", *option)[0] == 2


def test_an_option_of_the_governed_controller_chooses_it(command, tmp_path):
    for option in (("--governor", "paper"), ("--no-thrust",), ("--limits",), ("--evaluate-at", "tracked")):
        assert command("walk", "--duration", 0.02, *option, "--save", tmp_path / "a.npz")[0] == 0
        assert hp.Run.load(tmp_path / "a.npz").metadata["parameters"]["governor"] == "ExplicitReferenceGovernor"


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_every_controller_walks_in_mujoco(command, tmp_path, controller):
    path = tmp_path / "a.npz"
    options = (
        "--plant",
        "mujoco",
        "--plant-preset",
        "stiff",
        "--friction",
        0.6,
        "--stiffness",
        4000,
        "--duration",
        0.2,
    )
    code, out, _ = command("walk", "--controller", controller, *options, "--profile", "--save", path)
    assert code == 0
    assert "physics steps" in out
    metadata = hp.Run.load(path).metadata
    assert metadata["plant"]["name"] == "mujoco"
    assert metadata["ground"]["stiffness"] == 40e3


def test_same_seed_same_walk(command, tmp_path):
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        arguments = ("--duration", 0.2, "--perturbation", 0.05, "--seed", seed)
        assert command("walk", *arguments, "--save", tmp_path / f"{name}.npz")[0] == 0
    a, b, c = (hp.Run.load(tmp_path / f"{name}.npz")["q"] for name in "abc")
    np.testing.assert_array_equal(a, b)
    assert np.abs(a - c).max() > 1e-4


def test_options_are_the_scenario(command, tmp_path):
    options = {
        "--controller": "wbc",
        "--assumed-friction": 0.3,
        "--friction": 0.6,
        "--cone": "per_axis",
        "--speed": 0.2,
        "--duration": 0.2,
        "--dt": 0.00025,
        "--mass-error": 0.05,
        "--noise": 0.5,
        "--delay": 0.002,
        "--seed": 3,
        "--save": tmp_path / "a.npz",
    }
    arguments = [part for option in options.items() for part in option]
    repeated = ("--push", "0.05:0,2,-1", "--push", "0.1:1.5,0,0", "--ice", "1.5:2:0.05", "--ice", "0.6:1.2:0.15")
    code, _, err = command("walk", *arguments, "--govern-command", "--estimate-friction", *repeated)
    assert code == 0, err
    assert hp.Scenario.of(hp.Run.load(tmp_path / "a.npz")) == hp.Scenario(
        controller=hp.WholeBody(parameters={"govern_command": True, "estimate_friction": True}, mu=0.3),
        ground=hp.Ground(mu_s=0.6, cone="per_axis", friction_strips=((0.6, 1.2, 0.15), (1.5, 2.0, 0.05))),
        gait=hp.Straight(speed=0.2),
        duration=0.2,
        dt=0.00025,
        disturbances=hp.Disturbances(
            mass_error=0.05,
            noise=hp.Noise.typical(0.5),
            delay=0.002,
            seed=3,
            pushes=(hp.Push(0.05, (0.0, 2.0, -1.0)), hp.Push(0.1, (1.5, 0.0, 0.0))),
        ),
    )


def test_a_log_is_walked_again(command, tmp_path):
    first, second = tmp_path / "a.npz", tmp_path / "b.npz"
    options = ("--duration", 0.2, "--perturbation", 0.05, "--noise", 0.3, "--seed", 3, "--push", "0.1:0,1,0")
    assert command("walk", *options, "--save", first)[0] == 0
    code, _, err = command("walk", "--again", first, "--save", second)
    assert code == 0, err
    a, b = hp.Run.load(first), hp.Run.load(second)
    for name in a.signals.keys() - {"tick_ns"}:
        np.testing.assert_array_equal(a[name], b[name], err_msg=name)
    assert hp.Scenario.of(a) == hp.Scenario.of(b)
    assert hp.Scenario.of(a).disturbances.start_velocity != (0.0,) * 6
    for option in (("--speed", 0.3), ("--mass-error", 0.1), ("--limits",), ("--thrust",), ("--push", "0.1:0,1,0")):
        code, _, err = command("walk", "--again", first, *option)
        assert code == 2
        assert "--again walks the scenario of its file" in err
        assert option[0] in err


def test_a_log_without_a_scenario_is_not_walked_again(command, robot, tmp_path):
    gait = hp.make_gait(robot)
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
    done = subprocess.run([sys.executable, "-m", "harpy_pin", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == out


def test_profile_says_where_the_time_went_and_changes_nothing(command, tmp_path):
    arguments = ("walk", "--duration", 0.2, "--json", tmp_path / "a.json", "--save")
    code, out, _ = command(*arguments, tmp_path / "plain.npz")
    assert code == 0
    assert "real time" not in out
    assert "profile" not in json.loads((tmp_path / "a.json").read_text())
    code, out, _ = command(*arguments, tmp_path / "timed.npz", "--profile")
    assert code == 0
    for part in ("controller tick", "physics steps", "log", "rest", "total"):
        assert part in out
    assert json.loads((tmp_path / "a.json").read_text())["profile"]["ticks"] == 200
    plain, timed = (hp.Run.load(tmp_path / f"{name}.npz") for name in ("plain", "timed"))
    for name in plain.signals.keys() - {"tick_ns"}:
        np.testing.assert_array_equal(plain[name], timed[name], err_msg=name)


def test_a_fall_has_its_own_exit_code_and_keeps_the_log(command, tmp_path):
    code, out, err = command("walk", "--governor", "paper", "--friction", 0.0, "--save", tmp_path / "fall.npz")
    assert code == 1
    assert "fell" in err or "diverged" in err
    assert len(hp.Run.load(tmp_path / "fall.npz")) > 0
    assert "fell" in out


def test_a_walk_that_stumbles_does_not_count(command, tmp_path):
    arguments = ("--governor", "paper", "--duration", 1.5, "--push", "0.5:0,60,0", "--json", tmp_path / "a.json")
    code, out, err = command("walk", *arguments)
    written = json.loads((tmp_path / "a.json").read_text())
    assert written["ending"] == "completed"
    assert written["stumbled"]
    assert code == 1
    line = " ".join(err.split())
    assert line.startswith(f"completed, but stumbled: the body tilted by {written['tilt_max_rad']:.2f} rad")
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
    assert out.splitlines()[-2:] == [f"examples: {ROOT / 'examples'}", f"tutorials: {ROOT / 'docs' / 'tutorials'}"]


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


@pytest.mark.parametrize("gait", ["hand", "optimised", "paper-curves"])
def test_every_gait_walks_a_little(command, gait, tmp_path):
    code, _, err = command("walk", "--gait", gait, "--duration", 0.3, "--friction", 0.25, "--json", tmp_path / "a.json")
    assert code == 0, err
    assert json.loads((tmp_path / "a.json").read_text())["metadata"]["scenario"]["gait"]["name"] == gait


def test_optimised_gait_under_the_papers_governor(command, tmp_path):
    """Ten seconds at the paper's friction: speed, angles, slip, and the normal force against no governor's."""
    results = {}
    for governor in ("none", "paper"):
        arguments = ("--gait", "optimised", "--friction", 0.25, "--duration", 10, "--governor", governor)
        assert command("walk", *arguments, "--json", tmp_path / "a.json")[0] == 0
        results[governor] = json.loads((tmp_path / "a.json").read_text())
    walk = results["paper"]
    assert not walk["fell"]
    assert walk["distance_m"] == pytest.approx(3.0, rel=0.05)
    assert max(walk[f"{angle}_max_rad"] for angle in ("roll", "pitch", "yaw")) <= 0.15
    assert walk["slip_mm_per_step"] <= 8.0
    assert walk["late_slip_mm_per_step"] <= 1.0
    assert walk["low_force"] < 0.5 * results["none"]["low_force"]


def test_demo_walks_three_controllers_and_writes_their_page(command, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("harpy_pin.cli.demo.DURATION", 0.3)
    page = tmp_path / "demo.html"
    code, out, _ = command("demo", "--html", page)
    assert code == 0
    names = ["Paper's governor", "Condensed controller", "Whole-body QP"]
    assert all(line.startswith(name) for line, name in zip(out.splitlines(), names, strict=False))
    assert all("mm per step" in line and len(line) <= 80 for line in out.splitlines()[:3])
    assert opened == [page.as_uri()]
    assert command("demo", "--no-open", "--html", page)[0] == 0
    assert len(opened) == 1


def test_view_draws_figures(command, tmp_path):
    log = tmp_path / "a.npz"
    hp.walk(hp.Scenario(controller="condensed", duration=0.05), save=log)
    for kind in ("pdf", "svg"):
        assert command("view", log, "--figures", tmp_path / f"a.{kind}")[0] == 0
        for name in ("forces", "references", "thrusts"):
            assert (tmp_path / f"a-{name}.{kind}").stat().st_size > 5000


@pytest.mark.parametrize(
    "name",
    [(), ("demo",), ("walk",), ("view",), ("vlip",), ("governors",), ("gait",), ("paper",), ("info",), ("robots",)],
)
def test_help(command, name):
    code, out, _ = command(*name, "--help")
    assert code == 0
    assert "Usage" in out
    assert len(out.splitlines()) > 5


def truncated_urdf(tmp_path):
    path = tmp_path / "cut.urdf"
    text = (ROOT / "urdf" / "harpy.urdf").read_text()
    path.write_text(text[: len(text) // 2])
    return path


def footless_urdf(tmp_path):
    path = tmp_path / "footless.urdf"
    path.write_text((ROOT / "urdf" / "harpy.urdf").read_text().replace("_foot", "_paw"))
    return path


def corrupted_log(tmp_path):
    path = tmp_path / "bad.npz"
    path.write_bytes(b"PK\x03\x04" + bytes(range(256)) * 4)
    return path


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (lambda p: ("walk", "--urdf", p / "none.urdf"), "no URDF"),
        (lambda p: ("walk", "--urdf", truncated_urdf(p)), "well-formed"),
        (lambda p: ("walk", "--urdf", footless_urdf(p)), "no foot frame 'left_foot'"),
        (lambda p: ("info", "--urdf", p), "no URDF"),
        (lambda p: ("walk", "--ice", "0.6:1.2"), "FROM:TO:MU"),
        (lambda p: ("walk", "--ice", "1.2:0.6:0.1"), "strip"),
        (lambda p: ("walk", "--ice", "0:1:0.1", "--ice", "0.5:2:0.1"), "strips"),
        (lambda p: ("walk", "--governor", "none", "--estimate-friction"), "governor"),
        (lambda p: ("walk", "--speed", 9), "reach"),
        (lambda p: ("walk", "--dt", 0.0007), "multiple"),
        (lambda p: ("walk", "--delay", 0.0005), "multiple of the period"),
        (lambda p: ("walk", "--push", "2.0"), "TIME:X,Y,Z (s and N·s), got '2.0'"),
        (lambda p: ("walk", "--push", "2.0:1,2"), "TIME:X,Y,Z"),
        (lambda p: ("walk", "--push", "soon:0,5,0"), "TIME:X,Y,Z"),
        (lambda p: ("walk", "--push", "9:0,5,0"), "outside the run"),
        (lambda p: ("walk", "--push=-1:0,5,0"), "time of the push"),
        (lambda p: ("walk", "--controller", "wbc", "--no-thrust"), "--no-thrust is not for the controller 'wbc'"),
        (
            lambda p: ("walk", "--govern-command", "--controller", "governed"),
            "for the controllers 'wbc' and 'condensed'",
        ),
        (lambda p: ("walk", "--again", p / "none.npz"), "no run log"),
        (lambda p: ("walk", "--controller", "lqr"), "valid names: condensed, governed, wbc"),
        (lambda p: ("walk", "--governor", "best"), "valid names: cone, filter, none"),
        (lambda p: ("walk", "--cone", "square"), "valid names"),
        (lambda p: ("walk", "--json", p), "is a folder"),
        (lambda p: ("walk", "--gait", "trot"), "valid names: commanded, hand, hovering, optimised, paper-curves"),
        (lambda p: ("walk", "--gait", "optimised", "--speed", 0.2), "0.3 m/s"),
        (lambda p: ("gait", "--search", "everything"), "valid names"),
        (lambda p: ("gait", "--load", p / "none.toml"), "none.toml"),
        (lambda p: ("gait", "--search", "paper", "--out", p / "no" / "where.toml"), "no folder"),
        (lambda p: ("paper", "--out", corrupted_log(p)), "cannot write"),
        (lambda p: ("vlip", "--evaluate-at", "guessed"), "valid names"),
        (lambda p: ("view", p / "none.npz"), "no run log"),
        (lambda p: ("view", corrupted_log(p)), "damaged"),
        (lambda p: ("view", corrupted_log(p), "--html", p / "bad.npz"), "same file"),
        (lambda p: ("view", p / "a.npz", "--gif", p / "a.png"), "ends in .gif"),
        (lambda p: ("view", p / "a.npz", "--png", p / "a.png", "--times", "1,x"), "takes numbers"),
        (lambda p: ("view", p / "a.npz", "--times", "1"), "give --png"),
        (lambda p: ("view", p / "a.npz", "--size", "100"), "two numbers"),
        (lambda p: ("view", p / "a.npz", "--span", "2"), "two numbers"),
        (lambda p: ("view", p / "a.npz", "--figures", p / "a.bmp"), "must end in .png, .pdf, .svg"),
        (lambda p: ("view", *[p / f"{k}.npz" for k in range(5)]), "at most 4"),
        (lambda p: ("demo", "--html", p / "no" / "where.html"), "no folder"),
        (lambda p: ("walk", "--save", p / "a", "--json", p / "a"), "--save and --json are the same file"),
        (lambda p: ("walk", "--save", p / "a", "--json", p / "a.part"), "the journal of --save and --json"),
        (lambda p: ("walk", "--again", corrupted_log(p), "--json", p / "bad.npz"), "same file"),
        (lambda p: ("governors", "--figure", p / "a.bmp"), "must end in .png, .pdf, .svg"),
        (lambda p: ("governors", "--figure", p / "a.png", "--json", p / "a.png"), "same file"),
        (lambda p: ("gait", "--search", "paper", "--out", p / "a", "--resume", p / "a"), "same file"),
    ],
)
def test_bad_input_is_one_clear_line(command, tmp_path, arguments, says):
    code, out, err = command(*arguments(tmp_path))
    assert code not in (0, None)
    assert says in err
    assert err.startswith(("harpy: ", "reproduction: "))
    assert len(err.strip().splitlines()) == 1
    assert "Traceback" not in out + err


def test_unwritable_file_is_found_before_the_run(command, tmp_path, monkeypatch):
    monkeypatch.setattr(walk_command, "_run", lambda *_, **__: pytest.fail("the walk was run"))
    code, _, err = command("walk", "--save", tmp_path / "no" / "where.npz")
    assert code == 2
    assert "cannot write" in err
    assert "no folder" in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize(
    "arguments",
    [
        lambda p: ("governors", "--json", p / "out.json"),
        lambda p: ("paper", "--out", p / "report"),
        lambda p: ("walk", "--json", p / "out.json", "--save", p / "out.npz"),
    ],
    ids=["governors", "paper", "walk"],
)
def test_interrupted_command_stops(command, tmp_path, monkeypatch, number, code, arguments):
    """At the fifth tick of the first walk: no other walk is begun, and none is shown as if it were whole."""
    log, ticks = hp.Simulator.log, []
    before = signal.getsignal(signal.SIGTERM)

    def logged(self, *parts):
        log(self, *parts)
        ticks.append(self.t)
        if len(ticks) == 5:
            os.kill(os.getpid(), number)

    monkeypatch.setattr(hp.Simulator, "log", logged)
    monkeypatch.setattr(hp.Simulator, "compile_loop", lambda self, *_, **__: None)  # every tick is logged in Python
    ending, out, err = command(*arguments(tmp_path))
    assert ending == code
    assert "harpy: interrupted" in err
    assert "Traceback" not in out + err
    assert 5 <= len(ticks) <= 6
    assert signal.getsignal(signal.SIGTERM) is before
    written = {path.name for path in tmp_path.rglob("*") if path.is_file()}
    if arguments(tmp_path)[0] == "walk":
        assert written == {"out.json", "out.npz"}
        assert hp.Run.load(tmp_path / "out.npz").ending == "interrupted"
    else:
        assert out == ""
        assert written == set()
        assert "nothing more was written" in err


def wait_for_log(path):
    """Until a walk in another process has written some seconds of its log."""
    for _ in range(3000):
        if path.exists() and path.stat().st_size > 2_000_000:
            return
        time.sleep(0.05)


def test_killed_walk_is_viewed(command, tmp_path):
    log = tmp_path / "cut.npz"
    arguments = ("walk", "--duration", "600", "--save", str(log))
    with subprocess.Popen([sys.executable, "-m", "harpy_pin", *arguments], cwd=ROOT) as process:
        wait_for_log(tmp_path / "cut.npz.part")
        process.kill()
    code, out, err = command("view", log, "--html", tmp_path / "cut.html")
    assert code == 0
    assert err.startswith(("harpy: ", "reproduction: "))
    assert "has not ended" in err
    assert len(err.splitlines()) == 1
    assert "wrote" in out
    assert "unfinished" in (tmp_path / "cut.html").read_text()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    "arguments", [("vlip", "--duration", 0.2, "--json"), ("walk", "--duration", 0.02, "--json")], ids=["vlip", "walk"]
)
def test_results_are_shown_before_they_are_written(command, arguments):
    code, out, err = command(*arguments, "/dev/full")
    assert code == 2
    assert "measure" in out
    assert err.split(": ", 1)[1] == "cannot write '/dev/full': No space left on device\n"
