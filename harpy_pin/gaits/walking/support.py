"""The place of the centre of pressure nearest to a desired one, in the hull of the points of stance feet."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.gaits.walking.record import WalkingRecord

__all__: list[str] = []

SAME = 1e-6
"""Distance below which two points are one, m."""
TINY = 1e-12
"""Area below which three points are on one line, m²."""


@kernel
def nearest_in_hull(points: Vector, count: int, x: float, y: float) -> tuple[float, float]:
    """The point nearest to (x, y) of the convex hull, polygon, segment or point, of the first ``count`` points."""
    outside = count < 3
    best = np.hypot(points[0, 0] - x, points[0, 1] - y)
    at_x, at_y = points[0, 0], points[0, 1]
    area = 0.0
    for i in range(count):
        for j in range(count):
            ex, ey = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
            length = ex * ex + ey * ey
            if length < SAME * SAME:
                continue
            left = True  # whether all points are left of the edge, or on it
            for n in range(count):
                side = ex * (points[n, 1] - points[i, 1]) - ey * (points[n, 0] - points[i, 0])
                area = max(area, abs(side))
                left = left and side >= -TINY
            if left and ex * (y - points[i, 1]) - ey * (x - points[i, 0]) < 0.0:
                outside = True
            share = min(max((ex * (x - points[i, 0]) + ey * (y - points[i, 1])) / length, 0.0), 1.0)
            px, py = points[i, 0] + share * ex, points[i, 1] + share * ey
            distance = np.hypot(px - x, py - y)
            if distance < best:
                best, at_x, at_y = distance, px, py
    if not outside and area > TINY:
        return x, y
    return at_x, at_y


@kernel
def stance_points(p: WalkingRecord, without: int, margin: float, out: Vector) -> int:
    """Contact points (points, 2) of the stance feet, without those of one group (−1 for none); returns how many.

    Each is drawn by the share ``margin`` of the way to the middle of its foot.
    """
    m, count = p.measured, 0
    for n in range(m.point.shape[0]):
        k = p.foot[n]
        if p.in_air[k] == 0.0 and p.group[k] != without:
            for i in range(2):
                out[count, i] = m.point[n, i] + margin * (m.place[k, i] - m.point[n, i])
            count += 1
    return count
