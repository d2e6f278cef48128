"""A robot of one's own, that is known by no name, goes wherever a name goes."""

import json
import warnings
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.model.legs import legs
from harpy_pin.model.robot import heavier
from harpy_pin.model.source import read_robot
from harpy_pin.view.identity import robot_of
from harpy_pin.view.page.shown import headline, line_up

pytestmark = needs_robots
FEET = ("FL_foot", "FR_foot", "RL_foot", "RR_foot")


@pytest.fixture
def dog(tmp_path):
    """Go2's file under another name, with its meshes."""
    root = ET.parse(CATALOGUE["go2"].path()).getroot()
    root.set("name", "my-dog")
    (tmp_path / "example-robot-data").symlink_to(CATALOGUE["go2"].path().parents[3])
    ET.ElementTree(root).write(tmp_path / "dog.urdf")
    return tmp_path / "dog.urdf"


@pytest.mark.parametrize(
    "name", ["go2", "solo12", "anymal_c", "hyq", "bolt", "solo8", "talos", "icub", "g1"]
)
def test_a_posture_is_found_where_there_is_none(name):
    """Feet are on one level and point feet below the hips' pitch axes, within limits, and soles are
    level.
    """
    robot = replace(hp.load_robot(name), posture=None)
    q = hp.Standing(robot).initial_state()[0]
    assert ((q[7:] >= robot.joint_lower) & (q[7:] <= robot.joint_upper)).all()
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    feet = np.array([data.oMf[robot.frame_id(foot)].translation for foot in robot.feet])
    assert np.ptp(feet[:, 2]) < 1e-4
    if not robot.flat_feet:
        hips = [data.oMi[leg.joints[-2]].translation for leg in legs(robot)]
        np.testing.assert_allclose(feet[:, 0], np.array(hips)[:, 0], atol=1e-5)


def test_postures_that_are_none():
    robot = replace(hp.load_robot("go2", feet=("FL_foot", "FL_calf")), posture=None)
    uneven = hp.load_robot("go2", posture=[0.0, 0.7, -1.4, *[0.0, 0.9, -1.8] * 3])
    for one, says in (
        (uneven, "feet are not on one level"),
        (robot, "was found: give one, of 12 angles"),
    ):
        with pytest.raises(hp.InputError, match=says):
            hp.Standing(one)


def test_a_scenario_of_it_is_written_down_and_walked_again(dog, tmp_path):
    robot = hp.load_robot(dog, feet=FEET).with_joints(armature=0.01, damping=0.1)
    scenario = hp.Scenario(robot=robot, duration=0.3, ground=hp.Ground(mu_s=0.6))
    assert scenario.ground.stiffness == pytest.approx(robot.mass * 9.81 / 0.002)
    assert scenario.gait.name == "walking"
    read = hp.Scenario.from_dict(json.loads(json.dumps(scenario.to_dict())))
    assert (read, hash(read)) == (scenario, hash(scenario))
    assert read != replace(scenario, robot=hp.load_robot(dog, feet=FEET))
    run = hp.walk(scenario, save=tmp_path / "dog.npz")
    loaded = hp.Run.load(tmp_path / "dog.npz")
    again = hp.walk(hp.Scenario.of(loaded))
    np.testing.assert_array_equal(again["q"], run["q"])
    assert robot_of(loaded).model == robot.model
    for known, name in ((hp.load_harpy(), "harpy"), (hp.load_robot("go2"), "go2")):
        assert hp.Scenario(robot=known).robot == name


def test_a_file_that_has_changed_is_said(dog):
    robot = hp.load_robot(dog, feet=FEET)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_robot(robot.source)
    dog.write_text(dog.read_text().replace('mass value="', 'mass value="1', 1))
    with pytest.warns(UserWarning, match=r"dog\.urdf' was another file when it was written down"):
        assert read_robot(robot.source).mass > robot.mass


