"""What sensors say at one time."""

from __future__ import annotations

from dataclasses import dataclass

from harpy_pin.model.state import Vector


@dataclass(slots=True)
class Readings:
    """One sample of all sensors. A sensor that has none says NaN.

    Attributes:
        t: time, s.
        gyroscope: (3,) angular velocity, axes of the inertial unit, rad/s.
        accelerometer: (3,) acceleration less gravity, axes of the inertial unit, m/s²; (0, 0, 9.81)
            at rest, upright.
        joint_position: (joints,) angles, rad, in the order of ``robot.joints``.
        joint_velocity: (joints,) rad/s.
        joint_torque: (joints,) of the motors since the last sample, N·m.
        thrust: (thrusters, 3) commanded since the last sample, world axes, N; None for robots
            without.
        foot_force: (feet,) normal forces of foot sensors, N; 0 and the robot's weight where they
            are switches; None for robots without.
    """

    t: float
    gyroscope: Vector
    accelerometer: Vector
    joint_position: Vector
    joint_velocity: Vector
    joint_torque: Vector
    thrust: Vector | None = None
    foot_force: Vector | None = None
