"""Loops at load: what is closed, what follows, and one sentence for what cannot be."""

from __future__ import annotations

import warnings

import numpy as np
import pinocchio as pin
import pytest
from looped_robots import ROBOTS, frame, joint, link, written

import harpy_pin as hp
from harpy_pin.errors import InputError, RobotError
from harpy_pin.model import solve_ik
from harpy_pin.model.legs import legs
from harpy_pin.model.source import plain_source, read_robot

HEAD = '<mujoco><compiler angle="radian"/>{}<worldbody><body name="base" pos="0 0 1"><freejoint/>'
AIR = '<default><geom contype="0" conaffinity="0"/></default>'
GEOM = '<geom type="box" size="0.05 0.05 0.1" mass="1"/>'
KNEE = f"""
<body name="thigh">{GEOM}<joint name="hip" axis="0 1 0"/>
 <body name="crank" pos="0 0 -0.05"><geom type="sphere" size="0.02" pos="-0.03 0 0" mass="0.1"/>
  <joint name="knee" axis="0 1 0"/>
  <body name="rod" pos="-0.05 0 -0.02"><geom type="sphere" size="0.02" pos="0 0 -0.1" mass="0.1"/>
   <joint name="rod_joint" axis="0 1 0"/></body></body>
 <body name="shank" pos="0 0 -0.28"><geom type="sphere" size="0.02" pos="0 0 -0.28" mass="0.3"/>
  <joint name="hinge" axis="0 1 0"/>
  <body name="end" pos="0 0 -0.2">{GEOM}<joint name="toe" axis="1 0 0"/>
   <site name="foot" pos="0 0 -0.1"/></body></body></body>
"""
TAIL = (
    '</body></worldbody><actuator><motor joint="hip" ctrlrange="-20 20"/>'
    '<motor joint="knee" ctrlrange="-20 20"/>{}</actuator>'
)
CONNECT = '<connect body1="rod" body2="shank" anchor="0 0 -0.23"/>'
COUPLED = '<joint joint1="toe" joint2="knee" polycoef="0.1 0.5 0 0 0"/>'


def mjcf(tmp_path, equality, actuators=""):
    path = tmp_path / "leg.xml"
    body = f"{HEAD.format(AIR)}{GEOM}{KNEE}{TAIL.format(actuators)}"
    text = f"{body}<equality>{equality}</equality></mujoco>"
    path.write_text(text)
    return path


def test_an_mjcf_file_has_its_loops_and_couplings(tmp_path):
    """Actuators say which joints are driven; the rest follows as MuJoCo has it."""
    mujoco = pytest.importorskip("mujoco")
    path = mjcf(tmp_path, CONNECT + COUPLED)
    robot = hp.load_robot(path, feet=("foot",))
    assert robot.joints == ("hip", "knee")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q = robot.neutral
        q[7:] = rng.uniform(-0.5, 0.5, 2)
        tree = robot.closed(q)
        data.qpos[:3], data.qpos[3:7] = tree[:3], (1.0, 0.0, 0.0, 0.0)
        data.qpos[7:] = tree[7:]
        mujoco.mj_forward(model, data)
        assert data.nefc == 4
        np.testing.assert_allclose(data.efc_pos, 0.0, rtol=0, atol=1e-8)


