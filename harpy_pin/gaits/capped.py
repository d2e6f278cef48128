"""Says when a velocity is asked for that the legs cannot walk: gaits scale it down as a whole."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable, Sequence
from math import inf

import numpy as np

from harpy_pin.model.state import Vector

__all__: list[str] = []

ROUNDING = 1e-9
"""Relative; a gait at its largest speed is not warned of."""
WRAPPERS = ("harpy_pin.arguments", "harpy_pin.deprecated", "harpy_pin.model.memory")
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
