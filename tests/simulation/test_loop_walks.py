"""Robots with closed loops in plants, under controllers, in C, estimated, and drawn."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pinocchio as pin
import pytest
from looped_robots import ROBOTS
from needs import needs_compiler
from same_optimum import same_optimum
from sprung_robot import sprung, sprung_text

import harpy_pin as hp
from comparison.studies.built import built_harpy
from harpy_pin.errors import InputError
from harpy_pin.export.code import controller_code
from harpy_pin.export.exported_controllers import exportable_walk
from harpy_pin.export.folder import write_folder
from harpy_pin.export.recording import answers, record
from harpy_pin.gaits.straight import GaitParameters, StraightGait
from harpy_pin.model.kinematics import LegGeometry, leg_inverse_kinematics, leg_jacobian
from harpy_pin.model.posed import Posed
from harpy_pin.simulation.mujoco import MujocoPlant
from harpy_pin.simulation.pinocchio_plant import PinocchioPlant
from harpy_pin.view.identity import robot_of
from harpy_pin.view.scene.frames import _placements
from harpy_pin.view.scene.robot_nodes import RobotNodes
from harpy_pin.wbc import WholeBodyLimits, WholeBodyWeights

NAMES = ("four_bar", "parallel_ankle", "harpy_built")


@cache
def looped(name):
    if name == "sprung":
        pytest.importorskip("mujoco")
        return sprung(Path(mkdtemp()))
    return hp.load_robot(name) if name == "harpy_built" else ROBOTS[name](Path(mkdtemp()))


def states(name, count):
    robot, rng = looped(name), np.random.default_rng(2)
    q, _ = hp.Standing(robot).initial_state()
    for _ in range(count):
        here = robot.integrate(q, 0.1 * rng.normal(size=robot.nv))
        here[7:] = np.clip(here[7:], robot.joint_lower + 0.1, robot.joint_upper - 0.1)
        yield here, rng.normal(size=robot.nv)


def accelerations(name, softness, *, speed=1.0):
    """Of random states those of MuJoCo at each softness R / A₀ of the ties, then ours; of the
    joints.
    """
    mujoco, robot = pytest.importorskip("mujoco"), looped(name)
    plant, dynamics = MujocoPlant(robot), hp.Dynamics(robot)
    rng, places = np.random.default_rng(3), plant._inside.joint_places
    for q, v in states(name, 125):
        q[2] += 5.0
        v *= speed
        plant.reset(q, v)
        torque, found = 3.0 * rng.normal(size=len(robot.joints)), []
        plant.data.qfrc_applied[places] = torque
        for soft in softness:
            plant.model.eq_solimp[:, :2] = 1.0 / (1.0 + soft)
            mujoco.mj_forward(plant.model, plant.data)
            found.append(plant.data.qacc[places])
        dynamics.update(q, v)
        force = np.append(np.zeros(6), torque) - dynamics.bias - dynamics.damping * v
        yield np.array(found), np.linalg.solve(dynamics.mass_matrix, force)[6:]


@pytest.mark.parametrize(
    ("name", "share"), [*((name, 1e-3) for name in (*NAMES, "coupled")), ("rubbing", 2e-3)]
)
def test_mujocos_accelerations_are_ours(name, share):
    """With equality constraints as stiff as MuJoCo takes them; losses make their forces larger."""
    for found, expected in accelerations(name, [1e-4]):
        size = np.abs(expected).max()
        np.testing.assert_allclose(found[0], expected, rtol=0, atol=share * size)


@pytest.mark.parametrize("name", [*NAMES, "coupled", "rubbing"])
def test_what_is_apart_of_them_is_mujocos_softness(name):
    """Extrapolated to rigid constraints the accelerations are ours; MuJoCo's tendons have no J̇ v,
    so that the robot with rods of a length is at rest.
    """
    speed = 0.0 if name == "parallel_ankle" else 1.0
    for found, expected in accelerations(name, [1e-4, 2e-4], speed=speed):
        size = np.abs(expected).max()
        np.testing.assert_allclose(2.0 * found[0] - found[1], expected, rtol=0, atol=1e-5 * size)


@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
@pytest.mark.parametrize("name", NAMES)
def test_they_walk(name, plant):
    """The condensed controller on its own, and joints where the loops have them."""
    if plant == "mujoco":
        pytest.importorskip("mujoco")
    gait = hp.WalkingGait(looped(name), velocity=(0.15, 0.0, 0.0))
    run = hp.walk(hp.Scenario(controller="condensed", plant=plant, duration=4.0), gait=gait)
    assert run.ending == "completed"
    assert run["q"][-1, 0] > 0.2
    assert robot_of(run).model == looped(name).model


@pytest.mark.parametrize("velocity", [-0.2, -0.4, 0.4])
@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
def test_feet_are_raised_as_far_as_knees_bend(plant, velocity):
    """A linkage whose motor comes to its end holds its foot down, or the robot falls."""
    if plant == "mujoco":
        pytest.importorskip("mujoco")
    robot = looped("four_bar")
    gait = hp.WalkingGait(robot, velocity=(velocity, 0.0, 0.0))
    given = hp.WalkingGait(robot, clearance=0.03)
    assert gait.describe()["clearance"] < 0.025 < given.describe()["clearance"]
    run = hp.walk(hp.Scenario(controller="condensed", plant=plant, duration=4.0), gait=gait)
    assert run.ending == "completed"
    assert run["q"][:, [9, 12]].max() < 0.92  # its end is at 0.9 rad
    assert run["q"][-1, 0] == pytest.approx(4.0 * velocity, rel=0.2)


def test_a_walk_in_mujoco_keeps_the_loops_closed():
    pytest.importorskip("mujoco")
    robot = looped("harpy_built")
    gait = hp.WalkingGait(robot, velocity=(0.2, 0.0, 0.0))
    motion = hp.build(hp.Scenario(controller="condensed", plant="mujoco", duration=1.0), gait=gait)
    run, plant = motion.run(), motion.simulator
    assert run.ending == "completed"
    ankles = [plant.data.joint(f"joint:{side}_ankle").qpos[0] for side in ("left", "right")]
    passive = [robot.model.joints[j].idx_q for j in robot.loops.passive]
    np.testing.assert_allclose(ankles, robot.closed(plant.q)[passive], rtol=0, atol=2e-3)


@pytest.mark.parametrize(
    ("name", "most"), [("four_bar", 80.0), ("parallel_ankle", 120.0), ("sprung", 120.0)]
)
def test_the_condensed_optimum_is_that_of_the_program(name, most):
    """Limbs that their feet determine, of three driven joints and of six; five with a line."""
    robot = looped(name)
    same_optimum(
        robot,
        list(states(name, 24)),
        WholeBodyWeights.for_robot(robot, posture=1e-10),
        WholeBodyLimits(mu=0.4, give_way=1.0),
        ("full",),
        spread=1.0,
        most=most,
    )


@needs_compiler
@pytest.mark.parametrize("name", ["harpy_built", "sprung"])
def test_the_c_of_a_walk_has_the_librarys_digits(tmp_path, name):
    """Of a point foot and a tilted fan, and of feet that are lines on legs with rods."""

    def made():
        gait = hp.WalkingGait(looped(name), velocity=(0.2, 0.0, 0.0))
        return hp.make_controller("condensed", gait, mu=0.5)

    scenario = hp.Scenario(ground=hp.Ground(mu_s=0.5), duration=0.5)
    one, fresh = made(), made()
    motion = hp.build(scenario, gait=one.gait, controller=lambda gait: one)
    what = exportable_walk(one)
    given = record(motion, what)
    run = hp.walk(scenario, gait=fresh.gait, controller=lambda gait: fresh)
    done = write_folder(what, given, tmp_path, name="built_walk", single=False, readme=False)
    ours = np.hstack([run[name].reshape(len(run), -1) for name in ("torque", "thrust")])
    np.testing.assert_array_equal(answers(what, done.code, given)[0][:, : ours.shape[1]], ours)


@needs_compiler
@pytest.mark.parametrize("name", NAMES)
def test_the_c_of_a_walk_in_single_precision_is_close(name):
    """Loops are closed to what floats have."""
    one = hp.make_controller(
        "condensed", hp.WalkingGait(looped(name), velocity=(0.2, 0, 0)), mu=0.5
    )
    scenario = hp.Scenario(ground=hp.Ground(mu_s=0.5), duration=0.5)
    what = exportable_walk(one)
    given = record(hp.build(scenario, gait=one.gait, controller=lambda gait: one), what)
    theirs, good = answers(what, controller_code(what, "x", single=False), given)
    ours, status = answers(what, controller_code(what, "x", single=True), given)
    gap = np.abs(ours - theirs).max(axis=1)
    np.testing.assert_array_equal(status, good)
    assert 0.0 < np.median(gap) < 3e-3
    assert gap.max() < 0.1


def test_a_controller_answers_a_dead_point_as_a_bad_sample():
    """The command is held, and goes on where the linkage is as before."""
    robot = looped("four_bar")
    gait = hp.WalkingGait(robot)
    controller = hp.make_controller("condensed", gait, mu=0.5)
    q, v = gait.initial_state()
    dynamics = hp.Dynamics(robot)
    dynamics.update(q, v)
    force = np.tile((0.0, 0.0, 0.5 * robot.mass * 9.81), (2, 1))
    sample = (dynamics.foot_position, dynamics.foot_velocity, force)
    before = controller.step(hp.State(0.0, q, v, *sample)).torque.copy()
    for n, knee in enumerate((1.6505, 2.5), start=1):  # near it, and beyond
        there = q.copy()
        there[9] = knee
        command = controller.step(hp.State(2e-3 * n, there, v, *sample))
        np.testing.assert_array_equal(command.torque, before)
        assert controller.bad_samples == n
    controller.step(hp.State(6e-3, q, v, *sample))
    assert controller.bad_samples == 2


def test_an_estimator_knows_the_loops():
    """A robot that stands on the estimate, by encoders of the driven joints and an inertial
    unit.
    """
    robot = looped("parallel_ankle")
    scenario = hp.Scenario(controller="condensed", state="estimated", duration=1.5)
    run = hp.walk(scenario, gait=hp.Standing(robot))
    assert run.ending == "completed"
    np.testing.assert_allclose(run["estimated_q"][-1], run["q"][-1], rtol=0, atol=0.02)


def test_bodies_are_drawn_where_the_loops_have_them():
    robot = looped("harpy_built")
    q = np.array([q for q, _ in states("harpy_built", 5)])
    joints, mounts = _placements(robot, q)
    data = robot.model.createData()
    for k, one in enumerate(q):
        pin.framesForwardKinematics(robot.model, data, robot.closed(one))
        expected = [place.homogeneous for place in data.oMi]
        np.testing.assert_allclose(joints[k], expected, rtol=0, atol=1e-12)
        mount = data.oMf[robot.frame_id("left_thruster")].translation
        np.testing.assert_allclose(mounts[k, 0], mount, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["harpy_built", "parallel_ankle"])
def test_rods_are_drawn_from_end_to_end(name):
    robot = looped(name)
    q = np.array([q for q, _ in states(name, 5)])
    drawn = RobotNodes(robot, 1.0)
    motions = drawn.motions(_placements(robot, q)[0])
    data = robot.model.createData()
    for number, tie in enumerate(robot.loops.ties):
        (node,) = [node for node in drawn.nodes if node.path == f"loop_rods/{number}/rod"]
        motion = motions[f"loop_rods/{number}"]
        for k, one in enumerate(q):
            pin.framesForwardKinematics(robot.model, data, robot.closed(one))
            turn = pin.Quaternion(motion.quaternion[k]).matrix()
            for frame, sign in ((tie.first, -0.5), (tie.second, 0.5)):
                end = motion.position[k] + sign * node.shape.length * turn[:, 2]
                expected = data.oMf[robot.frame_id(frame)].translation
                np.testing.assert_allclose(end, expected, rtol=0, atol=1e-8)


def test_a_skeleton_has_the_ends_of_loops():
    """Of a robot without visuals the bars of a linkage are closed."""
    robot = looped("four_bar")
    drawn, rod = RobotNodes(robot, 1.0), robot.model.frames[robot.frame_id("left_rod_end")]
    bars = [n for n in drawn.nodes if n.path.startswith("robot/left_rod_joint/rod_")]
    (bar,) = bars
    end = bar.placement[:3, 3] + 0.5 * bar.shape.length * bar.placement[:3, 2]
    np.testing.assert_allclose(end, rod.placement.translation, rtol=0, atol=1e-12)


def test_what_does_not_know_loops_says_so():
    robot = looped("harpy_built")
    with pytest.raises(InputError, match="closed loops, which Pinocchio's plant does not know"):
        PinocchioPlant(robot)
    dynamics = hp.Dynamics(robot)
    q, v = hp.Standing(robot).initial_state()
    dynamics.update(q, v)
    state = hp.State(0.0, q, v, *np.zeros((3, 2, 3)))
    with pytest.raises(InputError, match="has loops, which only the condensed"):
        hp.wbc.FrameTask("base").rows(dynamics, state)


@pytest.mark.parametrize("foot", ["left_foot", "right_foot"])
def test_a_parallelogram_is_a_leg_of_harpys_kind(foot):
    """Its inverse kinematics in closed form; the rod is off a parallelogram's by 0.04 mm."""
    robot, rng = built_harpy(), np.random.default_rng(0)
    geometry, own = LegGeometry.from_robot(robot, foot), 7 + 3 * robot.feet.index(foot)
    for _ in range(50):
        q = robot.reference
        q[7:] = rng.uniform(-0.6, 0.6, 6)
        place = Posed(robot, q).frame(foot).translation
        found = q.copy()
        found[own : own + 3] = leg_inverse_kinematics(geometry, place)
        np.testing.assert_allclose(found, q, rtol=0, atol=1e-3)
        near = Posed(robot, found).frame(foot).translation
        np.testing.assert_allclose(near, place, rtol=0, atol=1e-4)
        jacobian = np.zeros((3, 3))
        leg_jacobian(geometry.record[0], q[own : own + 3], jacobian)
        expected = Posed(robot, q).jacobian(foot)[:3, own - 1 : own + 2]
        np.testing.assert_allclose(jacobian, expected, rtol=0, atol=1e-3)


