"""Equations of motion against ABA, MuJoCo, finite differences, and the conservation laws."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import harpy_pin as hp
from harpy_pin import Command, Dynamics, Simulator

seeds = st.integers(0, 2**32 - 1)
WORLD = pin.LOCAL_WORLD_ALIGNED
NO_COMMAND = Command(np.zeros(6), np.zeros((2, 3)))


@pytest.fixture(scope="module")
def dynamics(robot):
    return Dynamics(robot)


def draw_forces(rng):
    return rng.uniform(-8, 8, 6), rng.uniform(-40, 40, (2, 3)), rng.uniform(-50, 50, (2, 3))


def generalised(robot, q, torque, foot_force, thrust):
    """S τ + J_fᵀ f + J_tᵀ u_t from Pinocchio's frame Jacobians."""
    data = robot.model.createData()
    total = np.concatenate((np.zeros(6), torque))
    for names, forces in ((robot.feet, foot_force), (robot.thrusters, thrust)):
        for name, force in zip(names, forces, strict=True):
            jacobian = pin.computeFrameJacobian(robot.model, data, q, robot.frame_id(name), WORLD)
            total += jacobian[:3].T @ force
    return total


def points(robot, q):
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return np.array([data.oMf[robot.frame_id(name)].translation for name in (*robot.feet, *robot.thrusters)])


# --- One state ------------------------------------------------------------------------------------------------------


