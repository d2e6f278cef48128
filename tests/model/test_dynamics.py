"""Equations of motion and feet against Pinocchio."""

import numpy as np
import pinocchio as pin
from forward_dynamics import frame_terms, generalised_force, places
from hypothesis import given
from hypothesis import strategies as st

import harpy_pin as hp
from harpy_pin import Dynamics

seeds = st.integers(0, 2**32 - 1)


@given(seed=seeds)
def test_equation_of_motion_against_aba(robot, draw_state, seed):
    """For any gravity, which leaves the robot as it is."""
    rng = np.random.default_rng(seed)
    q, v = draw_state(rng)
    torque, forces = rng.uniform(-8, 8, 6), rng.uniform(-50, 50, (4, 3))
    jacobian, _ = frame_terms(robot.model, (*robot.feet, *robot.thrusters), q, np.zeros(12))
    force = np.concatenate((np.zeros(6), torque)) + np.vstack(jacobian).T @ forces.ravel()  # S τ + J_fᵀ f + J_tᵀ u_t
    model = robot.model.copy()
    model.gravity.linear = rng.uniform(-10, 10, 3)
    acceleration = pin.aba(model, model.createData(), q, v, force)
    dynamics = Dynamics(robot, gravity=model.gravity.linear)
    dynamics.update(q, v)
    np.testing.assert_array_equal(robot.model.gravity.linear, [0, 0, -9.81])
    right = generalised_force(dynamics, torque, forces[:2], forces[2:])
    np.testing.assert_allclose(right, force, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(dynamics.mass_matrix, dynamics.mass_matrix.T)
    residual = dynamics.mass_matrix @ acceleration + dynamics.bias - right
    scale = max(1.0, np.abs(dynamics.mass_matrix).max() * np.abs(acceleration).max())
    assert np.abs(residual).max() <= 1e-12 * scale


@given(seed=seeds)
def test_feet_move_as_pinocchio_says(robot, draw_state, seed):
    """Placements, velocities, drifts and Jacobians against Pinocchio's own functions of frames, for any gravity."""
    rng = np.random.default_rng(seed)
    dynamics = Dynamics(robot, gravity=rng.uniform(-10, 10, 3))
    dynamics.update(*draw_state(rng))  # nothing may be left of an earlier state
    q, v = draw_state(rng)
    dynamics.update(q, v)
    jacobian, drift = frame_terms(robot.model, (*robot.feet, *robot.thrusters), q, v)
    np.testing.assert_allclose(dynamics.foot_position, places(robot, q), rtol=0, atol=1e-13)
    np.testing.assert_allclose(dynamics.foot_velocity, jacobian[:2] @ v, atol=1e-12)
    np.testing.assert_allclose(dynamics.foot_drift, drift[:2].ravel(), rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(dynamics.foot_jacobian, np.vstack(jacobian[:2]), rtol=0, atol=1e-13)
    np.testing.assert_allclose(dynamics.thruster_jacobian, np.vstack(jacobian[2:]), rtol=0, atol=1e-13)


def test_robot_without_thrusters(robot):
    bare = hp.load_robot(robot.urdf, feet=("right_foot",))
    dynamics = Dynamics(bare)
    q, v = pin.neutral(bare.model), np.arange(12.0)
    dynamics.update(q, v)
    assert dynamics.foot_jacobian.shape == (3, 12)
    assert dynamics.thruster_jacobian.shape == (0, 12)
    force = generalised_force(dynamics, np.zeros(6), np.array([[0, 0, 1.0]]), np.zeros((0, 3)))
    np.testing.assert_allclose(force, dynamics.foot_jacobian[2], atol=1e-15)
