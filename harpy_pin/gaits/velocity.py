"""The velocity that a walk follows: numbers that may change at any time, rows of a script, or a
function of time.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.gait import LONGEST, Gait, GaitTarget, refuse_time
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.kernels.record_view import read_only
from harpy_pin.model.record import RecordOf, Records, field, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane

LONGEST_GAP = 1e3
"""Longest time from one update to the next of a walk that goes by the clock, s."""
MAX_COMMAND = 1e6
"""Largest entry of a command: far beyond what is clipped, and far from numbers that overflow."""

Velocity = ArrayLike | Sequence[ArrayLike] | Callable[[float], ArrayLike]
"""(forward, to the left, turning[, height]); rows with a time before these; or a function from the
time to these.
"""
Script = tuple[tuple[float, Vector], ...]
"""Rows (t, command), each valid from its time, s, on."""
ROUNDING = 1e-9
"""Relative; a gait at its largest speed is not warned of."""
WRAPPERS = ("harpy_pin.arguments", "harpy_pin.model.memory", "harpy_pin.gaits")
"""Modules that stand between the making of a gait and whoever makes it."""


class VelocityRecord(RecordOf):
    """The velocity that a gait follows, (forward, to the left, turning[, height]), in m/s, rad/s
    and m.
    """

    radius: float  # distance of the farthest foot's place from the middle, m
    max_speed: float  # largest velocity of a foot's place, m/s
    max_aside: float  # largest velocity sideways, m/s
    max_turn: float  # largest turning velocity, rad/s
    # largest product of velocity and turning velocity, m/s²: by which the velocity changes in a
    # turn
    max_bend: float
    command: Vector = sized("entries")  # given
    last_command: Vector = sized("entries")  # the last one that is all numbers
    goal: Vector = sized("entries")  # the command within the limits
    velocity: Vector = sized("entries")  # that is applied, of the height m/s
    rate: Vector = sized(3)  # of the first three, m/s² and rad/s²
    path: Vector = sized(3)  # x, y (m) and heading (rad) of the place that the walk goes about
    switch: float = inf  # when the next row of the script begins, s
    scripted: int = 0  # whether there is one
    refused: float = 0.0  # updates with a command that was not all numbers


class FollowsVelocity(Gait):
    """A gait that follows a velocity command, which may change at every tick.

    What it follows is in a :class:`VelocityRecord`.
    """

    _record_: Records[Any]
    _followed: Records[VelocityRecord]
    _steps: Records[Any]
    _advance: ClassVar[Kernel[bool]]
    command: Vector
    applied: Vector
    script: Script
    limited_by = ""

    def update(self, t: float) -> GaitTarget:
        """See :meth:`~harpy_pin.gaits.gait.Gait.update`; time zero, or one more than a step before
        the last, begins the walk anew.

        Raises:
            InputError: t is not finite or beyond 1e9 s, the function of the velocity returned no
                command, or, where the walk goes by the clock, t is more than 1000 s after the last.
        """
        if type(t) is not float:
            t = checks.number("t", t)
        if not abs(t) < LONGEST:
            raise refuse_time(t)
        if t <= 0.0 or t < self._time[0] - self.step_duration:
            self._begin()
        while t >= self._switch[0]:
            self._take_row()
        self._ask_function(t)
        self._go_on(t)
        return self.target

    def _go_on(self, t: float) -> None:
        """The targets at a time at or before the next row of the script."""
        if not self._advance(t, self._record_, self.target._record_):
            raise InputError(
                f"the gait's time must be within {LONGEST_GAP:g} s of the last, "
                f"{self._time[0]:g} s; got {t:g} s",
                name="t",
                value=t,
            )

    def _follow(
        self, velocity: Velocity, record: Records[VelocityRecord], steps: Records[Any]
    ) -> None:
        """Take what is to be followed; warn, in one line, of the first command beyond the limits of
        its record. The record of the steps has ``walking``.
        """
        self._followed, self._steps = record, steps
        self._time: Vector = self._record_["time"]
        self._switch: Vector = record["switch"]
        self._given: Vector = field(record, "command")
        self._given[:], self.script, self._function = read_velocity(velocity, len(self._given))
        record["scripted"] = bool(self.script)
        self.command = self._given if self._function is None else read_only(self._given)
        self.applied = read_only(field(self._followed, "velocity"))
        for command in (self._given, *(command for _, command in self.script)):
            share = share_in_limits(self._followed, command)
            if share < 1.0 - ROUNDING:
                given, limited = (
                    "({:.3g}, {:.3g}, {:.3g})".format(*(f * command[:3])) for f in (1.0, share)
                )
                message = (
                    f"velocity {given} is more than the robot walks: limited to {limited} "
                    f"(m/s, m/s, rad/s)"
                )
                if (
                    self.limited_by
                    and foot_speed(self._followed, command) > self._followed["max_speed"][0]
                ):
                    message += f" by {self.limited_by}"
                warn_maker(message)
                break

    @property
    def walking(self) -> bool:
        """Whether it steps; otherwise it stands."""
        return bool(self._steps["walking"][0])

    @property
    def refused(self) -> int:
        """Updates whose command was not finite, since the walk began."""
        return int(self._followed["refused"][0])

    def _begin(self) -> None:
        """Go back to before the first row of the script."""
        self._row = 0
        self._switch[0] = self.script[0][0] if self.script else inf
        if self.script:
            self.command[:] = 0.0

    def _take_row(self) -> None:
        """Command what the next row of the script says."""
        self.command[:] = self.script[self._row][1]
        self._row += 1
        self._switch[0] = self.script[self._row][0] if self._row < len(self.script) else inf

    def _ask_function(self, t: float) -> None:
        """Command what the function says, if there is one; an entry that is not finite is later
        refused and counted.
        """
        if self._function is None:
            return
        given = self._function(t)
        try:
            array = np.asarray(given)
            if array.dtype.kind == "O":
                array = array.astype(np.float64)
        except (TypeError, ValueError, OverflowError):
            array = np.empty(0)
        if (
            array.dtype.kind not in "fiu"
            or array.ndim != 1
            or not 3 <= len(array) <= len(self._given)
        ):
            raise InputError(
                f"the function of the velocity must return (forward, sideways, turning), got "
                f"{given!r:.60}",
                name="velocity",
                value=given,
            )
        self._given[: len(array)] = array
        self._given[len(array) :] = 0.0


def largest(fits: Callable[[float], bool], high: float, *, halvings: int) -> float:
    """Largest number up to ``high`` that fits, where all smaller ones do; zero where none does."""
    if fits(high):
        return high
    low = 0.0
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if fits(middle) else (low, middle)
    return low


def warn_maker(message: str) -> None:
    """Warn whoever made a gait."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and str(frame.f_globals.get("__name__")).startswith(WRAPPERS):
        level, frame = level + 1, frame.f_back
    warnings.warn(message, stacklevel=level)


