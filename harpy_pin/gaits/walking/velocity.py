"""What a walk is told to do: one velocity, rows of a script, or a function of time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.commanded import MAX_COMMAND
from harpy_pin.model.state import Vector

__all__ = ["Velocity", "as_command", "read_velocity"]

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
