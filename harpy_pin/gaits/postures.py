"""Postures: angles that a robot's joints can have."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__: list[str] = []

ROUNDING = 1e-6
"""By how much an angle may be beyond its limit, rad: files and postures have rounded numbers."""


def read_posture(robot: Robot, posture: ArrayLike) -> Vector:
    """(joints,) angles of a posture, rad.

    Args:
        robot: whose posture it is. A joint whose limits leave no range, as where the file names none, is free.
        posture: angles in the order of the robot's joints, rad.

    Raises:
        InputError: wrong shape, not finite, or an angle beyond the limits of its joint; the message names them.
    """
    angles = checks.vector("posture", posture, len(robot.joints))
    lower, upper = robot.joint_lower, robot.joint_upper
    beyond = (lower < upper) & ((angles < lower - ROUNDING) | (angles > upper + ROUNDING))
    for k in np.flatnonzero(beyond):
        limits = f"{lower[k]:g} to {upper[k]:g} rad"
        message = f"posture: joint '{robot.joints[k]}' is at {angles[k]:g} rad, beyond its limits {limits}"
        raise InputError(message, name="posture", value=posture)
    return angles