def test_a_robot_in_mujoco_is_read_and_written_through_the_bridge(tmp_path):
    """Passive joints are assembled when it is placed, and not measured."""
    mujoco = pytest.importorskip("mujoco")
    path = mjcf(tmp_path, CONNECT + COUPLED)
    robot = hp.load_robot(path, feet=("foot",))
    model = mujoco.MjModel.from_xml_path(str(path))
    data, bridge = mujoco.MjData(model), hp.MujocoBridge(model, robot)
    q, v = robot.neutral, np.zeros(robot.nv)
    q[7:], v[6:] = (0.2, 0.4), (1.0, -2.0)
    bridge.place((q, v), data)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.efc_pos, 0.0, rtol=0, atol=1e-8)
    np.testing.assert_allclose(data.efc_vel, 0.0, rtol=0, atol=1e-8)
    state = bridge.read(data)
    np.testing.assert_allclose(state.q, q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(state.v, v, rtol=0, atol=1e-12)
    site = data.site("foot").xpos
    np.testing.assert_allclose(state.foot_position[0], site, rtol=0, atol=1e-8)
    bridge.write(hp.Command(np.array((1.0, 2.0)), np.zeros((0, 3))), data)
    np.testing.assert_allclose(data.ctrl, (1.0, 2.0))
    assert "actuator" not in bridge.differences


def test_the_bridge_refuses_a_model_with_other_loops(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    robot = hp.load_robot(mjcf(tmp_path, CONNECT + COUPLED), feet=("foot",))
    for equality in ("", CONNECT, CONNECT.replace("-0.23", "-0.2") + COUPLED):
        model = mujoco.MjModel.from_xml_path(str(mjcf(tmp_path, equality)))
        with pytest.raises(InputError, match="other closed loops"):
            hp.MujocoBridge(model, robot)


@pytest.mark.parametrize(
    ("equality", "actuators", "message"),
    [
        (CONNECT, "", "no actuator of joint 'toe'"),
        ('<connect body1="rod" anchor="0 0 0"/>', "", "<connect>.*holds the robot"),
        ('<weld body1="rod" body2="shank"/>', "", "<weld>.*holds the robot"),
        ('<joint joint1="toe"/>', "", "<joint>.*holds the robot"),
        (
            '<joint joint1="toe" joint2="knee" polycoef="0 1 1 0 0"/>',
            "",
            "<joint>.*linear, of two joints",
        ),
        ('<joint joint1="hip" joint2="knee"/>', "", "both have a motor"),
        (
            CONNECT + COUPLED,
            '<motor joint="hinge"/><motor joint="rod_joint"/>',
            "move no joint|contradict",
        ),
    ],
)
def test_other_constraints_are_refused_in_a_sentence(tmp_path, equality, actuators, message):
    pytest.importorskip("mujoco")
    path = mjcf(tmp_path, equality, actuators)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises((RobotError, InputError, UserWarning), match=message) as caught:
            hp.load_robot(path, feet=("foot",))
    assert "\n" not in str(caught.value)


def linkage(*more, far=0.0, effort=0.0):
    """A four-bar linkage on a base."""
    return [
        link("base", 2.0),
        link("one", 0.2),
        joint("a", "base", "one", (0.1, 0.0, 0.0)),
        link("two", 0.2),
        joint("b", "one", "two", (0.0, 0.0, -0.2), effort=effort),
        link("three", 0.2),
        joint("c", "base", "three", (-0.1, 0.0, 0.0), effort=0.0),
        frame("p", "two", (-0.2, far, 0.0)),
        frame("r", "three", (0.0, 0.0, -0.2)),
        frame("s", "three", (0.05, 0.0, -0.2)),
        frame("t", "one", (0.0, 0.0, -0.1)),
        frame("u", "base", (0.0, 0.3, 0.0)),
        *more,
    ]


@pytest.mark.parametrize(
    ("parts", "loops", "error", "message"),
    [
        (linkage(far=0.1), [("p", "r", "point")], RobotError, "does not close.*0.1 m"),
        (
            linkage(),
            [("p", "r", "point"), ("p", "s", "point")],
            RobotError,
            "does not close where the robot stands, with all its other loops",
        ),
        (
            linkage(),
            [("p", "r", "point"), ("r", "u", "length")],
            RobotError,
            "leave its motor at 'a' no motion: they contradict",
        ),
        (linkage(), [("p", "universe", "point")], InputError, "to the world: its base must float"),
        (linkage(), [("r", "s", "point")], InputError, "no joint: both are on one link"),
        (linkage(), [("t", "u", "point")], RobotError, "move no joint"),
        (linkage(), [("p", "x", "point")], InputError, "frame of a loop"),
        (linkage(), [("p", "r", "weld")], InputError, "kind of loop"),
        (linkage(), [("p", "r")], InputError, "must be .frame, frame, kind."),
        (linkage(), [7], InputError, "must be .frame, frame, kind."),
        (linkage(), "pr", InputError, "tuple"),
        (linkage(), [("p", "r", "length")], InputError, "has no length"),
        (linkage(effort=1.0), [("p", "r", "point")], RobotError, "too many motors"),
    ],
)
def test_hostile_loops_are_refused_in_a_sentence(tmp_path, parts, loops, error, message):
    path = written(tmp_path, "linkage", parts)
    with pytest.raises(error, match=message) as caught:
        hp.load_robot(path, feet=(), loops=loops)
    assert "\n" not in str(caught.value)


def test_passive_joints_are_what_the_loops_move(tmp_path):
    robot = hp.load_robot(
        written(tmp_path, "linkage", linkage()), feet=(), loops=[("p", "r", "point")]
    )
    assert robot.joints == ("a",)
    assert (robot.nq, robot.nv, len(robot.torque_limit), len(robot.damping)) == (8, 7, 1, 1)
    q = robot.neutral
    for angle in np.linspace(-1.2, 1.2, 25):  # a parallelogram: the other assembly is a crossed one
        q[7] = angle
        np.testing.assert_allclose(robot.closed(q)[7:], (angle, -angle, angle), atol=1e-9)
        np.testing.assert_allclose(robot.velocity_map(q)[6:, 6], (1.0, -1.0, 1.0), atol=1e-8)
    again = read_robot(plain_source(robot.source))
    assert again.joints == robot.joints
    assert again.model == robot.model


@pytest.mark.parametrize(("off", "good"), [(0.05, True), (0.02, False), (0.0, False)])
def test_a_dead_point_is_no_good_state(tmp_path, off, good):
    """Where coupler and follower of a parallelogram are in line; ``off`` is the angle between."""
    robot = hp.load_robot(
        written(tmp_path, "linkage", linkage()), feet=(), loops=[("p", "r", "point")]
    )
    q, dynamics = robot.neutral, hp.Dynamics(robot)
    for angle in (*np.linspace(0.0, 1.5, 16), np.pi / 2.0 - off):
        q[7] = angle
        dynamics.update(q, np.zeros(7))
    assert dynamics.finite == good
    if not good:
        with pytest.raises(InputError, match="'linkage' are at a dead point"):
            robot.closed(q)
    q[7] = 0.3
    dynamics.update(q, np.zeros(7))
    assert dynamics.finite


def test_the_branch_is_kept_wherever_it_was(tmp_path):
    """A state far from the last one is reached along the straight way from the start; where loops
    cannot be closed the terms say so, and are right again afterwards.
    """
    robot = ROBOTS["four_bar"](tmp_path)
    dynamics, rng = hp.Dynamics(robot), np.random.default_rng(0)
    fresh = hp.Dynamics(robot)
    for _ in range(50):
        q = robot.reference
        q[7:] += rng.uniform(-0.6, 0.6, 6)
        if rng.random() < 0.3:
            q[9] = 2.5  # beyond the dead point
        dynamics.update(q, np.zeros(robot.nv))
        try:
            robot.closed(q)
        except InputError:
            assert not dynamics.finite
            continue
        fresh = hp.Dynamics(robot)
        fresh.update(q, np.zeros(robot.nv))
        assert dynamics.finite
        np.testing.assert_allclose(dynamics.foot_position, fresh.foot_position, atol=1e-8)


def test_a_joint_that_mimics_follows(tmp_path):
    robot = ROBOTS["coupled"](tmp_path)
    assert len(robot.joints) == 6
    q = robot.neutral
    q[7:] = np.random.default_rng(0).uniform(-0.5, 0.5, 6)
    tree = dict(zip(list(robot.model.names)[2:], robot.closed(q)[7:], strict=True))
    for side in ("left", "right"):
        expected = 0.1 - 0.8 * tree[f"{side}_knee"]
        assert tree[f"{side}_tarsus_joint"] == pytest.approx(expected, abs=1e-12)


def test_legs_have_their_driven_joints_and_the_way_to_the_foot(tmp_path):
    leg = legs(ROBOTS["parallel_ankle"](tmp_path))[0]
    assert leg.columns == (6, 7, 8, 9, 10, 11)
    assert leg.knee == 3
    robot = hp.load_robot("harpy_built")
    left = legs(robot)[0]
    names = [robot.model.names[j].removeprefix("left_") for j in left.way]
    assert names == ["hip_pitch", "knee", "ankle"]
    assert left.columns == (6, 7, 8)


def test_harpy_as_built_has_its_published_numbers():
    """Masses, height, and the parallelogram: the tarsus stays parallel to the femur."""
    robot = hp.load_robot("harpy_built")
    assert robot.mass == pytest.approx(4.90)
    q, _ = hp.Standing(robot).initial_state()
    assert q[2] == pytest.approx(0.514, abs=1e-3)
    model, data = robot.model, robot.model.createData()
    femur, tarsus = (model.getFrameId(f"left_{name}") for name in ("femur", "tarsus"))
    for knee in (-0.8, -0.3, 0.5, 1.2):
        q[9] = knee
        pin.framesForwardKinematics(model, data, robot.closed(q))
        between = data.oMf[femur].rotation.T @ data.oMf[tarsus].rotation
        assert np.linalg.norm(pin.log3(between)) < 2e-3
        rod = (data.oMf[model.getFrameId(f"left_{name}_rod")] for name in ("femur", "tarsus"))
        ends = [end.translation for end in rod]
        assert np.linalg.norm(ends[0] - ends[1]) == pytest.approx(0.32, abs=1e-4)


def test_inverse_kinematics_goes_through_loops(tmp_path):
    robot = ROBOTS["four_bar"](tmp_path)
    q, _ = hp.Standing(robot).initial_state()
    target = np.array((0.06, 0.1, 0.01))
    found = solve_ik(robot, {"left_foot": target}, q)
    assert found.converged
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.closed(found.q))
    place = data.oMf[robot.frame_id("left_foot")].translation
    np.testing.assert_allclose(place, target, rtol=0, atol=1e-9)
    far = solve_ik(robot, {"left_foot": target + 5.0}, q)
    assert not far.converged


def test_a_configuration_of_another_size_is_refused():
    robot = hp.load_robot("harpy_built")
    for bad in (robot.reference[:-1], np.zeros(5), "q"):
        for ask in (robot.closed, robot.velocity_map):
            with pytest.raises(InputError, match="q must"):
                ask(bad)
