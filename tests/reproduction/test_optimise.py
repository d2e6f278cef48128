"""The planar model, the planar walk and its curves."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import generalised_force
from planar_targets import targets
from scipy.interpolate import BPoly

import harpy_pin as hp
from harpy_pin.errors import RobotError
from harpy_pin.gaits.straight import GaitParameters
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.record import field
from harpy_pin.simulation.step import step_record
from reproduction.gait.planar_gait import (
    PACKAGED_GAIT,
    PAPER_CURVES_GAIT,
    SPACE_GAIT,
    PlanarGait,
    load_gait,
)
from reproduction.gait.planar_model import PlanarModel
from reproduction.gait.planar_walk import (
    PlanarJoints,
    PlanarWalk,
    joint_targets,
    planar_control,
    planar_step,
    walk_record,
)


def in_space(q, v):
    """Configuration and velocity of the free-flying robot for a planar state, and the map S with v3
    = S v, Ṡ v.
    """
    c, s = np.cos(q[2]), np.sin(q[2])
    q3 = np.zeros(13)
    q3[0], q3[2] = q[0], q[1]
    q3[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0, q[2], 0)).coeffs()
    q3[[8, 9, 11, 12]] = q[3:]
    rows = np.zeros((12, 7))
    rows[0, :2], rows[2, :2], rows[4, 2] = (
        (c, -s),
        (s, c),
        1.0,
    )  # body axes: Rᵀ of the world's velocity
    rows[[7, 8, 10, 11], [3, 4, 5, 6]] = 1.0
    drift = np.zeros(12)
    drift[:3] = -np.cross([0, v[2], 0], (rows @ v)[:3])
    return q3, rows @ v, rows, drift


@pytest.mark.parametrize("seed", range(10))
def test_planar_model_is_the_robot_held_in_the_plane(robot, model, seed):
    """Mass matrix, bias, feet and accelerations of the 3D model projected onto the plane."""
    rng = np.random.default_rng(seed)
    q, v = np.concatenate((rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 4))), rng.uniform(-3, 3, 7)
    q3, v3, rows, drift = in_space(q, v)
    space = Dynamics(robot)
    space.update(q3, v3)
    terms = model.terms(q, v)
    mass = rows.T @ space.mass_matrix @ rows
    bias = rows.T @ (space.mass_matrix @ drift + space.bias)
    np.testing.assert_allclose(terms["mass_matrix"], mass, atol=1e-12)
    np.testing.assert_allclose(terms["bias"], bias, atol=1e-10)
    np.testing.assert_allclose(terms["foot_position"], space.foot_position * [1, 0, 1], atol=1e-12)
    np.testing.assert_allclose(terms["foot_jacobian"], space.foot_jacobian @ rows, atol=1e-12)
    torque, force, thrust = rng.uniform(-9, 9, 4), rng.uniform(-40, 40, 4), rng.uniform(-20, 20, 2)
    feet, mounts = np.zeros((2, 3)), np.zeros((2, 3))
    feet[:, [0, 2]] = force.reshape(2, 2)
    mounts[:, [0, 2]] = 0.5 * thrust
    planar = np.concatenate((np.zeros(3), torque)) - terms["bias"]
    planar += terms["foot_jacobian"].T @ feet.ravel() + terms["thruster_jacobian"].T @ mounts.sum(
        axis=0
    )
    joints = np.zeros(6)
    joints[[1, 2, 4, 5]] = torque
    full = rows.T @ (
        generalised_force(space, joints, feet, mounts) - space.bias - space.mass_matrix @ drift
    )
    np.testing.assert_allclose(
        np.linalg.solve(terms["mass_matrix"], planar),
        np.linalg.solve(mass, full),
        rtol=1e-9,
        atol=1e-9,
    )


def test_planar_step_obeys_newton(model):
    """M (v⁺ − v) / Δt = S τ + Jᵀ f + J_tᵀ u − n − D v⁺, and it moves by Δt v⁺; its contact is the
    simulator's.
    """
    rng, dt, ground = np.random.default_rng(5), 5e-4, hp.Ground(mu_s=0.4)
    q, v = np.array([0, 0.65, 0.1, -0.5, 0.9, -0.3, 0.6]), rng.uniform(-1, 1, 7)
    record, step, touched = model.record.copy(), step_record({"nv": 7, "feet": 2}, dt=dt), 0
    for _ in range(600):
        torque, thrust = rng.uniform(-1, 1, 4) - 5 * v[3:], rng.uniform(-10, 10, 3) * [1, 0, 1]
        terms, place, before = (
            {name: np.copy(term) for name, term in model.terms(q, v).items()},
            q.copy(),
            v.copy(),
        )
        planar_step(q, v, torque, thrust, record, ground.record, step)
        force = field(step, "force")
        drive = (
            np.concatenate((np.zeros(3), torque)) - terms["bias"] - model.planar.model.damping * v
        )
        drive += terms["foot_jacobian"].T @ force + terms["thruster_jacobian"].T @ thrust
        np.testing.assert_allclose(terms["mass_matrix"] @ (v - before) / dt, drive, atol=1e-8)
        np.testing.assert_allclose(q - place, dt * v, atol=1e-15)
        touched += force[2] + force[5] > 0
    assert touched > 40


def test_walk_is_control_and_step_in_turn(model, packaged, ground):
    """The compiled loop logs the same motion."""
    walk = PlanarWalk(model, packaged.gait, ground=ground)
    (q, v), control = (
        map(np.copy, walk.initial_state()),
        walk_record(packaged.gait, PlanarJoints(), period=1e-3),
    )
    record, step, torque = (
        model.record.copy(),
        step_record({"nv": 7, "feet": 2}, dt=5e-4),
        field(control, "torque"),
    )
    rows = []
    for tick in range(1200):
        planar_control(1e-3 * tick, q, v, control[0], record[0])
        rows.append(np.concatenate((q, torque)))
        for _ in range(2):
            planar_step(q, v, torque, np.zeros(3), record, walk.ground.record, step)
    walk.run(1.2, log=True)
    np.testing.assert_allclose(walk.log[:, 1:8], np.array(rows)[:, :7], atol=1e-8)
    np.testing.assert_allclose(walk.log[:, 21:25], np.array(rows)[:, 7:], atol=1e-4)


def test_a_robot_that_is_no_planar_biped(robot):
    with pytest.raises(RobotError, match="biped"):
        PlanarModel.from_robot(dataclasses.replace(robot, feet=("left_foot",)))


def joints_at(t, gait, model):
    """Targets and rates of the joints."""
    walk = walk_record(gait, PlanarJoints(), period=1e-3)
    joint_targets(t, walk[0], model.record[0])
    return field(walk, "target"), field(walk, "rate")


ENDS = PlanarGait(
    lift_x=0.02,
    lift_z=0.01,
    land_x=-0.03,
    land_z=0.02,
    load_x=-0.05,
    load_z=0.01,
    push_x=0.04,
    push_z=-0.01,
    offset=0.02,
)


def test_curves_have_the_ends_and_slopes_that_the_numbers_say():
    g = ENDS
    stance, swing = g.curves
    front, back = (g.offset + g.half_step, -g.end_height), (g.offset - g.half_step, -g.end_height)
    np.testing.assert_allclose(
        [stance[0], stance[4], swing[0], swing[4]], [front, back, back, front]
    )
    slopes = [
        stance[1] - stance[0],
        stance[4] - stance[3],
        swing[1] - swing[0],
        swing[4] - swing[3],
    ]
    given = [(g.load_x, g.load_z), (g.push_x, g.push_z), (g.lift_x, g.lift_z), (g.land_x, g.land_z)]
    np.testing.assert_allclose(slopes, given, atol=1e-15)


@pytest.mark.parametrize("double", [0.0, 0.4])
def test_targets_are_bernstein_polynomials(double):
    """The left foot is in stance from the first moment, the right one swings from the end of the
    double support.
    """
    gait = dataclasses.replace(ENDS, double_support=double)
    spans = (
        [0.0, (1.0 + double) * gait.step_duration],
        [double * gait.step_duration, gait.step_duration],
    )
    for k, span in enumerate(spans):
        polynomial = BPoly(gait.curves[k][:, None, :], span)
        for t in np.linspace(span[0] + 0.01, gait.step_duration - 0.01, 7):
            position, velocity, stance = targets(gait, t)
            assert stance[k, 0] == 1 - k
            np.testing.assert_allclose(position[k], polynomial(t), atol=1e-14)
            np.testing.assert_allclose(velocity[k], polynomial.derivative()(t), atol=1e-12)


@pytest.mark.parametrize("double", [0.0, 0.3])
def test_hand_made_walk_in_the_plane(robot, double):
    parameters = GaitParameters(double_support=double)
    gait, planar = hp.gaits.StraightGait(robot, parameters), PlanarGait.from_walk(parameters)
    for t in np.linspace(0.0, 2.9, 40):
        target = gait.update(t)
        position, velocity, stance = targets(planar, t)
        np.testing.assert_allclose(position, target.foot_position[:, [0, 2]], atol=1e-12)
        np.testing.assert_allclose(velocity, target.foot_velocity[:, [0, 2]], atol=1e-11)
        np.testing.assert_array_equal(stance[:, 0], target.stance)


def test_joint_targets_put_the_feet_there(robot, model):
    gait, data, q = ENDS, robot.model.createData(), pin.neutral(robot.model)
    for t in np.linspace(0.02, 1.45, 20):
        found, rate = joints_at(t, gait, model)
        ahead, _ = joints_at(t + 1e-6, gait, model)
        position = targets(gait, t)[0]
        for k in range(2):
            q[7:10] = 0.0, *found[2 * k : 2 * k + 2]
            pin.framesForwardKinematics(robot.model, data, q)
            foot = data.oMf[robot.frame_id("left_foot")].translation
            np.testing.assert_allclose(foot[[0, 2]], position[k], atol=1e-12)
        np.testing.assert_allclose(rate, (ahead - found) / 1e-6, atol=1e-4)


@pytest.mark.parametrize(
    "path", [PACKAGED_GAIT, SPACE_GAIT, PAPER_CURVES_GAIT], ids=lambda path: path.stem
)
def test_packaged_gaits_walk_as_asked(model, path):
    """≥ 10 steps at 0.3 ± 0.03 m/s, height 0.6 ± 0.03 m, |pitch| ≤ 0.15 rad at any time, by the
    clock alone.
    """
    found = load_gait(path)
    gait = found.gait
    summary = PlanarWalk(model, gait, ground=hp.Ground(mu_s=found.record["friction"][0])).run(
        20 * gait.step_duration
    )
    assert not summary.fell
    assert summary.steps == pytest.approx(20)
    assert summary.speed == pytest.approx(0.3, abs=0.03)
    assert summary.height_min >= 0.57
    assert summary.height_max <= 0.63
    assert summary.pitch_max <= 0.15
    assert (
        summary.slip < 2.0 or path == SPACE_GAIT
    )  # that one is made for the ground forces of the walk in space


@pytest.mark.parametrize("mu", [0.25, 0.4, 0.8])
def test_packaged_gait_minds_no_friction(model, packaged, mu):
    summary = PlanarWalk(model, packaged.gait, ground=hp.Ground(mu_s=mu)).run(20.0)
    assert not summary.fell
    assert summary.speed == pytest.approx(0.3, abs=0.015)
    assert summary.pitch_max < 0.03
    assert summary.slip < 1.5


def test_the_papers_curves_have_the_papers_ends():
    points = load_gait(PAPER_CURVES_GAIT).gait.curves
    np.testing.assert_array_equal(points[:, 0], points[:, 1])
    np.testing.assert_array_equal(points[:, 3], points[:, 4])
    assert load_gait(PAPER_CURVES_GAIT).gait.double_support == 0.0


def test_a_walk_that_falls_says_so(model):
    summary = PlanarWalk(model, PlanarGait()).run(5.0)
    assert summary.fell
    assert summary.duration < 5.0
