"""What a robot feels itself with: the inertial unit, encoders, motor torques, foot switches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.model.state import Vector

MOST = 1e6
"""Largest number of a sensor, in its unit."""
NOT_NEGATIVE: dict[str, Any] = {"low": 0.0, "high": MOST}
POSITIVE: dict[str, Any] = {**NOT_NEGATIVE, "strict": True}


@dataclass(frozen=True, kw_only=True)
class Imu(checks.Checked):
    """The sensors of a robot without a camera. The defaults are of the class that quadrupeds of 10
    to 20 kg have.

    White noise is given as a density: a sample that is the mean of a period T has the standard
    deviation density / √T. Biases are drawn once, with the given standard deviation on each axis,
    and walk from there.

    Attributes:
        position: (3,) of the inertial unit in the body, body axes, m.
        orientation: (3,) roll, pitch and yaw of its axes against the body's, rad.
        rate: samples of the inertial unit per second; None for one at every tick. Between two the
            last one stays.
        gyroscope_density: rad/s/√Hz.
        gyroscope_bias: rad/s.
        gyroscope_walk: rad/s/√s.
        gyroscope_range: largest angular velocity, rad/s.
        accelerometer_density: m/s²/√Hz.
        accelerometer_bias: m/s².
        accelerometer_walk: m/s²/√s.
        accelerometer_range: largest acceleration, m/s².
        encoder_resolution: step of the joint angles, rad; zero for none.
        encoder_noise: white, of each angle, rad.
        velocity_noise: white, of each joint velocity, rad/s.
        torque_error: standard deviation of the motors' gain, drawn once, as a share.
        torque_noise: white, of each torque, N·m.
        foot_noise: white, of the normal force that each foot measures, N; None for feet that
            measure nothing.

    Raises:
        InputError: a number that is negative or not finite.
    """

    whose = "imu "
    position: tuple[float, ...] = checks.setting((0.0, 0.0, 0.0), checks.fixed_vector)
    orientation: tuple[float, ...] = checks.setting((0.0, 0.0, 0.0), checks.fixed_vector)
    rate: float | None = checks.setting(None, **POSITIVE)
    gyroscope_density: float = checks.setting(1.7e-4, **NOT_NEGATIVE)
    gyroscope_bias: float = checks.setting(1e-3, **NOT_NEGATIVE)
    gyroscope_walk: float = checks.setting(2e-5, **NOT_NEGATIVE)
    gyroscope_range: float = checks.setting(35.0, **POSITIVE)
    accelerometer_density: float = checks.setting(2e-3, **NOT_NEGATIVE)
    accelerometer_bias: float = checks.setting(0.04, **NOT_NEGATIVE)
    accelerometer_walk: float = checks.setting(2e-4, **NOT_NEGATIVE)
    accelerometer_range: float = checks.setting(157.0, **POSITIVE)
    encoder_resolution: float = checks.setting(4e-4, **NOT_NEGATIVE)
    encoder_noise: float = checks.setting(5e-4, **NOT_NEGATIVE)
    velocity_noise: float = checks.setting(2e-2, **NOT_NEGATIVE)
    torque_error: float = checks.setting(0.03, **NOT_NEGATIVE)
    torque_noise: float = checks.setting(0.1, **NOT_NEGATIVE)
    foot_noise: float | None = checks.setting(None, **NOT_NEGATIVE)

    @property
    def rotation(self) -> Vector:
        """(3, 3) axes of the inertial unit to the body's."""
        return np.asarray(pin.rpy.rpyToMatrix(*self.orientation))
