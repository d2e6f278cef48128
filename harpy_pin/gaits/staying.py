"""Gaits that stay in one place: what standing and hovering share, the body's path."""

from __future__ import annotations

from math import perm

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.compiled.calls import Call
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import LONGEST, GaitTarget, GaitTargetRecord, refuse_time
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.record import RecordOf, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector

__all__ = ["Staying"]

SHORTEST = 1e-6
"""Of a way, s."""
DEGREE = 5
"""Of the polynomials of :meth:`Staying.move`."""


class StayingRecord(RecordOf):
    """What :class:`Staying` knows."""

    feet: Vector  # (feet, 3) places of the feet about the body's origin, world axes, m
    height: float  # of the body, m
    shift: Vector  # (3,) how far the body goes, world axes, m
    shift_period: float  # there and back, s
    penetration_offset: float  # how much deeper than the ground an unloaded foot aims, m
    begin: float = 0.0  # of the last move, s
    duration: float = 0.0  # of it, s
    way: Vector = sized(DEGREE + 1, 3)  # coefficients of the offset's polynomial in the time since its begin


class Staying(KeepsViews):
    """Targets of a robot whose feet, if it has any, stay where they are.

    The body's target goes from its place to ``shift`` and back, over and over, smoothly and from rest. At any time
    :meth:`move` sends it elsewhere.

    Args:
        robot: who stays.
        q: (nq,) configuration at rest; its third number is the height of the body's origin.
        feet: (feet, 3) places of the feet about the body's origin, world axes, m.
        shift: (3,) how far the body goes, world axes, m.
        shift_period: there and back, s.
        penetration_offset: how much deeper than the ground an unloaded foot aims, m.

    Attributes:
        step_duration: one second, so that measures per step are per second.
        double_support: 1, always.

    Raises:
        InputError: values out of their domains.
    """

    def __init__(
        self,
        robot: Robot,
        q: Vector,
        feet: Vector,
        *,
        shift: ArrayLike,
        shift_period: float,
        penetration_offset: float = 0.0,
    ) -> None:
        self.robot = robot
        self.step_duration, self.double_support = 1.0, 1.0
        self._q = q
        self._record = make_record(
            StayingRecord,
            feet=feet,
            height=float(q[2]),
            shift=checks.vector("shift", shift, 3),
            shift_period=checks.number("shift_period", shift_period, low=0.0, strict=True),
            penetration_offset=checks.number("penetration_offset", penetration_offset, low=0.0),
        )
        self.target = GaitTarget(len(feet))
        _stay.prepare(0.0, self._record, self.target.record)

    def move(self, offset: ArrayLike, *, t: float, duration: float = 1.0) -> None:
        """Send the body to another place, from the time t on; it gets there at rest, and stays.

        The way is a polynomial of fifth order, which takes up position, velocity and acceleration of the way before: a
        move may begin while another goes on.

        Args:
            offset: (3,) from where the posture has the body, world axes, m; what ``shift`` does comes on top.
            t: when it begins, s.
            duration: of the way, s, from a microsecond to 1e9 s.

        Raises:
            InputError: values out of their domains.
        """
        end = checks.vector("offset", offset, 3)
        begin = checks.number("t", t, low=0.0, high=LONGEST)
        length = checks.number("duration", duration, low=SHORTEST, high=LONGEST)
        start = np.zeros((3, 3))
        _offset(begin, self._record, start)
        way = np.zeros((DEGREE + 1, 3))
        way[:3] = start / np.array([[1.0], [1.0], [2.0]])
        # Rest at the end: position, velocity and acceleration by the three highest coefficients.
        powers = np.array([[perm(n, d) * length ** (n - d) for n in range(3, DEGREE + 1)] for d in range(3)])
        low = np.array([way[0] + (way[1] + way[2] * length) * length, way[1] + 2.0 * way[2] * length, 2.0 * way[2]])
        way[3:] = np.linalg.solve(powers, np.array([end, np.zeros(3), np.zeros(3)]) - low)
        self._record["way"][0] = way
        self._record["begin"][0], self._record["duration"][0] = begin, length

    def __repr__(self) -> str:
        return f"{type(self).__name__}('{self.robot.name}')"

    def update(self, t: float) -> GaitTarget:
        """See :meth:`~harpy_pin.gaits.gait.Gait.update`; an InputError where t is not finite, or beyond 1e9 s."""
        try:
            known = _stay(t, self._record, self.target.record)
        except TypeError:
            raise refuse_time(t) from None
        if not known:
            raise refuse_time(t)
        return self.target

    def calls(self, state: State) -> tuple[Call, ...]:
        """See :class:`~harpy_pin.gaits.gait.Gait`."""
        return (Call(_stay, 0.0, self._record, self.target.record, expected=True),)

    @checked
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`."""
        q = self._q.copy()
        q[2] -= penetration
        return q, np.zeros(self.robot.model.nv)


@kernel
def _offset(t: float, p: StayingRecord, out: Vector) -> None:
    """Offset that was asked for: (3, 3) position, velocity and acceleration; at rest before and after the way."""
    s = min(max(t - p.begin, 0.0), p.duration)
    moving = 0.0 <= t - p.begin < p.duration
    for i in range(3):
        position = velocity = acceleration = 0.0
        for n in range(p.way.shape[0] - 1, -1, -1):
            acceleration = acceleration * s + 2.0 * velocity
            velocity = velocity * s + position
            position = position * s + p.way[n, i]
        out[0, i] = position
        out[1, i] = velocity if moving else 0.0
        out[2, i] = acceleration if moving else 0.0


@kernel
def _stay(t: float, p: StayingRecord, o: GaitTargetRecord) -> bool:
    """All targets at time t, of a robot with any number of feet or none; returns whether it is one."""
    if not abs(t) < LONGEST:
        return False
    rate = 2.0 * np.pi / p.shift_period
    share, speed = 0.5 - 0.5 * np.cos(rate * t), 0.5 * rate * np.sin(rate * t)
    acceleration = 0.5 * rate * rate * np.cos(rate * t)
    _offset(t, p, o.body.reshape((3, 3)))
    for i in range(3):
        o.body[i] += share * p.shift[i]
        o.body[3 + i] += speed * p.shift[i]
        o.body[6 + i] += acceleration * p.shift[i]
        for k in range(o.stance.shape[0]):
            o.foot_position[k, i] = p.feet[k, i] - o.body[i]
            o.foot_velocity[k, i] = -o.body[3 + i]
            o.foot_acceleration[k, i] = -o.body[6 + i]
    o.body[2] += p.height
    for k in range(o.stance.shape[0]):
        o.foot_position[k, 2] -= p.penetration_offset
        o.stance[k], o.phase[k] = 1.0, 0.5
    return True


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