def test_a_nanometre_changes_no_gait(dog):
    before = hp.WalkingGait(hp.load_robot(dog, feet=FEET))
    root = ET.parse(dog).getroot()
    origin = root.find("joint[@name='FL_hip_joint']/origin")
    x, y, z = origin.get("xyz").split()
    origin.set("xyz", f"{float(x) + 1e-9} {y} {z}")
    ET.ElementTree(root).write(dog)
    after = hp.WalkingGait(hp.load_robot(dog, feet=FEET))
    assert after.double_support == before.double_support
    assert after.max_speed == pytest.approx(before.max_speed, rel=0.01)


def test_what_a_scenario_cannot_write_down(dog):
    robot = hp.load_robot(dog, feet=FEET)
    with pytest.raises(
        hp.InputError, match=r"'my-dog' is not what its file says.* with_joints, or give hp.walk"
    ):
        hp.Scenario(robot=heavier(robot, 0.1))
    source = {"file": str(dog), "feet": list(FEET)}
    for bad, says in (
        ({"feets": ["a"]}, "unknown entry of the robot 'feets'"),
        ({"feet": ["nose"]}, "no foot frame 'nose'"),
        ({"file": None}, "urdf must be a path"),
        ({"model": {"armature": [1.0]}}, "armature of the robot must have shape"),
        ({"flat_feet": {"FL_foot": 3}}, "this describes no robot"),
        ({"rotors": [{"frame": "base"}]}, "this describes no robot"),
    ):
        with pytest.raises(hp.HarpyError, match=says):
            hp.Scenario(robot={**source, **bad})
    for feetless, says in (
        ({"file": str(dog)}, "ends of limbs first: FL_foot, .*RR_foot"),
        (str(dog), "--robot FILE --feet"),
    ):
        with pytest.raises(hp.InputError, match=says):
            hp.Scenario(robot=feetless)


def test_flat_feet_rotors_and_an_infinite_limit_are_written_down():
    rotors = [hp.Rotor(f"iris__rotor_{k}", drag=0.02) for k in range(4)]
    flyer = hp.load_robot(CATALOGUE["iris"].path(), feet=(), rotors=rotors)
    assert hp.Scenario(robot=flyer).gait.name == "hovering"
    sole = hp.FlatFoot(length=0.2, width=0.12)
    feet = ("left_sole_link", "right_sole_link")
    biped = hp.load_robot(CATALOGUE["talos"].path(), feet=feet, flat_feet=dict.fromkeys(feet, sole))
    for robot in (flyer, biped):
        read = read_robot(json.loads(json.dumps(hp.Scenario(robot=robot).to_dict()))["robot"])
        assert (read.feet, read.flat_feet, read.rotors) == (
            robot.feet,
            robot.flat_feet,
            robot.rotors,
        )
        assert read.model == robot.model
    short = hp.load_robot(CATALOGUE["solo8"].path(), feet=CATALOGUE["solo8"].feet)
    assert hp.Scenario(robot=short).gait.name == "standing"


def test_the_ground_fits_where_only_friction_is_given():
    """One foot is 2 mm deep that bears all, standing four 5 mm; also of a gait of one's own. What
    is given stays.
    """
    robot, friction = hp.load_robot("go2"), hp.Ground(mu_s=0.4)
    fitting = robot.mass * 9.81 / 0.002
    assert hp.Scenario(robot="go2", ground=friction).ground == hp.Ground(
        mu_s=0.4, stiffness=fitting
    )
    assert hp.Scenario(robot="go2", gait="standing").ground.stiffness == pytest.approx(
        0.1 * fitting
    )
    assert hp.Scenario(robot="go2", ground=hp.Ground(stiffness=8e3)).ground.stiffness == 8e3
    assert hp.Scenario(robot="go2", ground=hp.Ground(damping=3.0)).ground.damping == 3.0
    built = hp.build(hp.Scenario(ground=friction), gait=hp.WalkingGait(robot))
    assert (
        built.simulator.ground.stiffness
        == built.scenario.ground.stiffness
        == pytest.approx(fitting)
    )
    for harpy in (
        hp.Scenario().ground,
        hp.build(hp.Scenario(), gait=hp.make_gait(hp.load_harpy())).simulator.ground,
    ):
        assert harpy == hp.Ground()