@given(seed=seeds)
def test_equation_of_motion_against_aba(robot, dynamics, draw_state, seed):
    rng = np.random.default_rng(seed)
    q, v = draw_state(rng)
    torque, foot_force, thrust = draw_forces(rng)
    force = generalised(robot, q, torque, foot_force, thrust)
    acceleration = pin.aba(robot.model, robot.model.createData(), q, v, force)
    dynamics.update(q, v)
    right = dynamics.generalised_force(torque, foot_force, thrust)
    np.testing.assert_allclose(right, force, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(dynamics.mass_matrix, dynamics.mass_matrix.T)
    residual = dynamics.mass_matrix @ acceleration + dynamics.bias - right
    scale = max(1.0, np.abs(dynamics.mass_matrix).max() * np.abs(acceleration).max())
    assert np.abs(residual).max() <= 1e-12 * scale
    np.testing.assert_allclose(dynamics.acceleration(q, v, force), acceleration, rtol=1e-9, atol=1e-9)


@given(seed=seeds)
def test_forward_dynamics_do_not_disturb_the_last_update(dynamics, draw_state, seed):
    rng = np.random.default_rng(seed)
    q, v = draw_state(rng)
    dynamics.update(q, v)
    names = ("mass_matrix", "bias", "foot_jacobian", "foot_drift", "foot_position", "foot_velocity")
    before = {name: getattr(dynamics, name).copy() for name in names}
    dynamics.acceleration(*draw_state(rng), rng.uniform(-5, 5, 12))
    for name, value in before.items():
        np.testing.assert_array_equal(getattr(dynamics, name), value, err_msg=name)


@given(seed=seeds)
def test_mass_matrix_and_gravity_from_energy(robot, dynamics, draw_state, seed):
    """Kinetic energy fixes M, potential energy fixes n at rest: no recursion shared with the code."""
    q, v = draw_state(np.random.default_rng(seed))
    model, data = robot.model, robot.model.createData()
    dynamics.update(q, v)
    kinetic = pin.computeKineticEnergy(model, data, q, v)
    assert 0.5 * v @ dynamics.mass_matrix @ v == pytest.approx(kinetic, rel=1e-12)
    assert np.linalg.eigvalsh(dynamics.mass_matrix).min() > 0.0
    dynamics.update(q, np.zeros(12))
    h = 1e-5

    def potential(step):
        return pin.computePotentialEnergy(model, data, pin.integrate(model, q, step))

    slope = [(potential(h * e) - potential(-h * e)) / (2 * h) for e in np.eye(12)]
    np.testing.assert_allclose(dynamics.bias, slope, rtol=0, atol=1e-7)


@pytest.fixture(scope="module")
def peer(robot):
    """The same URDF in MuJoCo, free of contacts, limits and joint damping; armature set by hand."""
    spec = mujoco.MjSpec.from_file(str(robot.urdf))
    spec.body("base").add_freejoint()
    model = spec.compile()
    model.dof_armature[:] = robot.model.armature
    model.dof_damping[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    return model, mujoco.MjData(model)


@given(seed=seeds)
def test_against_mujoco(robot, dynamics, peer, draw_state, seed):
    """Inertia, bias and forward dynamics; MuJoCo's base velocity is linear in world axes, angular in body axes."""
    rng = np.random.default_rng(seed)
    q, v = draw_state(rng)
    torque, foot_force, thrust = draw_forces(rng)
    rotation = pin.Quaternion(q[3:7]).matrix()
    to_mujoco = np.eye(12)
    to_mujoco[:3, :3] = rotation

    model, data = peer
    data.qpos[:] = np.concatenate((q[:3], q[[6, 3, 4, 5]], q[7:]))
    data.qvel[:] = to_mujoco @ v
    data.qfrc_applied[:] = np.concatenate((np.zeros(6), torque))
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    for point, force, body in zip(
        points(robot, q), (*foot_force, *thrust), ("left_shank", "right_shank", "base", "base"), strict=True
    ):
        mujoco.mj_applyFT(model, data, force, np.zeros(3), point, model.body(body).id, data.qfrc_applied)
    mujoco.mj_forward(model, data)
    inertia = np.zeros((12, 12))
    mujoco.mj_fullM(model, data, inertia)

    dynamics.update(q, v)
    np.testing.assert_allclose(dynamics.mass_matrix, to_mujoco.T @ inertia @ to_mujoco, rtol=0, atol=1e-12)
    transport = np.concatenate((rotation @ np.cross(v[3:6], v[:3]), np.zeros(9)))  # d/dt of the world-axes velocity
    bias = to_mujoco.T @ (inertia @ transport + data.qfrc_bias)
    np.testing.assert_allclose(dynamics.bias, bias, rtol=0, atol=1e-9)
    force = dynamics.generalised_force(torque, foot_force, thrust)
    np.testing.assert_allclose(force, to_mujoco.T @ data.qfrc_applied, rtol=0, atol=1e-10)
    acceleration = dynamics.acceleration(q, v, force)
    np.testing.assert_allclose(to_mujoco @ acceleration + transport, data.qacc, rtol=1e-8, atol=1e-8)


@given(seed=seeds)
def test_points_and_their_jacobians(robot, dynamics, draw_state, seed):
    q, v = draw_state(np.random.default_rng(seed))
    dynamics.update(q, v)
    np.testing.assert_allclose(dynamics.foot_position, points(robot, q)[:2], rtol=0, atol=1e-14)
    jacobian = np.concatenate((dynamics.foot_jacobian, dynamics.thruster_jacobian))
    np.testing.assert_allclose(dynamics.foot_velocity, (dynamics.foot_jacobian @ v).reshape(2, 3), atol=1e-12)
    data = robot.model.createData()
    for k, name in enumerate((*robot.feet, *robot.thrusters)):
        expected = pin.computeFrameJacobian(robot.model, data, q, robot.frame_id(name), WORLD)[:3]
        np.testing.assert_allclose(jacobian[3 * k : 3 * k + 3], expected, rtol=0, atol=1e-13)
    h = 1e-3
    ahead, behind, two_ahead, two_behind = (
        points(robot, pin.integrate(robot.model, q, s * h * v)) for s in (1, -1, 2, -2)
    )
    slope = (8 * (ahead - behind) - (two_ahead - two_behind)) / (12 * h)
    np.testing.assert_allclose((jacobian @ v).reshape(4, 3), slope, rtol=0, atol=1e-7)


@given(seed=seeds)
def test_drift_is_the_change_of_velocity_at_constant_v(robot, dynamics, draw_state, seed):
    q, v = draw_state(np.random.default_rng(seed))
    h, velocity = 1e-3, {}
    for s in (1, -1, 2, -2):
        dynamics.update(pin.integrate(robot.model, q, s * h * v), v)
        velocity[s] = dynamics.foot_velocity.ravel().copy()
    dynamics.update(q, v)
    slope = (8 * (velocity[1] - velocity[-1]) - (velocity[2] - velocity[-2])) / (12 * h)
    np.testing.assert_allclose(dynamics.foot_drift, slope, rtol=0, atol=1e-5)


@given(seed=seeds)
def test_feet_move_as_pinocchio_says(robot, draw_state, seed):
    """Placements, velocities, drifts and Jacobians against Pinocchio's own functions of frames, for any gravity."""
    rng = np.random.default_rng(seed)
    dynamics = Dynamics(robot, gravity=rng.uniform(-10, 10, 3))
    dynamics.update(*draw_state(rng))  # nothing may be left of an earlier state
    q, v = draw_state(rng)
    dynamics.update(q, v)
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, q, v, np.zeros(12))
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    axes = pin.LOCAL_WORLD_ALIGNED
    for k, name in enumerate(robot.feet):
        i, rows = model.getFrameId(name), slice(3 * k, 3 * k + 3)
        drift = pin.getFrameClassicalAcceleration(model, data, i, axes).linear
        np.testing.assert_allclose(dynamics.foot_position[k], data.oMf[i].translation, rtol=0, atol=1e-13)
        np.testing.assert_allclose(
            dynamics.foot_velocity[k], pin.getFrameVelocity(model, data, i, axes).linear, atol=1e-12
        )
        np.testing.assert_allclose(dynamics.foot_drift[rows], drift, rtol=1e-12, atol=1e-11)
        np.testing.assert_allclose(
            dynamics.foot_jacobian[rows], pin.getFrameJacobian(model, data, i, axes)[:3], rtol=0, atol=1e-13
        )


@given(seed=seeds)
def test_gravity_is_a_choice_and_leaves_the_robot_alone(robot, draw_state, seed):
    rng = np.random.default_rng(seed)
    q, _ = draw_state(rng)
    gravity = rng.uniform(-10, 10, 3)
    tilted = Dynamics(robot, gravity=gravity)
    tilted.update(q, np.zeros(12))
    rotation = pin.Quaternion(q[3:7]).matrix()
    np.testing.assert_allclose(tilted.bias[:3], -robot.mass * rotation.T @ gravity, atol=1e-12)
    np.testing.assert_array_equal(robot.model.gravity.linear, [0, 0, -9.81])


# --- Free flight ----------------------------------------------------------------------------------------------------


def rate(robot, force):
    """dy/dt of y = (q, v), quaternion embedded in R⁴, by the library's forward dynamics."""
    dynamics = Dynamics(robot)

    def slope(_, y):
        q, v = y[:13].copy(), y[13:]
        q[3:7] /= np.linalg.norm(q[3:7])
        quaternion = pin.Quaternion(q[3:7])
        turn = 0.5 * (quaternion * pin.Quaternion(0.0, *v[3:6])).coeffs()
        q_dot = np.concatenate((quaternion.matrix() @ v[:3], turn, v[6:]))
        return np.concatenate((q_dot, dynamics.acceleration(q, v, force - robot.model.damping * v)))

    return slope


def fly(robot, q, v, times, force=0.0):
    found = solve_ivp(
        rate(robot, force * np.ones(12) if np.isscalar(force) else force),
        (0, times[-1]),
        np.concatenate((q, v)),
        method="DOP853",
        t_eval=times,
        rtol=1e-11,
        atol=1e-12,
    )
    assert found.success
    return found.y[:13].T, found.y[13:].T


def conserved(robot, q, v, t):
    """Momentum less what gravity gave, angular momentum about the CoM, energy (Pinocchio counts the armature in)."""
    data = robot.model.createData()
    momentum = pin.computeCentroidalMomentum(robot.model, data, q, v)
    energy = pin.computeMechanicalEnergy(robot.model, data, q, v)
    return momentum.linear + robot.mass * t * np.array([0, 0, 9.81]), momentum.angular, energy


@settings(max_examples=5)
@given(seed=seeds)
def test_free_flight_conserves_momentum_and_energy(undamped, draw_state, seed):
    q, v = draw_state(np.random.default_rng(seed))
    v *= 0.5
    times = np.linspace(0.0, 0.4, 5)
    linear, angular, energy = conserved(undamped, q, v, 0.0)
    for t, q_t, v_t in zip(times, *fly(undamped, q, v, times), strict=True):
        linear_t, angular_t, energy_t = conserved(undamped, q_t, v_t, t)
        np.testing.assert_allclose(linear_t, linear, rtol=0, atol=1e-8)
        np.testing.assert_allclose(angular_t, angular, rtol=0, atol=1e-8)
        assert energy_t == pytest.approx(energy, abs=1e-7)


@settings(max_examples=5)
@given(seed=seeds)
def test_joint_torques_leave_momentum_alone_and_their_work_is_the_energy(undamped, draw_state, seed):
    rng = np.random.default_rng(seed)
    q, v = draw_state(rng)
    v *= 0.5
    torque = rng.uniform(-0.5, 0.5, 6)
    times = np.linspace(0.0, 0.2, 3)
    flight_q, flight_v = fly(undamped, q, v, times, np.concatenate((np.zeros(6), torque)))
    linear, angular, energy = conserved(undamped, q, v, 0.0)
    linear_t, angular_t, energy_t = conserved(undamped, flight_q[-1], flight_v[-1], times[-1])
    np.testing.assert_allclose(linear_t, linear, rtol=0, atol=1e-8)
    np.testing.assert_allclose(angular_t, angular, rtol=0, atol=1e-8)
    work = torque @ (flight_q[-1][7:] - q[7:])
    assert energy_t - energy == pytest.approx(work, abs=1e-7)


def simulate_flight(robot, q, v, dt, duration):
    simulator = Simulator(robot, dt=dt)
    high = q.copy()
    high[2] += 50.0  # nowhere near the ground
    simulator.reset(high, v)
    for _ in range(round(duration / dt)):
        simulator.advance(NO_COMMAND)
    np.testing.assert_array_equal(simulator.state.foot_force, 0.0)
    end = simulator.q.copy()
    end[2] -= 50.0
    return end, simulator.v.copy()


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("damped", [False, True])
def test_simulated_flight_converges_with_order_one(robot, undamped, draw_state, seed, damped):
    """Against an integrator of order eight; with and without the joint damping, which the step takes implicitly."""
    flyer = robot if damped else undamped
    q, v = draw_state(np.random.default_rng(seed))
    v *= 0.3
    true_q, true_v = (path[-1] for path in fly(flyer, q, v, np.array([0.0, 0.2])))
    errors = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        end_q, end_v = simulate_flight(flyer, q, v, dt, 0.2)
        position = pin.difference(flyer.model, true_q, end_q)
        errors.append(np.linalg.norm(np.concatenate((position, end_v - true_v))))
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.15)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.08)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_simulated_flight_keeps_momentum_and_energy_to_order_one(undamped, draw_state, seed):
    q, v = draw_state(np.random.default_rng(seed))
    v *= 0.3
    linear, angular, energy = conserved(undamped, q, v, 0.0)
    drifts = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        linear_t, angular_t, energy_t = conserved(undamped, *simulate_flight(undamped, q, v, dt, 0.2), 0.2)
        drifts.append([np.linalg.norm(linear_t - linear), np.linalg.norm(angular_t - angular), abs(energy_t - energy)])
    drifts = np.array(drifts)
    # Gravity is integrated exactly and the rest is of order one.
    np.testing.assert_allclose(drifts[0] / drifts[1], 2.0, atol=0.2)
    np.testing.assert_allclose(drifts[1] / drifts[2], 2.0, atol=0.1)


