"""Equations of motion and feet against Pinocchio, and simulated flight against an integrator of
order eight.
"""

import numpy as np
import pinocchio as pin
import pytest
from forward_dynamics import forward_dynamics, generalised_force
from hypothesis import given
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


@given(seed=seeds)
def test_equation_of_motion_against_aba(robot, draw_state, seed):
    """For any gravity, which leaves the robot as it is."""
    rng = np.random.default_rng(seed)
    q, v = draw_state(rng)
    torque, foot_force, thrust = draw_forces(rng)
    force = generalised(robot, q, torque, foot_force, thrust)
    model = robot.model.copy()
    model.gravity.linear = rng.uniform(-10, 10, 3)
    acceleration = pin.aba(model, model.createData(), q, v, force)
    dynamics = Dynamics(robot, gravity=model.gravity.linear)
    dynamics.update(q, v)
    np.testing.assert_array_equal(robot.model.gravity.linear, [0, 0, -9.81])
    right = generalised_force(dynamics, torque, foot_force, thrust)
    np.testing.assert_allclose(right, force, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(dynamics.mass_matrix, dynamics.mass_matrix.T)
    residual = dynamics.mass_matrix @ acceleration + dynamics.bias - right
    scale = max(1.0, np.abs(dynamics.mass_matrix).max() * np.abs(acceleration).max())
    assert np.abs(residual).max() <= 1e-12 * scale


@given(seed=seeds)
def test_feet_move_as_pinocchio_says(robot, draw_state, seed):
    """Placements, velocities, drifts and Jacobians against Pinocchio's own functions of frames, for
    any gravity.
    """
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
        np.testing.assert_allclose(
            dynamics.foot_position[k], data.oMf[i].translation, rtol=0, atol=1e-13
        )
        np.testing.assert_allclose(
            dynamics.foot_velocity[k], pin.getFrameVelocity(model, data, i, axes).linear, atol=1e-12
        )
        np.testing.assert_allclose(dynamics.foot_drift[rows], drift, rtol=1e-12, atol=1e-11)
        np.testing.assert_allclose(
            dynamics.foot_jacobian[rows],
            pin.getFrameJacobian(model, data, i, axes)[:3],
            rtol=0,
            atol=1e-13,
        )
    mounts = [
        pin.getFrameJacobian(model, data, model.getFrameId(name), axes)[:3]
        for name in robot.thrusters
    ]
    np.testing.assert_allclose(dynamics.thruster_jacobian, np.vstack(mounts), rtol=0, atol=1e-13)


def rate(robot, force):
    """dy/dt of y = (q, v), quaternion embedded in R⁴, by the library's forward dynamics."""
    dynamics = Dynamics(robot)

    def slope(_, y):
        q, v = y[:13].copy(), y[13:]
        q[3:7] /= np.linalg.norm(q[3:7])
        quaternion = pin.Quaternion(q[3:7])
        turn = 0.5 * (quaternion * pin.Quaternion(0.0, *v[3:6])).coeffs()
        q_dot = np.concatenate((quaternion.matrix() @ v[:3], turn, v[6:]))
        return np.concatenate(
            (q_dot, forward_dynamics(dynamics, q, v, force - robot.model.damping * v))
        )

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


def simulate_flight(robot, q, v, dt, duration):
    simulator = Simulator(robot, dt=dt)
    high = q.copy()
    high[2] += 50.0  # nowhere near the ground
    simulator.reset(high, v)
    simulator.advance(NO_COMMAND, steps=round(duration / dt))
    np.testing.assert_array_equal(simulator.state.foot_force, 0.0)
    end = simulator.q.copy()
    end[2] -= 50.0
    return end, simulator.v.copy()


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("damped", [False, True])
def test_simulated_flight_converges_with_order_one(robot, undamped, draw_state, seed, damped):
    """Against an integrator of order eight; with and without the joint damping, which the step
    takes implicitly.
    """
    flyer = robot if damped else undamped
    q, v = draw_state(np.random.default_rng(seed))
    v *= 0.1  # no joint comes to its end
    true_q, true_v = (path[-1] for path in fly(flyer, q, v, np.array([0.0, 0.2])))
    errors = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        end_q, end_v = simulate_flight(flyer, q, v, dt, 0.2)
        position = pin.difference(flyer.model, true_q, end_q)
        errors.append(np.linalg.norm(np.concatenate((position, end_v - true_v))))
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.15)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.08)


def test_thrust_acts_at_the_mounts(robot):
    """Opposite vertical thrusts make a pure roll moment of arm 0.2 m; equal ones lift without
    turning.
    """
    dynamics = Dynamics(robot)
    q = np.array([0, 0, 1, 0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0])
    dynamics.update(q, np.zeros(12))
    couple = generalised_force(
        dynamics, np.zeros(6), np.zeros((2, 3)), np.array([[0, 0, 3.0], [0, 0, -3.0]])
    )
    np.testing.assert_allclose(couple, [0, 0, 0, 0.6, 0, 0, *np.zeros(6)], atol=1e-14)
    lift = generalised_force(
        dynamics, np.zeros(6), np.zeros((2, 3)), np.array([[0, 0, 3.0], [0, 0, 3.0]])
    )
    np.testing.assert_allclose(lift, [0, 0, 6.0, 0, 0, 0, *np.zeros(6)], atol=1e-14)


def test_robot_without_thrusters(robot):
    bare = hp.load_robot(robot.urdf, feet=("right_foot",))
    dynamics = Dynamics(bare)
    q, v = pin.neutral(bare.model), np.arange(12.0)
    dynamics.update(q, v)
    assert dynamics.foot_jacobian.shape == (3, 12)
    assert dynamics.thruster_jacobian.shape == (0, 12)
    force = generalised_force(dynamics, np.zeros(6), np.array([[0, 0, 1.0]]), np.zeros((0, 3)))
    np.testing.assert_allclose(force, dynamics.foot_jacobian[2], atol=1e-15)
