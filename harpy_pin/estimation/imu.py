"""What a robot feels itself with: the inertial unit, encoders, motor torques, foot switches."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.model.state import Vector

MOST = 1e6
"""Largest number of a sensor, in its unit."""
_ANY_SIGN = ("position", "orientation")


@dataclass(frozen=True, kw_only=True)
class Imu:
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

    position: tuple[float, ...] = (0.0, 0.0, 0.0)
    orientation: tuple[float, ...] = (0.0, 0.0, 0.0)
    rate: float | None = None
    gyroscope_density: float = 1.7e-4
    gyroscope_bias: float = 1e-3
    gyroscope_walk: float = 2e-5
    gyroscope_range: float = 35.0
    accelerometer_density: float = 2e-3
    accelerometer_bias: float = 0.04
    accelerometer_walk: float = 2e-4
    accelerometer_range: float = 157.0
    encoder_resolution: float = 4e-4
    encoder_noise: float = 5e-4
    velocity_noise: float = 2e-2
    torque_error: float = 0.03
    torque_noise: float = 0.1
    foot_noise: float | None = None

    def __post_init__(self) -> None:
        values: dict[str, object] = {}
        for entry in fields(self):
            name, value = entry.name, getattr(self, entry.name)
            if name in _ANY_SIGN:
                values[name] = tuple(checks.vector(f"imu {name}", value, 3).tolist())
            elif value is not None or entry.default is not None:
                strict = name.endswith(("range", "rate"))
                values[name] = checks.number(
                    f"imu {name}", value, low=0.0, high=MOST, strict=strict
                )
        checks.keep(self, **values)

    @property
    def rotation(self) -> Vector:
        """(3, 3) axes of the inertial unit to the body's."""
        return np.asarray(pin.rpy.rpyToMatrix(*self.orientation))
