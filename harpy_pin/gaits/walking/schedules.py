"""Contact schedules: which feet swing together, and in which order. A foot is left or right, front or hind by place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.state import Vector

__all__ = ["FOUR_FEET", "TWO_FEET", "groups_of"]

Steps = tuple[tuple[str, ...], ...]
FOUR_FEET: dict[str, Steps] = {
    "trot": (("left front", "right hind"), ("right front", "left hind")),
    "crawl": (("left hind",), ("left front",), ("right hind",), ("right front",)),
    "pace": (("left front", "left hind"), ("right front", "right hind")),
    "bound": (("left front", "right front"), ("left hind", "right hind")),
}
"""Feet of four-legged robots that swing together, step after step."""
TWO_FEET: dict[str, Steps] = {"walk": (("left",), ("right",)), "step": (("left",), ("right",))}
"""Feet of bipeds that swing, step after step; ``step`` goes on stepping where it stands."""
BY_FEET = {2: TWO_FEET, 4: FOUR_FEET}
"""By the number of feet."""


def groups_of(schedule: str, places: Vector) -> NDArray[np.int64]:
    """(feet,) the step of the cycle in which each foot swings.

    Args:
        schedule: a name of :data:`FOUR_FEET`, of :data:`TWO_FEET`, or ``stand``.
        places: (feet, 2) of the feet about their middle, x forward and y to the left, m.

    Raises:
        InputError: an unknown name, one for another number of feet, or two feet in the same quarter.
    """
    known = BY_FEET.get(len(places), {})
    checks.one_of("schedule", schedule, ("stand", *known))
    if schedule == "stand":
        return np.zeros(len(places), dtype=np.int64)
    names = []
    for x, y in places:
        side = "left" if y > 0.0 else "right"
        names.append(side if len(places) == 2 else f"{side} {'front' if x > 0.0 else 'hind'}")
    if len(set(names)) < len(names):
        raise InputError(f"the feet must be in different quarters about their middle, got {names}", name="robot")
    steps = known[schedule]
    return np.array([next(g for g, feet in enumerate(steps) if name in feet) for name in names], dtype=np.int64)
