"""The controller of the planar walk: clock, closed-form inverse kinematics, joint PID."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np

from harpy_pin import checks
from harpy_pin.compiled import kernel
from harpy_pin.model.record import Records, fields, make_record, sized
from harpy_pin.model.state import Vector
from reproduction.gait.planar_gait import PlanarGait, PlanarGaitRecord, planar_targets

if TYPE_CHECKING:
    from reproduction.gait.planar_model import PlanarModelRecord

__all__ = ["PlanarJoints", "planar_control", "walk_record"]

MAX_JOINT_RATE = 20.0
"""Largest joint velocity target, rad/s, as in the governed controller."""


@dataclass(frozen=True, kw_only=True)
class PlanarJoints:
    """PID of hips and knees (equations.md §3, "joint PID"; the derivative gains are what a 1 ms hold bears).

    Attributes:
        k_p: (hip, knee), N·m/rad.
        k_i: N·m/(rad·s); zero leaves the controller without memory.
        k_d: N·m·s/rad.
        integral_limit: largest torque of the integral part, N·m.
    """

    k_p: tuple[float, float] = (1000.0, 1000.0)
    k_i: tuple[float, float] = (20.0, 20.0)
    k_d: tuple[float, float] = (10.0, 3.0)
    integral_limit: float = 4.0

    def __post_init__(self) -> None:
        for name in ("k_p", "k_i", "k_d"):
            checks.gains(name, getattr(self, name), 2)
        checks.number("integral_limit", self.integral_limit, low=0.0)


class PlanarWalkRecord(PlanarGaitRecord, PlanarJoints):
    """What :func:`planar_control` knows and writes, besides the numbers of the gait and of the PID.

    Attributes:
        period: between ticks, s.
        integral: (4,) integral part of the joint torques, N·m.
        target: (4,) left hip, left knee, right hip, right knee, rad.
        rate: (4,) of the targets, rad/s.
        torque: (4,) of the command, N·m.
    """

    period: float
    integral: Vector = sized(4)
    target: Vector = sized(4)
    rate: Vector = sized(4)
    torque: Vector = sized(4)


def walk_record(gait: PlanarGait, joints: PlanarJoints, *, period: float) -> Records[PlanarWalkRecord]:
    """A new :class:`PlanarWalkRecord`."""
    return make_record(PlanarWalkRecord, period=period, **asdict(joints), **fields(gait.record))


@kernel(q=(7,), v=(7,))
def planar_control(t: float, q: Vector, v: Vector, walk: PlanarWalkRecord, model: PlanarModelRecord) -> None:
    """One tick: joint torques.

    Args:
        t: time, s.
        q: (7,) configuration.
        v: (7,) velocity.
        walk: element of :func:`walk_record`.
        model: element of :attr:`PlanarModel.record`.
    """
    joint_targets(t, walk, model)
    limit = walk.integral_limit
    for i in range(4):
        error = walk.target[i] - q[3 + i]
        walk.integral[i] += walk.k_i[i % 2] * error * walk.period
        walk.integral[i] = min(max(walk.integral[i], -limit), limit)
        walk.torque[i] = walk.k_p[i % 2] * error + walk.integral[i] + walk.k_d[i % 2] * (walk.rate[i] - v[3 + i])


@kernel
def joint_targets(t: float, walk: PlanarWalkRecord, model: PlanarModelRecord) -> None:
    """Targets and rates of the joints: closed-form inverse kinematics.

    Where a foot target is out of reach, they are those of the nearest pose.
    """
    position, velocity, stance = np.empty((2, 2)), np.empty((2, 2)), np.empty((2, 2))
    planar_targets(t, walk, position, velocity, stance)
    for k in range(2):
        _place_leg(k, position[k], velocity[k], walk, model)


@kernel
def _place_leg(k: int, position: Vector, velocity: Vector, walk: PlanarWalkRecord, model: PlanarModelRecord) -> None:
    """Targets and rates of hip and knee that put foot k where it should be in body axes."""
    hip, upper, lower = model.origin[1 + 2 * k], -model.origin[2 + 2 * k, 1], -model.foot[k, 1]
    x, drop = position[0] - hip[0], hip[1] - position[1]
    length = np.hypot(x, drop)
    reach = min(max(length, abs(upper - lower) + 1e-6), upper + lower - 1e-6)
    knee = np.arccos((reach * reach - upper * upper - lower * lower) / (2.0 * upper * lower))
    bend = np.arctan2(lower * np.sin(knee), upper + lower * np.cos(knee))
    # Rates: of the leg's length through the knee, of its direction through the hip.
    knee_rate, hip_rate = 0.0, 0.0
    if reach == length:
        stretch = (x * velocity[0] - drop * velocity[1]) / length
        knee_rate = -stretch * length / (upper * lower * np.sin(knee))
        turn = -(drop * velocity[0] + x * velocity[1]) / (length * length)
        slope = (lower * lower + upper * lower * np.cos(knee)) / (length * length)
        hip_rate = turn - slope * knee_rate
    walk.target[2 * k] = np.arctan2(-x, drop) - bend
    walk.target[2 * k + 1] = knee
    walk.rate[2 * k] = min(max(hip_rate, -MAX_JOINT_RATE), MAX_JOINT_RATE)
    walk.rate[2 * k + 1] = min(max(knee_rate, -MAX_JOINT_RATE), MAX_JOINT_RATE)
