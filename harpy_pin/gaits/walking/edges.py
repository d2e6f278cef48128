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
RADIUS, SAMPLES = 0.12, 6
"""How far a foothold is moved at most along x and y, m, and at how many places on each side."""


@kernel
def keep_off_edges(p: WalkingRecord, k: int, before_x: float, before_y: float) -> None:
    """Move a foothold to a place that carries a foot, where there is one near: near to it, and to the one before.

    So a foothold does not change sides of an edge in the last moment.

    Args:
        p: element of the gait's record.
        k: the foot.
        before_x: foothold of the tick before, m.
        before_y: likewise.
    """
    x, y = p.foothold[k, 0], p.foothold[k, 1]
    if carries(p.terrain, x, y):
        return
    best = 1e9
    for i in range(-SAMPLES, SAMPLES + 1):
        for j in range(-SAMPLES, SAMPLES + 1):
            dx, dy = i * RADIUS / SAMPLES, j * RADIUS / SAMPLES
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