def test_commands_take_a_file(dog, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    robot = ("--robot", "dog.urdf", "--feet", ",".join(FEET))
    code, out, err = command(
        "walk", *robot, "--duration", 0.2, "--posture", "0,0.7,-1.4", "--save", "dog.npz"
    )
    assert (code, err) == (0, "")
    assert "my-dog, condensed, walking gait" in " ".join(out.split())
    run = hp.Run.load("dog.npz")
    assert run.metadata["ground"]["mu_s"] == hp.Scenario().ground.mu_s
    np.testing.assert_allclose(run["q"][0, 7:], [0.0, 0.7, -1.4] * 4, atol=1e-12)
    monkeypatch.chdir("/")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert command("view", tmp_path / "dog.npz", "--html", tmp_path / "dog.html")[0] == 0
    assert (tmp_path / "dog.html").stat().st_size > 1_000_000  # with its meshes
    monkeypatch.chdir(tmp_path)
    dog.rename("moved.urdf")
    assert "dog.urdf" in command("view", "dog.npz", "--html", "dog.html")[2]
    assert command("view", "dog.npz", "--robot", "moved.urdf", "--html", "dog.html")[0] == 0
    monkeypatch.setattr("harpy_pin.export.folder.missing_tools", lambda: "none desired")
    words = ("export", "moved.urdf", "--feet", ",".join(FEET), "--to", "c", "--precision", "double")
    assert command(*words)[0] == 0
    assert (tmp_path / "c" / "my_dog_condensed.c").is_file()


def test_a_loop_of_ones_own_is_a_run(dog, tmp_path):
    """Recorded by hand it has what the plant's own run has, and is saved, measured, seen; a motors'
    law, too.
    """
    robot = hp.load_robot(dog, feet=FEET)
    ground = hp.Ground(mu_s=0.6).fitted(robot, walks=True)

    def parts():
        gait, plant = hp.WalkingGait(robot, velocity=(0.3, 0.0, 0.0)), hp.Simulator(robot, ground)
        plant.reset(*gait.initial_state(penetration=plant.static_penetration))
        return plant, hp.make_controller("condensed", gait, mu=0.6, joint_stiffness=1.0)

    plant, controller = parts()
    expected = plant.run(controller, 0.3)
    plant, controller = parts()
    recorder = hp.Recorder(robot, controller, ground=ground)
    for tick in range(300):
        plant.t = 1e-3 * tick
        command = controller.step(plant.state)
        recorder.add(plant.state, command)
        plant.advance(command, steps=2)
    run = recorder.run()
    assert set(expected.keys()) - set(run.keys()) == {"slip_path", "slip_net", "tick_ns"}
    for name in set(run.keys()) - {"motor_torque"}:
        np.testing.assert_array_equal(run[name], expected[name], err_msg=name)
    np.testing.assert_allclose(run["motor_torque"], expected["motor_torque"], atol=0.3)
    same = set(run.metadata) - {"end_time", "control_period"}
    assert {name: run.metadata[name] for name in same} == {
        name: expected.metadata[name] for name in same
    }
    run.save(tmp_path / "own.npz")
    loaded = hp.Run.load(tmp_path / "own.npz")
    assert hp.measure(loaded).distance_m == hp.measure(expected).distance_m
    assert robot_of(loaded).model == robot.model


def test_the_example_of_the_docs(tmp_path, monkeypatch, capsys):
    """From an MJCF file to a walk in MuJoCo, recorded; as it is printed, with a file that MuJoCo
    has written.
    """
    pytest.importorskip("mujoco")
    from own_models import described

    spec = described(hp.load_robot("go2"), actuators="motor")
    spec.geoms[0].pos[2] = 0.0
    (tmp_path / "dog.xml").write_text(spec.to_xml())
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[2] / "docs" / "robots.md").read_text()
    exec(page.partition("<!-- needs dog.xml -->\n```python\n")[2].partition("```")[0], {"hp": hp})
    run = hp.Run.load("walk.npz")
    assert (run.ending, len(run) >= 1500) == ("completed", True)
    assert hp.measure(run).distance_m > 0.8
    assert len(line_up(run)[0].frames.robot.joints) == 12