def is_sequence(value: object) -> bool:
    """Whether a value has entries, as a list or an array has; text has none."""
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def read_velocity(
    velocity: Velocity, entries: int
) -> tuple[Vector, Script, Callable[[float], ArrayLike] | None]:
    """What is given, in three forms.

    Args:
        velocity: see :data:`Velocity`.
        entries: of a command: 3, or 4 with the change of the height, m, which may be left out.

    Returns:
        The command at first, zero where rows or a function follow; the rows of a script; the
        function.

    Raises:
        InputError: it is none of the three, a number is not finite or beyond 1e6, or the times of
            the rows do not grow from zero or later.
    """
    if callable(velocity):
        return np.zeros(entries), (), velocity
    if not is_sequence(velocity):
        raise InputError(
            f"velocity must be numbers, rows or a function, got {shown(velocity)}", name="velocity"
        )
    rows: Any = velocity
    if not len(rows) or not (is_sequence(rows[0]) or isinstance(rows[0], Mapping)):
        return _as_command(rows, entries), (), None
    script: list[tuple[float, Vector]] = []
    for row in rows:
        if not is_sequence(row) or not 4 <= len(row) <= 1 + entries:
            form = "(t, forward, sideways, turning" + (", height)" if entries == 4 else ")")
            raise InputError(
                f"a row of the velocity must be {form}, got {shown(row)}",
                name="velocity",
                value=row,
            )
        t = checks.number("time of a row of the velocity", row[0], low=0.0)
        if script and t <= script[-1][0]:
            raise InputError(
                f"the times of the velocity's rows must grow, got {t:g} s", name="velocity", value=t
            )
        script.append((t, _as_command(row[1:], entries)))
    return np.zeros(entries), tuple(script), None


def _as_command(value: ArrayLike, entries: int) -> Vector:
    """A command of three numbers or of all entries, as a new array."""
    given = np.asarray(value, dtype=object)
    size = entries if given.shape == (entries,) else 3
    command = np.zeros(entries)
    command[:size] = checks.vector("velocity", value, size)
    for entry in command.tolist():
        checks.number("velocity", entry, low=-MAX_COMMAND, high=MAX_COMMAND)
    return command


@kernel
def take_command(p: VelocityRecord) -> None:
    """The command as the goal of the velocity, scaled down as a whole to what the legs can do and
    may do.
    """
    if np.isfinite(np.sum(p.command)):
        p.last_command[:] = p.command
    else:
        p.refused += 1.0
    p.goal[:3] = share_in_limits(p, p.last_command) * p.last_command[:3]


@kernel
def move_path(path: Vector, velocity: Vector, step: float) -> None:
    """Place and heading of the path go on for a time at one velocity."""
    path[:2] += step * (rotation_in_plane(path[2] + 0.5 * step * velocity[2]) @ velocity[:2])
    path[2] += step * velocity[2]


@kernel
def share_in_limits(p: VelocityRecord, c: Vector) -> float:
    """Largest share of a command, at most all of it, that is within every limit."""
    share, need, bend = 1.0, foot_speed(p, c), np.hypot(c[0], c[1]) * abs(c[2])
    if need > p.max_speed:
        share = p.max_speed / need
    if share * abs(c[1]) > p.max_aside:
        share = p.max_aside / abs(c[1])
    if share * abs(c[2]) > p.max_turn:
        share = p.max_turn / abs(c[2])
    if share * share * bend > p.max_bend:
        share = np.sqrt(p.max_bend / bend)
    return float(share)


@kernel
def foot_speed(p: VelocityRecord, c: Vector) -> float:
    """Speed of the fastest place of a foot under a command, m/s."""
    return float(np.hypot(c[0], c[1]) + abs(c[2]) * p.radius)


@kernel
def is_still(p: VelocityRecord) -> bool:
    """Whether nothing is commanded, and nothing applied."""
    still: bool = np.sum(abs(p.goal[:3]) + abs(p.velocity[:3])) == 0.0
    return still
