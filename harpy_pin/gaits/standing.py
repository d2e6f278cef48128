"""Gaits that stay in one place: standing on every foot, and hovering without any; the body's weight
may be shifted.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.gaits.fitting import standing_parameters
from harpy_pin.gaits.gait import LONGEST, ClockGait, GaitTargetRecord
from harpy_pin.gaits.swing import toward
from harpy_pin.kernels import kernel
from harpy_pin.model.posed import Posed
from harpy_pin.model.posture import LEVEL, find_posture
from harpy_pin.model.record import RecordOf, field, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

SHORTEST = 1e-6
"""Duration of a move, s."""
ROUNDING = 1e-6
"""By how much an angle may be beyond its limit, rad: files and postures have rounded numbers."""


class StayingRecord(RecordOf):
    """What :class:`Staying` knows."""

    feet: Vector  # (feet, 3) places of the feet about the body's origin, world axes, m
    height: float  # of the body, m
    facing: float  # of the robot, rad
    shift: Vector  # (3,) how far the body goes, world axes, m
    shift_period: float  # there and back, s
    penetration_offset: float  # how much deeper than the ground an unloaded foot aims, m
    begin: float = 0.0  # of the last move, s
    duration: float = 0.0  # of it, s
    start: Vector = sized(3, 3)  # position, velocity and acceleration of the offset then, m and s
    end: Vector = sized(3)  # offset at which it comes to rest, m


@kernel(out=(3, 3))
def _offset(t: float, p: StayingRecord, out: Vector) -> None:
    """Offset that was asked for: (3, 3) position, velocity and acceleration; at rest before and
    after the way.
    """
    for i in range(3):
        out[:, i] = toward(*p.start[:, i], p.end[i], p.duration, max(t - p.begin, 0.0))
    if t < p.begin:
        out[1:] = 0.0


@kernel
def _stay(t: float, p: StayingRecord, o: GaitTargetRecord) -> bool:
    """All targets at time t, of a robot with any number of feet or none; returns whether it is
    one.
    """
    if not abs(t) < LONGEST:
        return False
    rate = 2.0 * np.pi / p.shift_period
    c, s = np.cos(rate * t), np.sin(rate * t)
    _offset(t, p, o.body.reshape((3, 3)))
    o.body[:3] += 0.5 * (1.0 - c) * p.shift
    o.body[3:6] += 0.5 * rate * s * p.shift
    o.body[6:] += 0.5 * rate**2 * c * p.shift
    o.foot_position[:] = p.feet - o.body[:3]
    o.foot_velocity[:] = -o.body[3:6]
    o.foot_acceleration[:] = -o.body[6:]
    o.body[2] += p.height
    o.heading[0] = -p.facing
    o.foot_position[:, 2] -= p.penetration_offset
    o.stance[:] = 1.0
    o.phase[:] = 0.5
    return True


class Staying(ClockGait):
    """Targets of a robot whose feet, if it has any, stay where they are.

    The body's target goes from its place to ``shift`` and back, over and over, smoothly and from
    rest. At any time :meth:`move` sends it elsewhere. Nothing else changes it: the copies that
    controllers take move with it.

    Attributes:
        step_duration: one second, so that measures per step are per second.
        double_support: 1, always.
    """

    _kernel = _stay
    double_support = 1.0
    walks = False

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
        super().__init__(robot)
        self.controller_parameters = standing_parameters(robot)
        self._q = q
        self._record = make_record(
            StayingRecord,
            feet=feet,
            height=float(q[2]),
            facing=robot.facing,
            shift=checks.vector("shift", shift, 3),
            shift_period=checks.number("shift_period", shift_period, low=0.0, strict=True),
            penetration_offset=checks.number("penetration_offset", penetration_offset, low=0.0),
        )
        _stay.prepare(0.0, self._record, self.target._record_)

    def move(self, offset: ArrayLike, *, t: float, duration: float = 1.0) -> None:
        """Send the body to another place, from the time t on; it gets there at rest, and stays.

        The way is a polynomial of fifth order, which takes up position, velocity and acceleration
        of the way before: a move may begin while another goes on.

        Args:
            offset: (3,) from where the posture has the body, world axes, m; what ``shift`` does
                comes on top.
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
        for name, value in (("begin", begin), ("duration", length), ("start", start), ("end", end)):
            self._record[name][0] = value

    @checked
    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`~harpy_pin.gaits.gait.Gait.initial_state`."""
        q = self._q.copy()
        q[2] -= penetration
        return q, np.zeros(self.robot.nv)

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        return {
            "posture": self._q[7:].tolist(),
            "height": float(self._q[2]),
            "shift": field(self._record, "shift").tolist(),
            "shift_period": float(self._record["shift_period"][0]),
            "penetration_offset": float(self._record["penetration_offset"][0]),
            "step_duration": self.step_duration,
        }


class Standing(Staying, constant=True):
    """Targets of a robot that stands upright on all its feet, where a posture of its joints puts
    them.

    The body's target goes from its place to ``shift`` and back, over and over, smoothly and from
    rest. At any time :meth:`move` sends it elsewhere, such as over one foot (:meth:`over`).

    Args:
        robot: any robot with feet, points or flat feet.
        posture: (joints,) angles, rad; by default as
            :func:`harpy_pin.model.posture.find_posture` says.
        shift: (3,) how far the body goes, world axes, m.
        shift_period: there and back, s.
        penetration_offset: how much deeper than the ground an unloaded foot aims, m: without it
            such a foot would come to rest just above the ground and never be held.

    Raises:
        InputError: values out of their domains, no posture given where none is found, or a posture
            beyond the joints' limits, or whose feet are not on one level below the body.
    """

    def __init__(
        self,
        robot: Robot,
        posture: ArrayLike | None = None,
        *,
        shift: ArrayLike = (0.0, 0.0, 0.0),
        shift_period: float = 2.0,
        penetration_offset: float = 0.005,
    ) -> None:
        checks.instance("robot", robot, Robot)
        if not robot.feet:
            raise InputError(
                f"'{robot.name}' has no foot to stand on: hp.Hovering is for robots that fly",
                name="robot",
            )
        posture = find_posture(robot) if posture is None else posture
        q = robot.neutral
        q[5:7] = 0.0 - np.sin(0.5 * robot.facing), np.cos(0.5 * robot.facing)
        q[7:] = read_posture(robot, posture)
        posed = Posed(robot, q)
        feet = np.array([posed.frame(name).translation for name in robot.feet])
        if np.ptp(feet[:, 2]) > LEVEL or feet[:, 2].max() >= 0.0:
            heights = ", ".join(
                f"{name} {z:.3f} m" for name, z in zip(robot.feet, feet[:, 2], strict=True)
            )
            raise InputError(
                f"this posture's feet are not on one level below the body: {heights}",
                name="posture",
            )
        self._centre = posed.centre
        q[2] = -float(feet[:, 2].min())
        super().__init__(
            robot,
            q,
            feet,
            shift=shift,
            shift_period=shift_period,
            penetration_offset=penetration_offset,
        )

    def over(self, *feet: int) -> Vector:
        """Where the body has to move for the centre of mass to be above the middle of some feet.

        Args:
            feet: their numbers, in the order of :attr:`~harpy_pin.model.robot.Robot.corners`: a
                flat foot counts as one.

        Returns:
            (3,) offset for :meth:`move`, horizontal, m. The legs that stay behind are left out, so
            the centre of mass does not come all the way.

        Raises:
            InputError: no foot, or one that there is not.
        """
        corners = self.robot.corners
        for foot in feet:
            checks.whole("foot", foot, low=0)
        if not feet or max(feet) >= len(corners):
            raise InputError(
                f"'{self.robot.name}' has feet 0 to {len(corners) - 1}, got {feet}", name="feet"
            )
        starts = np.cumsum((0, *corners))
        points = field(self._record, "feet")
        middles = [points[starts[foot] : starts[foot + 1]].mean(axis=0) for foot in feet]
        offset: Vector = np.mean(middles, axis=0) - self._centre
        offset[2] = 0.0
        return offset


class Hovering(Staying, constant=True):
    """Targets of a robot that hovers above the world's origin and faces x.

    The body's target goes from its place to ``shift`` and back, over and over, smoothly and from
    rest. At any time :meth:`move` sends it elsewhere. It is upright; the whole-body controllers
    lean a robot that has to (:mod:`harpy_pin.controllers.tasks`).

    Args:
        robot: one without feet.
        posture: (joints,) angles, rad; by default the robot's own, or zero where it has none.
        height: of the body's origin, m; a run counts as a fall at 60 % of it.
        shift: (3,) how far the body goes, world axes, m.
        shift_period: there and back, s.

    Raises:
        InputError: values out of their domains, or a robot with feet.
    """

    def __init__(
        self,
        robot: Robot,
        posture: ArrayLike | None = None,
        *,
        height: float = 1.0,
        shift: ArrayLike = (0.0, 0.0, 0.0),
        shift_period: float = 2.0,
    ) -> None:
        checks.instance("robot", robot, Robot)
        if robot.feet:
            raise InputError(
                f"'{robot.name}' has feet: hp.Standing is for robots that stand", name="robot"
            )
        if posture is None:
            posture = robot.posture
        q = robot.neutral
        q[2] = checks.number("height", height, low=0.0, strict=True)
        if posture is not None:
            q[7:] = read_posture(robot, posture)
        super().__init__(robot, q, np.zeros((0, 3)), shift=shift, shift_period=shift_period)


def read_posture(robot: Robot, posture: ArrayLike) -> Vector:
    """(joints,) angles of a posture, rad.

    Args:
        robot: whose posture it is. A joint whose limits leave no range, as where the file names
            none, is free.
        posture: angles in the order of the robot's joints, rad.

    Raises:
        InputError: wrong shape, not finite, or an angle beyond the limits of its joint; the message
            names them.
    """
    angles = checks.vector("posture", posture, len(robot.joints))
    lower, upper = robot.joint_lower, robot.joint_upper
    beyond = (lower < upper) & ((angles < lower - ROUNDING) | (angles > upper + ROUNDING))
    for k in np.flatnonzero(beyond):
        limits = f"{lower[k]:g} to {upper[k]:g} rad"
        raise InputError(
            f"posture: joint '{robot.joints[k]}' is at {angles[k]:g} rad, beyond its limits "
            f"{limits}",
            name="posture",
            value=posture,
        )
    return angles