def test_what_no_recorder_takes(go2, tmp_path):
    q, v = hp.Standing(go2).initial_state()
    recorder = hp.Recorder(go2)

    def add(t, height=0.3, torque=0.0):
        place = np.zeros((4, 3))
        recorder.add(
            hp.State(t, np.array([*q[:2], height, *q[3:]]), v, place, place, place),
            hp.Command([torque] * 12),
        )

    with pytest.raises(hp.InputError, match="two ticks at least"):
        recorder.run()
    add(0.0)
    add(0.002)
    for t, torque in ((0.002, 0.0), (0.001, 0.0), (0.004, np.nan)):
        with pytest.raises(
            hp.InputError, match=r"time must go on from tick to tick|torque must be finite"
        ):
            add(t, torque=torque)
    for t in (0.004, 0.0123, 0.0143):  # the loop stalled once
        add(t, height=0.1)
    run = recorder.run()
    assert (run.ending, len(run), run.metadata["control_period"]) == (
        "fell",
        5,
        pytest.approx(0.002),
    )
    run.save(tmp_path / "late.npz")
    np.testing.assert_array_equal(
        hp.Run.load(tmp_path / "late.npz")["t"], (0.0, 0.002, 0.004, 0.0123, 0.0143)
    )


def test_it_is_said_why_a_walk_falls(monkeypatch, command, tmp_path):
    """Of joints that are not as believed contact forces are not as planned; weak motors are at
    their limits.
    """
    monkeypatch.chdir(tmp_path)
    found = []
    for motors, ending in (
        ("torque_share=1", 0),
        ("torque_share=0.3", 0),
        ("coulomb_friction=1", 1),
    ):
        options = (
            "--robot",
            "go2",
            "--friction",
            0.6,
            f"--set=disturbances.actuators.{motors}",
            "--save",
            "a.npz",
        )
        code, out, err = command("walk", *options)
        assert (code, "contact forces less those planned" in out) == (ending, True)
        found.append(hp.measure(hp.Run.load("a.npz")))
    exact, weak, dry = found
    assert exact.force_mismatch < 0.03 < 0.05 < min(weak.force_mismatch, dry.force_mismatch)
    assert exact.clipped == 0.0 < 0.01 < min(weak.clipped, dry.clipped)
    assert dry.causes in err
    assert dict(headline(line_up(hp.Run.load("a.npz"))[0])[1])["why"] == dry.causes


def test_what_a_file_lacks_is_said_once(dog, command):
    """A walk by patterns reads its file three times."""
    dog.write_text(dog.read_text().replace('effort="23.7"', 'effort="0"', 1))
    code, _, err = command("walk", "--robot", str(dog), "--feet", "*_foot", "--duration", 0.05)
    assert (code, err.count("moves them: 'FL_hip_joint'")) == (0, 1)


def test_why_a_robot_stands_is_said(command):
    code, out, _ = command("walk", "--robot", "solo8", "--set=controller=wbc", "--duration", 0.05)
    said = (
        "solo8, wbc, standing gait, compliant plant ('solo8' has a leg of fewer than three "
        "joints: its feet"
    )
    assert (code, said in " ".join(out.split())) == (0, True)


def test_an_environment_of_it(dog):
    gymnasium = pytest.importorskip("gymnasium")
    robot, name = hp.load_robot(dog, feet=FEET), "harpy_pin.contrib.gym:Robot-v0"
    of_it = hp.Scenario(robot=robot)
    for options in (
        {"robot": robot},
        {"scenario": of_it},
        {"robot": robot, "scenario": hp.Scenario()},
    ):
        env = gymnasium.make(name, velocity=(0.3, 0.0, 0.0), **options).unwrapped
        env.reset(seed=0)
        assert env.robot.name == "my-dog"
        assert env.simulator.ground.stiffness == pytest.approx(robot.mass * 9.81 / 0.002)
        assert not env.step(np.zeros(3, np.float32))[2]
    with pytest.raises(
        hp.InputError, match="the scenario is of 'solo12', and the environment of 'my-dog'"
    ):
        gymnasium.make(name, robot=robot, scenario=hp.Scenario(robot="solo12"))
