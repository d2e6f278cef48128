"""Footholds away from edges: a foot that lands on a riser has a cone about a normal that carries nothing."""

from __future__ import annotations

from harpy_pin.compiled import kernel
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.simulation.terrain.surface import TerrainRecord, surface_height

__all__: list[str] = []

STEEP = 1.0
"""Rise per metre from which on ground carries no foot."""
MARGIN = 0.025
"""Distance that a foothold keeps from such ground, along x and y, m."""
RADIUS, SAMPLES = 0.1, 25
"""How far a foothold is moved at most in each of eight directions, m, and how many places are looked at."""


@kernel
def keep_off_edges(p: WalkingRecord, k: int, before_x: float, before_y: float, moving: bool) -> None:
    """Move a foothold to a place that carries a foot, where there is one near: near to it, and to the one before.

    A foot that is on its way does not change sides of an edge.

    Args:
        p: element of the gait's record.
        k: the foot.
        before_x: foothold of the tick before, m.
        before_y: likewise.
        moving: whether the foot is on its way.
    """
    x, y = p.foothold[k, 0], p.foothold[k, 1]
    if not carries(p.terrain, x, y):
        _find_near(p, k, before_x, before_y)
    jump = max(abs(p.foothold[k, 0] - before_x), abs(p.foothold[k, 1] - before_y))
    if moving and jump > 2.0 * MARGIN:
        p.foothold[k, 0], p.foothold[k, 1] = before_x, before_y


@kernel
def _find_near(p: WalkingRecord, k: int, before_x: float, before_y: float) -> None:
    """Move a foothold to the best place around it that carries a foot; it stays where there is none."""
    x, y, best = p.foothold[k, 0], p.foothold[k, 1], 1e9
    for i in range(-1, 2):
        for j in range(-1, 2):
            for n in range(1, SAMPLES + 1):
                dx, dy = i * n * RADIUS / SAMPLES, j * n * RADIUS / SAMPLES
                jump_x, jump_y = x + dx - before_x, y + dy - before_y
                cost = dx * dx + dy * dy + jump_x * jump_x + jump_y * jump_y
                if cost < best and carries(p.terrain, x + dx, y + dy):
                    best = cost
                    p.foothold[k, 0], p.foothold[k, 1] = x + dx, y + dy


@kernel
def keep_line(p: WalkingRecord, x: float, y: float) -> None:
    """Move both footholds of a group along y so that the line between them goes through its middle again.

    A foothold that is moved away from an edge turns that line, across which the robot is a pendulum.

    Args:
        p: element of the gait's record.
        x: of the middle, m.
        y: likewise.
    """
    first = second = -1
    for k in range(p.group.shape[0]):
        if p.group[k] == p.swings:
            first, second = second, k
    if first < 0:
        return
    along = p.foothold[second, 0] - p.foothold[first, 0]
    if abs(along) < 0.1 * p.height:
        return
    share = (x - p.foothold[first, 0]) / along
    aside = y - p.foothold[first, 1] - share * (p.foothold[second, 1] - p.foothold[first, 1])
    p.foothold[first, 1] += aside
    p.foothold[second, 1] += aside


@kernel
def carries(t: TerrainRecord, x: float, y: float) -> bool:
    """Whether the ground is as high at a place as around it, but for what a slope may be, along x and y."""
    height, most = surface_height(t, x, y), STEEP * MARGIN
    level = True
    for side in (-MARGIN, MARGIN):
        level = level and abs(surface_height(t, x + side, y) - height) < most
        level = level and abs(surface_height(t, x, y + side) - height) < most
    return level
