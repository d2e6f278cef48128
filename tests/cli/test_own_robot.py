"""A robot of one's own, that is known by no name, goes wherever a name goes."""

from __future__ import annotations

import json
import warnings
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.model.posture import find_posture
from harpy_pin.model.robot import heavier
from harpy_pin.model.source import read_robot
from harpy_pin.view.identity import robot_of

pytestmark = needs_robots
FEET = ("FL_foot", "FR_foot", "RL_foot", "RR_foot")
SOLES = ("talos", "icub", "g1")


@pytest.fixture
def dog(tmp_path):
    """Go2's file under another name, with its meshes."""
    root = ET.parse(CATALOGUE["go2"].path()).getroot()
    root.set("name", "my-dog")
    (tmp_path / "example-robot-data").symlink_to(CATALOGUE["go2"].path().parents[3])
    ET.ElementTree(root).write(tmp_path / "dog.urdf")
    return tmp_path / "dog.urdf"


@pytest.mark.parametrize("name", ["go2", "solo12", "anymal_c", "hyq", "bolt", "solo8", *SOLES])
def test_a_posture_is_found_where_there_is_none(name):
    """Feet are on one level below their hips, within limits, and soles are level."""
    robot = replace(hp.load_robot(name), posture=None)
    posture = find_posture(robot)
    assert (posture >= robot.joint_lower).all()
    assert (posture <= robot.joint_upper).all()
    model, q = robot.model, pin.neutral(robot.model)
    q[7:] = posture
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    feet = np.array([data.oMf[robot.frame_id(foot)].translation for foot in robot.feet])
    assert np.ptp(feet[:, 2]) < 1e-4
    hips = [
        data.oMi[model.supports[model.frames[robot.frame_id(foot)].parentJoint][2]].translation for foot in robot.feet
    ]
    assert feet[:, 2].max() < np.array(hips)[:, 2].min()
    if name not in SOLES:
        assert np.abs(feet - hips)[:, 0].max() < 0.1 * np.ptp(feet[:, 1])
    np.testing.assert_array_equal(hp.Standing(robot).initial_state()[0][7:], posture)


def test_a_posture_that_does_not_exist():
    robot = hp.load_robot("go2", feet=("FL_foot", "FL_calf"))
    with pytest.raises(
        hp.InputError, match=r"no standing posture .* was found: give one, of 12 angles in the order of"
    ):
        hp.Standing(replace(robot, posture=None))


def test_a_scenario_of_it_is_written_down_and_walked_again(dog, tmp_path):
    robot = hp.load_robot(dog, feet=FEET).with_joints(armature=0.01, damping=0.1)
    scenario = hp.Scenario(robot=robot, duration=0.3, ground=hp.Ground(mu_s=0.6))
    assert scenario.ground.stiffness == pytest.approx(robot.mass * 9.81 / 0.002)
    assert scenario.gait.name == "walking"
    read = hp.Scenario.from_dict(json.loads(json.dumps(scenario.to_dict())))
    assert (read, hash(read)) == (scenario, hash(scenario))
    assert read != replace(scenario, robot=hp.load_robot(dog, feet=FEET))
    np.testing.assert_array_equal(read.robot.model.armature, robot.model.armature)
    run = hp.walk(scenario, save=tmp_path / "dog.npz")
    loaded = hp.Run.load(tmp_path / "dog.npz")
    again = hp.walk(hp.Scenario.of(loaded))
    np.testing.assert_array_equal(again["q"], run["q"])
    assert robot_of(loaded).model == robot.model


def test_known_robots_stay_names():
    for name in ("go2", "harpy", "iris"):
        robot = hp.load_harpy() if name == "harpy" else hp.load_robot(name)
        assert hp.Scenario(robot=robot).robot == name


def test_what_a_scenario_cannot_write_down(dog):
    robot = hp.load_robot(dog, feet=FEET)
    with pytest.raises(
        hp.InputError, match=r"'my-dog' is not what its file says.* with_joints, or give hp.walk a gait"
    ):
        hp.Scenario(robot=heavier(robot, 0.1))
    source = {"file": str(dog), "feet": list(FEET)}
    for bad, says in (
        ({"feets": ["a"]}, "unknown entry of the robot 'feets'"),
        ({"feet": ["nose"]}, "no foot frame 'nose'"),
        ({"feet": 3}, "feet must be a tuple of names"),
        ({"file": None}, "urdf must be a path"),
        ({"posture": [1.0]}, "posture must have shape"),
        ({"posture": "low"}, "posture must be an array of numbers"),
        ({"model": {"armature": [1.0]}}, "armature of the robot must have shape"),
        ({"model": {"inertias": []}}, "unknown array of the robot's model 'inertias'"),
        ({"flat_feet": {"FL_foot": 3}}, "this describes no robot"),
        ({"rotors": [{"frame": "base"}]}, "this describes no robot"),
    ):
        with pytest.raises(hp.HarpyError, match=says):
            hp.Scenario(robot={**source, **bad})
    with pytest.raises(hp.InputError, match=r"needs feet: .* at the ends of its limbs: .*RR_foot"):
        hp.Scenario(robot={"file": str(dog)})
    with pytest.raises(hp.InputError, match=r"a file comes with its feet: .*--robot FILE --feet"):
        hp.Scenario(robot=str(dog))


