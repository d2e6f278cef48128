"""Closed loops: terms against Pinocchio's constrained dynamics, energy, MuJoCo, hostile loops."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pinocchio as pin
import pytest
from looped_robots import ROBOTS
from sprung_robot import sprung

import harpy_pin as hp
from harpy_pin.kernels import kernel
from harpy_pin.model.loops import Coupling
from harpy_pin.model.posed import Posed
from harpy_pin.model.terms import inverse_dynamics

WORLD_AXES = pin.LOCAL_WORLD_ALIGNED
STATES = 125  # of each robot
NAMES = (*ROBOTS, "harpy_built", "sprung")


@cache
def looped(name: str) -> hp.Robot:
    if name == "harpy_built":
        return hp.load_robot(name)
    if name == "sprung":
        pytest.importorskip("mujoco")
        return sprung(Path(mkdtemp()))
    return ROBOTS[name](Path(mkdtemp()))


def states(name: str, count: int):
    """Random states near the angles at which the loops were found."""
    robot, rng = looped(name), np.random.default_rng(5)
    spread = 0.15 if name == "across" else 0.3
    for _ in range(count):
        q = np.concatenate((rng.normal(size=7), robot.reference[7:]))
        q[3:7] /= np.linalg.norm(q[3:7])
        q[7:] += rng.uniform(-spread, spread, robot.nq - 7)
        yield q, 2.0 * rng.normal(size=robot.nv)


def constraint(robot: hp.Robot, tree, speed):
    """Jacobian and drift of the ties, of Pinocchio's frames."""
    model, data, rows, drifts = robot.model, robot.model.createData(), [], []
    pin.forwardKinematics(model, data, tree, speed, np.zeros(model.nv))
    pin.computeJointJacobians(model, data, tree)
    pin.updateFramePlacements(model, data)
    for tie in robot.loops.ties:
        if isinstance(tie, Coupling):
            row = np.zeros(model.nv)
            row[model.joints[model.getJointId(tie.joint)].idx_v] = 1.0
            row[model.joints[model.getJointId(tie.leader)].idx_v] = -tie.ratio
            rows, drifts = [*rows, row], [*drifts, 0.0]
            continue
        ends = [model.getFrameId(name) for name in (tie.first, tie.second)]
        one, two = (pin.getFrameJacobian(model, data, k, WORLD_AXES)[:3] for k in ends)
        a, b = (pin.getFrameClassicalAcceleration(model, data, k, WORLD_AXES).linear for k in ends)
        apart = data.oMf[ends[0]].translation - data.oMf[ends[1]].translation
        if tie.kind == "length":
            moving = (one - two) @ speed
            rows.append(apart @ (one - two))
            drifts.append(apart @ (a - b) + moving @ moving)
        else:
            rows += list(one - two)
            drifts += list(a - b)
    return np.array(rows), np.array(drifts)


def constrained(robot: hp.Robot, tree, speed, force):
    """Acceleration of the tree under its ties, from the equations of motion with multipliers."""
    model, data = robot.model, robot.model.createData()
    jacobian, drift = constraint(robot, tree, speed)
    upper = pin.crba(model, data, tree)
    mass = np.triu(upper) + np.triu(upper, 1).T
    free = np.linalg.solve(mass, force - pin.nonLinearEffects(model, data, tree, speed))
    mobility = jacobian @ np.linalg.solve(mass, jacobian.T)
    # Loops of a plane have more rows than they need.
    multiplier = np.linalg.pinv(mobility, rcond=1e-10) @ (jacobian @ free + drift)
    return free - np.linalg.solve(mass, jacobian.T @ multiplier)


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_are_those_of_constrained_dynamics(name):
    """Also from one state to another one far away, and with damping of joints without a motor."""
    robot, rng = looped(name), np.random.default_rng(6)
    dynamics, own = hp.Dynamics(robot), [*range(6), *robot.columns]
    for q, v in states(name, STATES):
        dynamics.update(q, v)
        assert dynamics.finite
        tree, spread = robot.closed(q), robot.velocity_map(q)
        speed = spread @ v
        jacobian, _ = constraint(robot, tree, speed)
        np.testing.assert_allclose(jacobian @ spread, 0.0, rtol=0, atol=1e-9)
        torque, force = rng.normal(size=robot.nv), -robot.model.damping * speed
        force[own] = torque
        expected = constrained(robot, tree, speed, force)[own]
        found = np.linalg.solve(dynamics.mass_matrix, torque - dynamics.bias)
        size = np.abs(expected).max()
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8 * max(1.0, size))