@pytest.mark.parametrize("plant", ["compliant", "mujoco"])
@pytest.mark.parametrize("controller", ["governed", "condensed"])
def test_the_papers_walk_on_harpy_as_built(controller, plant):
    if plant == "mujoco":
        pytest.importorskip("mujoco")
    parameters = GaitParameters(speed=0.2, height=0.5, width=0.13, penetration_offset=0.006)
    gait = StraightGait(built_harpy(), parameters)
    run = hp.walk(hp.Scenario(controller=controller, plant=plant, duration=3.0), gait=gait)
    assert run.ending == "completed"
    assert run["q"][-1, 0] == pytest.approx(0.6, abs=0.05)


def test_a_robot_whose_springs_are_held_walks_with_live_ones(tmp_path):
    """In MuJoCo's own model of its file, which the controller does not share: springs bend, and
    rods spin. Its feet are bars, whose ends the controller knows.
    """
    mujoco = pytest.importorskip("mujoco")
    robot, model = sprung(tmp_path), mujoco.MjModel.from_xml_string(sprung_text())
    data, bridge = mujoco.MjData(model), hp.MujocoBridge(model, robot)
    gait = hp.WalkingGait(robot, velocity=(0.25, 0.0, 0.0))
    controller = hp.make_controller("condensed", gait, mu=0.6, contact_damping=50.0)
    bridge.place(gait.initial_state(), data)
    mujoco.mj_forward(model, data)
    bent = 0.0
    while data.time < 2.5:
        bridge.write(controller.step(bridge.read(data)), data)
        mujoco.mj_step(model, data)
        bent = max(bent, abs(data.joint("left_spring").qpos[0]))
    assert bent > 0.03
    assert data.qpos[2] > 0.8
    assert data.qpos[0] == pytest.approx(0.25 * 2.5, abs=0.15)
    assert abs(data.qpos[1]) < 0.1