def test_flat_feet_rotors_and_an_infinite_limit_are_written_down():
    flyer = hp.load_robot(
        CATALOGUE["iris"].path(), feet=(), rotors=[hp.Rotor(f"iris__rotor_{k}", drag=0.02) for k in range(4)]
    )
    assert hp.Scenario(robot=flyer).gait.name == "hovering"
    sole = hp.FlatFoot(length=0.2, width=0.12)
    feet = ("left_sole_link", "right_sole_link")
    biped = hp.load_robot(CATALOGUE["talos"].path(), feet=feet, flat_feet=dict.fromkeys(feet, sole))
    for robot in (flyer, biped):
        read = read_robot(json.loads(json.dumps(hp.Scenario(robot=robot).to_dict()))["robot"])
        assert (read.feet, read.flat_feet, read.rotors) == (robot.feet, robot.flat_feet, robot.rotors)
        assert read.model == robot.model


def test_legs_of_two_joints_stand():
    robot = hp.load_robot(CATALOGUE["solo8"].path(), feet=CATALOGUE["solo8"].feet)
    assert hp.Scenario(robot=robot).gait.name == "standing"
    with pytest.raises(hp.InputError, match="has a leg of fewer than three joints"):
        hp.Scenario(robot=robot, gait="walking")


def test_the_ground_fits_where_only_friction_is_given():
    """Also of a gait of one's own; a stiffness that is given stays."""
    robot, friction = hp.load_robot("go2"), hp.Ground(mu_s=0.4)
    fitting = robot.mass * 9.81 / 0.002
    assert hp.Scenario(robot="go2", ground=friction).ground == hp.Ground(mu_s=0.4, stiffness=fitting)
    assert hp.Scenario(robot="go2", ground=hp.Ground(stiffness=8e3)).ground.stiffness == 8e3
    assert hp.Scenario(ground=friction).ground == friction
    built = hp.build(hp.Scenario(ground=friction), gait=hp.WalkingGait(robot))
    assert built.simulator.ground.stiffness == built.scenario.ground.stiffness == pytest.approx(fitting)
    damped = hp.Scenario(robot="go2", ground=hp.Ground(damping=3.0)).ground
    assert (damped.damping, damped.stiffness) == (3.0, pytest.approx(fitting))
    harpy = hp.load_harpy()
    assert hp.build(hp.Scenario(), gait=hp.make_gait(harpy)).simulator.ground == hp.Ground()


def test_commands_take_a_file(dog, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    robot = ("--robot", "dog.urdf", "--feet", ",".join(FEET))
    code, out, err = command("walk", *robot, "--duration", 0.2, "--speed", 0.2, "--save", "dog.npz")
    assert (code, err) == (0, "")
    assert "my-dog, condensed, walking gait" in " ".join(out.split())
    assert hp.Run.load("dog.npz").metadata["ground"]["mu_s"] == hp.Scenario().ground.mu_s
    monkeypatch.chdir("/")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert command("view", tmp_path / "dog.npz", "--html", tmp_path / "dog.html")[0] == 0
    assert (tmp_path / "dog.html").stat().st_size > 1_000_000  # with its meshes
    monkeypatch.chdir(tmp_path)
    dog.rename("moved.urdf")
    assert "dog.urdf" in command("view", "dog.npz", "--html", "dog.html")[2]
    assert command("view", "dog.npz", "--robot", "moved.urdf", "--html", "dog.html")[0] == 0
    assert command("export", "moved.urdf", "--feet", ",".join(FEET), "--to", "c")[0] == 0
    assert (tmp_path / "c" / "my_dog_condensed.c").is_file()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--robot", "dog.urdf"), "needs feet"),
        (("--robot", "dog.urdf", "--feet", "FL_foot,nose"), "no foot frame 'nose'"),
        (("--robot", "no.urdf", "--feet", "a"), "no URDF at 'no.urdf'"),
        (("--feet", "FL_foot"), "--feet and --posture are of a robot that --robot names"),
        (("--robot", "go2", "--posture", "0,up,0"), "--posture takes angles in rad"),
        (("--robot", "go2", "--posture", "0,0.8,-5"), "beyond its limits"),
        (("--robot", "go2", "--posture", "0,0,0,0,0"), "posture must have shape"),
    ],
)
def test_options_that_are_no_robot(options, says, dog, monkeypatch, command):
    monkeypatch.chdir(dog.parent)
    code, _, err = command("walk", *options)
    assert (code, err.count("\n")) == (2, 1)
    assert says in err


def test_angles_of_one_leg_are_those_of_all(dog, monkeypatch, command):
    monkeypatch.chdir(dog.parent)
    code, _, err = command("walk", "--robot", "go2", "--posture", "0,0.7,-1.4", "--duration", 0.01, "--save", "a.npz")
    assert (code, err) == (0, "")
    np.testing.assert_allclose(hp.Run.load("a.npz")["q"][0, 7:], [0.0, 0.7, -1.4] * 4, atol=1e-12)


def test_an_environment_of_it(dog):
    gymnasium = pytest.importorskip("gymnasium")
    robot, name = hp.load_robot(dog, feet=FEET), "harpy_pin.contrib.gym:Robot-v0"
    for options in (
        {"robot": robot},
        {"scenario": hp.Scenario(robot=robot)},
        {"robot": robot, "scenario": hp.Scenario()},
    ):
        env = gymnasium.make(name, velocity=(0.3, 0.0, 0.0), **options).unwrapped
        env.reset(seed=0)
        assert env.robot.name == "my-dog"
        assert env.simulator.ground.stiffness == pytest.approx(robot.mass * 9.81 / 0.002)
        assert not env.step(np.zeros(3, np.float32))[2]
    with pytest.raises(hp.InputError, match="the scenario is of 'solo12', and the environment of 'my-dog'"):
        gymnasium.make(name, robot=robot, scenario=hp.Scenario(robot="solo12"))
