"""Where a foot can be set: away from edges, because the friction cone about the normal of a riser holds nothing."""

from __future__ import annotations

from harpy_pin.compiled import kernel
from harpy_pin.ground.surface import TerrainRecord, surface_height

__all__: list[str] = []

STEEP = 1.0
"""Rise per metre from which on ground is too steep for a foot."""
MARGIN = 0.025
"""Distance that a foothold keeps from such ground, along x and y, m."""
RADIUS, SAMPLES = 0.152, 38
"""How far a foothold is moved at most in each of eight directions, m, and how many places are looked at."""


@kernel
def nearest_steppable(t: TerrainRecord, x: float, y: float, before_x: float, before_y: float) -> tuple[float, float]:
    """The place (x, y), or the best one around it where a foot can be set, near to (before_x, before_y), too.

    Where there is none it is the place itself.
    """
    if steppable(t, x, y):
        return x, y
    best, best_x, best_y = 1e9, x, y
    for i in range(-1, 2):
        for j in range(-1, 2):
            for n in range(1, SAMPLES + 1):
                dx, dy = i * n * RADIUS / SAMPLES, j * n * RADIUS / SAMPLES
                jump_x, jump_y = x + dx - before_x, y + dy - before_y
                cost = dx * dx + dy * dy + jump_x * jump_x + jump_y * jump_y
                if cost < best and steppable(t, x + dx, y + dy):
                    best, best_x, best_y = cost, x + dx, y + dy
    return best_x, best_y


@kernel
def steppable(t: TerrainRecord, x: float, y: float) -> bool:
    """Whether a place is as high as the ground around it along x and y, but for a slope."""
    height, most = surface_height(t, x, y), STEEP * MARGIN
    level = True
    for side in (-MARGIN, MARGIN):
        level = level and abs(surface_height(t, x + side, y) - height) < most
        level = level and abs(surface_height(t, x, y + side) - height) < most
    return level
