"""In which order feet step, by the name of the schedule."""

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.state import Vector

Steps = tuple[tuple[str, ...], ...]
BY_FEET: dict[int, dict[str, Steps]] = {
    2: {"walk": (("left",), ("right",)), "step": (("left",), ("right",))},
    4: {
        "trot": (("left front", "right hind"), ("right front", "left hind")),
        "crawl": (("left hind",), ("left front",), ("right hind",), ("right front",)),
        "pace": (("left front", "left hind"), ("right front", "right hind")),
        "bound": (("left front", "right front"), ("left hind", "right hind")),
    },
    6: {
        "tripod": (
            ("left front", "right middle", "left hind"),
            ("right front", "left middle", "right hind"),
        )
    },
}
"""Feet that swing together, step after step, by the number of feet and the name of the schedule;
the first one is the default. ``step`` goes on stepping where it stands.
"""
SCHEDULES = tuple(name for schedules in BY_FEET.values() for name in schedules)
"""Their names."""
ROWS = {1: ("",), 2: (" front", " hind"), 3: (" front", " middle", " hind")}
"""What the feet of a side are called, from the front on."""


def groups_of(schedule: str, places: Vector) -> NDArray[np.int64]:
    """(feet,) the step of the cycle in which each foot swings.

    Args:
        schedule: a name of :data:`BY_FEET`, or ``stand``.
        places: (feet, 2) of the feet about their middle, x forward and y to the left, m.

    Raises:
        InputError: an unknown name, one for another number of feet, or not as many feet on the left
            as on the right.
    """
    known = BY_FEET.get(len(places), {})
    checks.one_of("schedule", schedule, ("stand", *known))
    if schedule == "stand":
        return np.zeros(len(places), dtype=np.int64)
    left, names = places[:, 1] > 0.0, [""] * len(places)
    if 2 * left.sum() != len(places):
        raise InputError(
            f"half of the feet must be on the left, got {left.sum()} of {len(places)}", name="robot"
        )
    for side, feet in (("left", np.flatnonzero(left)), ("right", np.flatnonzero(~left))):
        for k, row in zip(feet[np.argsort(-places[feet, 0])], ROWS[len(feet)], strict=True):
            names[k] = side + row
    steps = known[schedule]
    return np.array(
        [next(g for g, feet in enumerate(steps) if name in feet) for name in names], dtype=np.int64
    )


def draw_together(places: Vector, group: NDArray[np.int64], most: float) -> float:
    """Move two groups of feet, 0 and 1, in place, until their middles are apart by ``most`` at
    most.

    The places are (feet, 2), about their common middle. Returns the distance of the two middles
    then.
    """
    middles = [places[group == g].mean(axis=0) for g in range(2)]
    apart = float(np.linalg.norm(middles[1] - middles[0]))
    share = max(1.0 - most / apart, 0.0) if apart > 0.0 else 0.0
    for g in range(2):
        places[group == g] -= share * middles[g]
    return (1.0 - share) * apart
