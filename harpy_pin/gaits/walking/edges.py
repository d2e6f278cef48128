"""Footholds away from edges: a foot that lands on a riser has a cone about a normal that carries nothing."""

from __future__ import annotations

from harpy_pin.compiled import kernel
from harpy_pin.gaits.carrying_places import MARGIN, carries, place_that_carries
from harpy_pin.gaits.walking.record import WalkingRecord

__all__: list[str] = []

SHARES = 10
"""Of the way along y that are tried among stones."""


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
    p.foothold[k, 0], p.foothold[k, 1] = place_that_carries(p.terrain, x, y, before_x, before_y)
    jump = max(abs(p.foothold[k, 0] - before_x), abs(p.foothold[k, 1] - before_y))
    if moving and jump > 2.0 * MARGIN:
        p.foothold[k, 0], p.foothold[k, 1] = before_x, before_y


@kernel
def keep_line(p: WalkingRecord, x: float, y: float) -> None:
    """Move both footholds of a group along y so that the line between them goes through its middle again.

    A foothold that is moved away from an edge turns that line, across which the robot is a pendulum. Among stones they
    go as far as both stay on stones.

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
    if p.terrain.stones[0] == 0.0:
        p.foothold[first, 1] += aside
        p.foothold[second, 1] += aside
        return
    for n in range(SHARES, 0, -1):
        way = n * aside / SHARES
        if _carries_beside(p, first, way) and _carries_beside(p, second, way):
            p.foothold[first, 1] += way
            p.foothold[second, 1] += way
            return


@kernel
def _carries_beside(p: WalkingRecord, k: int, way: float) -> bool:
    """Whether the ground carries at a distance from a foothold along y."""
    return carries(p.terrain, p.foothold[k, 0], p.foothold[k, 1] + way)
