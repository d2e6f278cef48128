"""Whether the robot stands, fell, or diverged."""

from __future__ import annotations

from harpy_pin.compiled import kernel
from harpy_pin.ground.surface import TerrainRecord, surface_height
from harpy_pin.model.state import Vector

__all__ = ["VERDICTS", "stands", "upright"]

VERDICTS = ("completed", "fell", "diverged")
"""How a run ends, by what the kernels say."""


@kernel
def stands(terrain: TerrainRecord, q: Vector, v: Vector, fall_height: float) -> int:
    """:func:`upright`, with the height above the ground below the body."""
    return upright(q, v, fall_height + surface_height(terrain, q[0], q[1]))


@kernel
def upright(q: Vector, v: Vector, fall_height: float) -> int:
    """0 for a body that stands, 1 for one that fell, 2 for one whose velocity is beyond reason or no number."""
    speed = 0.0
    for i in range(v.shape[0]):
        speed += abs(v[i])
    if not speed <= 1e4:
        return 2
    return 1 if q[2] < fall_height or 1.0 - 2.0 * (q[3] * q[3] + q[4] * q[4]) < 0.5 else 0
