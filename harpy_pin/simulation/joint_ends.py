"""Ends of the joints: a spring and a damper beyond each, as stiff as a step allows.

A joint that is beyond its end by x gets the torque −k x − d ẋ, never further out. With the inertia
I that it has where all other joints are free, k = I ω² and d = 2 I ω, critically damped. The
frequency is ω = 0.2 / dt, well below 1 / dt, where an explicit spring would be unstable. Within its
ends a joint feels nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import kernel
from harpy_pin.model.posed import free_inertia
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

STEP = 0.2
"""Frequency of the springs, in 1 / dt."""


class JointEndsRecord(RecordOf):
    """The joints that have ends; their range is from lower to upper."""

    place: NDArray[np.int64]  # (ends,) of each joint's angle in q
    column: NDArray[np.int64]  # (ends,) of its velocity in v
    lower: Vector  # (ends,) rad
    upper: Vector  # (ends,) rad
    stiffness: Vector  # (ends,) N·m/rad
    damping: Vector  # (ends,) N·m·s/rad


def joint_ends_record(robot: Robot | None = None, dt: float = 1.0) -> Records[JointEndsRecord]:
    """The ends of a robot's joints; of none by default.

    A joint without a range, as where its file gives none, and one that turns without bounds have no
    ends.

    Args:
        robot: whose joints.
        dt: step of the plant, s.
    """
    place, column, low, high, inertia = (
        np.zeros(0, np.int64),
        np.zeros(0, np.int64),
        *np.zeros((3, 0)),
    )
    if robot is not None:
        q, (place, unbounded) = robot.neutral, robot.layout
        low, high = robot.joint_lower, robot.joint_upper
        ranged = (unbounded == 0) & (low[place - 7] < high[place - 7])
        column, place = 6 + np.flatnonzero(ranged), place[ranged]
        low, high = low[place - 7], high[place - 7]
        q[7:] = 0.0 if robot.posture is None else robot.posture
        inertia = free_inertia(robot, q)[column - 6]
    return make_record(
        JointEndsRecord,
        place=place,
        column=column,
        lower=low,
        upper=high,
        stiffness=inertia * (STEP / dt) ** 2,
        damping=2.0 * inertia * STEP / dt,
    )


@kernel
def hold_at_ends(e: JointEndsRecord, q: Vector, v: Vector, bias: Vector) -> None:
    """Take the torques of the joints' ends from the bias forces (nv,), N·m, at a state q (nq,), v
    (nv,).
    """
    angle = q[e.place]
    push = e.stiffness * (angle - np.clip(angle, e.lower, e.upper)) + e.damping * v[e.column]
    inwards = np.where(angle < e.lower, np.minimum(push, 0.0), 0.0)
    bias[e.column] += np.where(angle > e.upper, np.maximum(push, 0.0), inwards)
