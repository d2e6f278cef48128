"""What a walk is told to do: one velocity, rows of a script, or a function of time."""

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
from harpy_pin.model.state import Vector

__all__ = ["Velocity", "as_command", "check_script", "read_velocity"]

MAX_COMMAND = 1e6
"""Largest entry of a command: far beyond what is clipped, and far from numbers that overflow."""

Velocity = ArrayLike | Sequence[ArrayLike] | Callable[[float], ArrayLike]
"""(forward, to the left, turning[, height]); rows with a time before these; or a function from the time to these."""
ENTRIES = (3, 4)
"""Of a command: forward, to the left (m/s), turning (rad/s), and where there are four the change of the height (m)."""


def as_command(value: ArrayLike) -> Vector:
    """(4,) command of three or four numbers.

    Raises:
        InputError: it has another number of entries, or one that is not finite or beyond 1e6.
    """
    given = np.asarray(value, dtype=object)
    size = given.size if given.ndim == 1 and given.size in ENTRIES else ENTRIES[0]
    command = np.zeros(4)
    command[:size] = checks.vector("velocity", value, size)
    for entry in command.tolist():
        checks.number("velocity", entry, low=-MAX_COMMAND, high=MAX_COMMAND)
    return command


def is_sequence(value: object) -> bool:
    """Whether a value has entries, as a list or an array has; text has none."""
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def read_velocity(
    velocity: Velocity,
) -> tuple[Vector, tuple[tuple[float, Vector], ...], Callable[[float], ArrayLike] | None]:
    """What is given, in three forms.

    Args:
        velocity: see :data:`Velocity`.

    Returns:
        The command at first, zero where rows or a function follow; the rows (t, command) of a script; the function.

    Raises:
        InputError: it is none of the three, or the times of the rows do not grow from zero or later.
    """
    if callable(velocity):
        return np.zeros(4), (), velocity
    if not is_sequence(velocity):
        raise InputError(f"velocity must be numbers, rows or a function, got {shown(velocity)}", name="velocity")
    rows: Any = velocity
    if not len(rows) or not (is_sequence(rows[0]) or isinstance(rows[0], Mapping)):
        return as_command(rows), (), None
    script: list[tuple[float, Vector]] = []
    last = -inf
    for row in rows:
        if not is_sequence(row) or len(row) - 1 not in ENTRIES:
            message = f"a row of the velocity must be (t, forward, sideways, turning[, height]), got {shown(row)}"
            raise InputError(message, name="velocity", value=row)
        t = checks.number("time of a row of the velocity", row[0], low=0.0)
        if t <= last:
            raise InputError(f"the times of the velocity's rows must grow, got {t:g} s", name="velocity", value=t)
        script.append((t, as_command(row[1:])))
        last = t
    return np.zeros(4), tuple(script), None


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


def check_script(script: Iterable[ArrayLike]) -> tuple[tuple[float, float, float, float], ...]:
    """A script of commands as rows (t, forward, sideways, turning), s, m/s and rad/s.

    Raises:
        InputError: a row has other than four finite numbers, or the times do not grow from zero or later.
    """
    if isinstance(script, str | type) or not isinstance(script, Iterable):
        raise InputError(
            f"a command must be rows of (t, forward, sideways, turning), got {shown(script)}", name="command"
        )
    rows: list[tuple[float, float, float, float]] = []
    for row in script:
        t, *velocity = checks.vector("row of the command", row, 4).tolist()
        for value in velocity:
            checks.number("command", value, low=-MAX_COMMAND, high=MAX_COMMAND)
        if t < 0.0 or (rows and t <= rows[-1][0]):
            raise InputError(f"the times of a command must grow from zero or later, got {t:g} s", name="command")
        rows.append((t, velocity[0], velocity[1], velocity[2]))
    return tuple(rows)


def three_numbers(given: ArrayLike) -> Vector:
    """What a function of the command returned; entries that are not finite are refused later, and counted.

    Raises:
        InputError: other than three numbers.
    """
    try:
        array = np.asarray(given)
        if array.dtype.kind == "O":
            array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape == (3,) and array.dtype.kind in "fiu":
        return array
    message = f"the function of the command must return (forward, sideways, turning), got {given!r:.60}"
    raise InputError(message, name="command", value=given)