def test_still_robot_falls_freely(robot):
    """From rest, without damping of any consequence, the body falls as a stone and no joint moves."""
    simulator = Simulator(robot, dt=1e-3)
    q = np.array([0, 0, 5, 0, 0, 0, 1, 0.1, -0.4, 0.8, -0.1, -0.4, 0.8])
    simulator.reset(q, np.zeros(12))
    for _ in range(200):
        simulator.advance(NO_COMMAND)
    # Semi-implicit Euler falls through g dt² n (n + 1) / 2 exactly.
    assert simulator.q[2] == pytest.approx(5 - 9.81 * 1e-6 * 200 * 201 / 2, abs=1e-11)
    np.testing.assert_allclose(simulator.q[7:], q[7:], atol=1e-11)


def test_thrust_acts_at_the_mounts(robot):
    """Opposite vertical thrusts make a pure roll moment of arm 0.2 m; equal ones lift without turning."""
    dynamics = Dynamics(robot)
    q = np.array([0, 0, 1, 0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0])
    dynamics.update(q, np.zeros(12))
    couple = dynamics.generalised_force(np.zeros(6), np.zeros((2, 3)), np.array([[0, 0, 3.0], [0, 0, -3.0]]))
    np.testing.assert_allclose(couple, [0, 0, 0, 0.6, 0, 0, *np.zeros(6)], atol=1e-14)
    lift = dynamics.generalised_force(np.zeros(6), np.zeros((2, 3)), np.array([[0, 0, 3.0], [0, 0, 3.0]]))
    np.testing.assert_allclose(lift, [0, 0, 6.0, 0, 0, 0, *np.zeros(6)], atol=1e-14)


def test_robot_without_thrusters(robot):
    bare = hp.load_robot(robot.urdf, feet=("right_foot",))
    dynamics = Dynamics(bare)
    q, v = pin.neutral(bare.model), np.arange(12.0)
    dynamics.update(q, v)
    assert dynamics.foot_jacobian.shape == (3, 12)
    assert dynamics.thruster_jacobian.shape == (0, 12)
    force = dynamics.generalised_force(np.zeros(6), np.array([[0, 0, 1.0]]), np.zeros((0, 3)))
    np.testing.assert_allclose(force, dynamics.foot_jacobian[2], atol=1e-15)
