"""Simulated sensors: at rest, in free fall, and their noise."""

import numpy as np
import pinocchio as pin
import pytest

import harpy_pin as hp
from harpy_pin.simulation.sensing import Sensing

LEVEL, ZERO = np.eye(3), np.zeros(3)
QUIET = dict.fromkeys(
    (
        *("gyroscope_density", "gyroscope_bias", "gyroscope_walk"),
        *("accelerometer_density", "accelerometer_bias", "accelerometer_walk"),
        *("encoder_resolution", "encoder_noise", "velocity_noise", "torque_error", "torque_noise"),
    ),
    0.0,
)


def state_of(robot, *, t=0.0, turn=LEVEL, velocity=ZERO, spin=ZERO):
    q, v = hp.make_gait(robot).initial_state()
    q[3:7] = pin.Quaternion(turn).coeffs()
    v[:3], v[3:6] = turn.T @ velocity, spin
    return hp.State(t, q, v, *np.zeros((3, len(robot.feet), 3)))


def test_exact_sensors_of_a_known_motion():
    """A body that turns about a fixed axis and falls freely: the unit feels its centripetal
    acceleration alone.
    """
    robot, place, spin, period = (
        hp.load_harpy(),
        np.array([0.1, -0.2, 0.05]),
        np.array([0.0, 0.0, 2.0]),
        1e-3,
    )
    sensing = Sensing(
        robot, hp.Imu(**QUIET, position=tuple(place), orientation=(0.4, 0.2, -0.7)), period=period
    )
    axes = pin.rpy.rpyToMatrix(0.4, 0.2, -0.7)
    for n in range(3):
        turn = pin.exp3(n * period * spin)
        fall = np.array([0.0, 0.0, -9.81 * n * period])
        state = state_of(robot, turn=turn, velocity=fall, spin=spin)
        readings = sensing.read(state, np.zeros(6))
    np.testing.assert_allclose(axes @ readings.gyroscope, spin, atol=1e-9)
    np.testing.assert_allclose(
        axes @ readings.accelerometer, np.cross(spin, np.cross(spin, place)), atol=1e-5
    )
    np.testing.assert_array_equal(readings.joint_position, state.q[7:])


def test_noise_is_as_large_as_stated():
    robot, imu = hp.load_harpy(), hp.Imu(foot_noise=1.0)
    sensing, state = Sensing(robot, imu, period=1e-3, seed=3), state_of(hp.load_harpy())
    rows = [sensing.read(state, np.ones(6)) for _ in range(1500)]
    root = np.sqrt(1e3)
    for name, size in {
        "gyroscope": imu.gyroscope_density * root,
        "accelerometer": imu.accelerometer_density * root,
        "joint_position": np.hypot(imu.encoder_noise, imu.encoder_resolution / np.sqrt(12.0)),
        "joint_velocity": imu.velocity_noise,
        "joint_torque": imu.torque_noise,
        "foot_force": imu.foot_noise,
    }.items():
        values = np.array([getattr(row, name) for row in rows])
        assert np.std(values, axis=0).mean() == pytest.approx(size, rel=0.05), name
    angles = np.array([row.joint_position for row in rows]) / imu.encoder_resolution
    np.testing.assert_allclose(angles, np.round(angles), atol=1e-6)
    again = Sensing(robot, imu, period=1e-3, seed=3)
    np.testing.assert_array_equal(again.read(state, np.ones(6)).gyroscope, rows[0].gyroscope)
    biases = [Sensing(robot, imu, period=1e-3, seed=seed).gyroscope_bias for seed in range(200)]
    assert np.std(biases) == pytest.approx(imu.gyroscope_bias, rel=0.1)


def test_rate_and_range(robot):
    sensing = Sensing(robot, hp.Imu(rate=250.0, gyroscope_range=1.0), period=1e-3)
    turns = [pin.exp3(np.array([0.0, 0.0, 5e-3 * n])) for n in range(12)]
    rows = [sensing.read(state_of(robot, turn=turn), np.zeros(6)) for turn in turns]
    said = np.array([row.gyroscope[2] for row in rows])
    assert [len(set(said[n : n + 4])) for n in (0, 4, 8)] == [1, 1, 1]
    assert said.max() == 1.0