@pytest.mark.parametrize("name", ["four_bar", "sprung"])
def test_accelerations_are_those_of_pinocchios_own_constraints(name):
    """Of robots whose loops are points."""
    robot = looped(name)
    model, dynamics = robot.model, hp.Dynamics(robot)
    made = pin.StdVec_RigidConstraintModel()
    for tie in robot.loops.ties:
        ends = [model.frames[model.getFrameId(name)] for name in (tie.first, tie.second)]
        places = [x for end in ends for x in (end.parentJoint, end.placement)]
        made.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, *places))
    data, own = model.createData(), [*range(6), *robot.columns]
    for q, v in states(name, STATES):
        dynamics.update(q, v)
        tree, speed = robot.closed(q), robot.velocity_map(q) @ v
        datas = pin.StdVec_RigidConstraintData()
        for one in made:
            datas.append(one.createData())
        pin.initConstraintDynamics(model, data, made, datas)
        # Two rows of three are needed: Pinocchio solves with a proximal iteration.
        settings = pin.ProximalSettings(1e-13, 1e-9, 60)
        found = pin.constraintDynamics(
            model, data, tree, speed, np.zeros(model.nv), made, datas, settings
        )[own]
        ours = np.linalg.solve(dynamics.mass_matrix, -dynamics.bias)
        np.testing.assert_allclose(ours, found, rtol=0, atol=1e-7 * np.abs(found).max())


@pytest.mark.parametrize("name", NAMES)
def test_feet_and_rotors_are_where_the_tree_has_them(name):
    robot, dynamics = looped(name), hp.Dynamics(looped(name))
    model, data = robot.model, robot.model.createData()
    for q, v in states(name, 20):
        dynamics.update(q, v)
        tree, spread = robot.closed(q), robot.velocity_map(q)
        slide = constrained_drift(robot, tree, spread @ v)
        pin.forwardKinematics(model, data, tree, spread @ v, slide)
        posed = Posed(robot, q)
        for k, foot in enumerate(robot.feet):
            i, rows = robot.frame_id(foot), slice(3 * k, 3 * k + 3)
            place = pin.updateFramePlacement(model, data, i).translation
            drift = pin.getFrameClassicalAcceleration(model, data, i, WORLD_AXES).linear
            velocity = pin.getFrameVelocity(model, data, i, WORLD_AXES).linear
            for ours, theirs in (
                (dynamics.foot_position[k], place),
                (dynamics.foot_velocity[k], velocity),
                (dynamics.foot_jacobian[rows], posed.jacobian(foot)[:3]),
                (dynamics.foot_drift[rows], drift),
            ):
                np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-8)
        for n, rotor in enumerate(robot.rotors):
            axis = posed.frame(rotor.frame).rotation @ np.array(rotor.axis)
            expected = axis @ posed.jacobian(rotor.frame)[:3]
            np.testing.assert_allclose(dynamics.thruster_jacobian[n], expected, atol=1e-12)


def constrained_drift(robot: hp.Robot, tree, speed):
    """Acceleration of the tree where base and driven joints have none."""
    jacobian, drift = constraint(robot, tree, speed)
    passive = [robot.model.joints[j].idx_v for j in robot.loops.passive]
    found = np.zeros(robot.model.nv)
    found[passive] = -np.linalg.lstsq(jacobian[:, passive], drift, rcond=1e-10)[0]
    return found


@kernel
def forces(tree, v, acceleration, out):
    inverse_dynamics(tree, v, acceleration, out)


@pytest.mark.parametrize("name", NAMES)
def test_inverse_dynamics_is_that_of_the_terms(name):
    robot, rng = looped(name), np.random.default_rng(7)
    dynamics, out = hp.Dynamics(robot), np.zeros(robot.nv)
    for q, v in states(name, 20):
        dynamics.update(q, v)
        a = rng.normal(size=robot.nv)
        expected = dynamics.mass_matrix @ a + dynamics.bias
        forces(dynamics.record["tree"], v, a, out)
        np.testing.assert_allclose(out, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["four_bar", "parallel_ankle", "harpy_built", "sprung"])
def test_energy_of_flight_stays(name):
    """Over five seconds in the plant, with springs at the joints that keep them off their ends."""
    robot = looped(name).with_joints(damping=0.0, armature=0.01)
    errors = []
    for dt in (1e-3, 2.5e-4):
        simulator = hp.Simulator(robot, dt=dt, gravity=(0.0, 0.0, 0.0))
        q, v = robot.reference, np.zeros(robot.nv)
        q[2], v[3:6] = 100.0, (0.6, -0.4, 0.8)
        v[6:] = np.where(np.arange(robot.nv - 6) % 2, 0.3, -0.2)
        law = np.zeros((4, robot.nv - 6))
        law[0], law[2] = q[7:], 3.0
        thrust = np.zeros((len(robot.thrusters), 3))
        simulator.reset(q, v)
        before = energy(simulator, law)
        largest = 0.0
        for _ in range(100):
            command = hp.Command(np.zeros(robot.nv - 6), thrust)
            command.law = law
            simulator.advance(command, steps=round(0.05 / dt))
            largest = max(largest, abs(energy(simulator, law) / before - 1.0))
        assert np.abs(simulator.v[6:]).max() > 0.02
        errors.append(largest)
    assert errors[1] < 0.35 * errors[0]
    assert errors[1] < 5e-3


def energy(simulator: hp.Simulator, law) -> float:
    v, bent = simulator.v, simulator.q[7:] - law[0]
    return 0.5 * float(v @ simulator.dynamics.mass_matrix @ v + bent @ (law[2] * bent))
