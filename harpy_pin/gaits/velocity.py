"""The velocity that a walk follows: numbers that may change at any time, rows of a script, or a function of time."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.model.memory import KeepsViews, read_only
from harpy_pin.model.record import Records, field
from harpy_pin.model.state import Vector

__all__ = ["FollowsVelocity", "Velocity", "read_velocity"]

MAX_COMMAND = 1e6
"""Largest entry of a command: far beyond what is clipped, and far from numbers that overflow."""

Velocity = ArrayLike | Sequence[ArrayLike] | Callable[[float], ArrayLike]
"""(forward, to the left, turning[, height]); rows with a time before these; or a function from the time to these."""
Script = tuple[tuple[float, Vector], ...]
"""Rows (t, command), each valid from its time, s, on."""


class FollowsVelocity(KeepsViews):
    """A gait that follows a velocity command, which may change at every tick.

    Its record has the fields ``command``, ``velocity`` (the one that is applied), ``switch``, ``walking`` and
    ``refused``.
    """

    record: Records[Any]
    command: Vector
    applied: Vector
    script: Script

    def _follow(self, velocity: Velocity) -> tuple[Vector, ...]:
        """Take what is to be followed; returns the commands that are known beforehand.

        Raises:
            InputError: see :func:`read_velocity`.
        """
        self._given: Vector = field(self.record, "command")
        self._given[:], self.script, self._function = read_velocity(velocity, len(self._given))
        self.command = self._given if self._function is None else read_only(self._given)
        self.applied = read_only(field(self.record, "velocity"))
        return self._given.copy(), *(command for _, command in self.script)

    @property
    def walking(self) -> bool:
        """Whether it steps; otherwise it stands."""
        return bool(self.record["walking"][0])

    @property
    def refused(self) -> int:
        """Updates whose command was not finite, since the walk began."""
        return int(self.record["refused"][0])

    def _begin(self) -> None:
        """Go back to before the first row of the script."""
        self._row = 0
        self.record["switch"] = self.script[0][0] if self.script else inf
        if self.script:
            self.command[:] = 0.0

    def _take_row(self) -> None:
        """Command what the next row of the script says."""
        self.command[:] = self.script[self._row][1]
        self._row += 1
        self.record["switch"] = self.script[self._row][0] if self._row < len(self.script) else inf

    def _ask_function(self, t: float) -> None:
        """Command what the function says, if there is one; entries that are not finite are refused later, and counted.

        Raises:
            InputError: it returned no command.
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
        if array.dtype.kind not in "fiu" or array.ndim != 1 or not 3 <= len(array) <= len(self._given):
            message = f"the function of the velocity must return (forward, sideways, turning), got {given!r:.60}"
            raise InputError(message, name="velocity", value=given)
        self._given[: len(array)] = array
        self._given[len(array) :] = 0.0


def is_sequence(value: object) -> bool:
    """Whether a value has entries, as a list or an array has; text has none."""
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def read_velocity(velocity: Velocity, entries: int) -> tuple[Vector, Script, Callable[[float], ArrayLike] | None]:
    """What is given, in three forms.

    Args:
        velocity: see :data:`Velocity`.
        entries: of a command: 3, or 4 with the change of the height, m, which may be left out.

    Returns:
        The command at first, zero where rows or a function follow; the rows of a script; the function.

    Raises:
        InputError: it is none of the three, a number is not finite or beyond 1e6, or the times of the rows do not grow
            from zero or later.
    """
    if callable(velocity):
        return np.zeros(entries), (), velocity
    if not is_sequence(velocity):
        raise InputError(f"velocity must be numbers, rows or a function, got {shown(velocity)}", name="velocity")
    rows: Any = velocity
    if not len(rows) or not (is_sequence(rows[0]) or isinstance(rows[0], Mapping)):
        return _as_command(rows, entries), (), None
    script: list[tuple[float, Vector]] = []
    for row in rows:
        if not is_sequence(row) or not 4 <= len(row) <= 1 + entries:
            form = "(t, forward, sideways, turning" + (", height)" if entries == 4 else ")")
            raise InputError(f"a row of the velocity must be {form}, got {shown(row)}", name="velocity", value=row)
        t = checks.number("time of a row of the velocity", row[0], low=0.0)
        if script and t <= script[-1][0]:
            raise InputError(f"the times of the velocity's rows must grow, got {t:g} s", name="velocity", value=t)
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


ROUNDING = 1e-9
"""Relative; a gait at its largest speed is not warned of."""
WRAPPERS = ("harpy_pin.arguments", "harpy_pin.model.memory")
"""Modules that stand between the making of a gait and whoever makes it."""


def warn_of_capped(
    commands: Iterable[Sequence[float] | Vector],
    *,
    speed: float,
    radius: float,
    sideways: float,
    turn: float,
    bend: float = inf,
) -> None:
    """Warn, in one line, of the first command that is beyond the limits.

    Args:
        commands: (forward, to the left, turning), in m/s and rad/s; entries behind these are left alone.
        speed: largest velocity of a foot's place, m/s.
        radius: distance of the farthest foot's place from the middle, m.
        sideways: largest velocity to the side, m/s.
        turn: largest turning velocity, rad/s.
        bend: largest product of velocity and turning velocity, m/s²: by which the velocity changes in a turn.
    """
    for command in commands:
        forward, left, turning = (float(entry) for entry in command[:3])
        need = np.hypot(forward, left) + abs(turning) * radius
        pairs = ((speed, need), (sideways, abs(left)), (turn, abs(turning)))
        share = min(most / asked if asked > most else 1.0 for most, asked in pairs)
        bends = np.hypot(forward, left) * abs(turning)
        if share * share * bends > bend:
            share = float(np.sqrt(bend / bends))
        if share < 1.0 - ROUNDING:
            given, limited = (f"({f * forward:.3g}, {f * left:.3g}, {f * turning:.3g})" for f in (1.0, share))
            message = f"velocity {given} is more than the robot walks: limited to {limited} (m/s, m/s, rad/s)"
            level, frame = 3, sys._getframe(2)
            while frame.f_back is not None and frame.f_globals.get("__name__") in WRAPPERS:
                level, frame = level + 1, frame.f_back
            warnings.warn(message, stacklevel=level)  # whoever made the gait
            return
