"""The surface of the ground for kernels: one record for all kinds of terrain, its height, and its
slope.

The height is the sum of a plane, a profile along x, and a grid:

    h(x, y) = h_0 + s_x x + s_y y + profile(x) + grid(x, y)

Kinds that have no such part leave it zero, so that kernels are compiled once for all of them.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.kernels import kernel
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.state import Vector

MAX_PIECES = 64
"""Straight pieces of a profile."""
MAX_CELLS = 64
"""Points of a grid along each side."""
REPEATS = 2
"""``cells`` of a grid that goes on over and over; 1 where it ends."""


class TerrainRecord(RecordOf):
    """The surface of the ground."""

    level: int  # 1 for the plane z = 0, of which nothing else is read
    slope: Vector  # (2,) rise of the plane per metre along x and y
    above: float  # its height at the origin, m
    pieces: int  # of the profile
    # (64, 3) where each piece begins, m, its height there, m, and its rise per metre; zero before
    # the first
    profile: Vector
    # (3,) points of the grid along x and y, and 0 without a grid, 1 with one, 2 with one that
    # repeats
    cells: Vector
    resolution: float  # distance of its points, m
    corner: Vector  # (2,) place of its first point, m
    grid: Vector  # (64, 64) its heights, m


def flat_terrain(*, pieces: int = MAX_PIECES, cells: int = MAX_CELLS) -> Records[TerrainRecord]:
    """The record of the plane z = 0, with room for pieces of a profile, and for points of a grid
    along each side.
    """
    return make_record(
        TerrainRecord,
        level=np.int64(1),
        slope=np.zeros(2),
        above=0.0,
        pieces=np.int64(0),
        profile=np.zeros((pieces, 3)),
        cells=np.zeros(3, dtype=np.int64),
        resolution=1.0,
        corner=np.zeros(2),
        grid=np.zeros((cells, cells)),
    )


def greatest_rise(terrain: Records[TerrainRecord], way: float) -> float:
    """Greatest difference of the ground's heights within a way along x, of the grid anywhere,
    without the plane, m.
    """
    pieces, rise = int(terrain["pieces"][0]), 0.0
    if pieces:
        begin, height, slope = terrain["profile"][0, :pieces].T
        places = np.concatenate((begin - way, begin, begin + way))
        last = np.searchsorted(begin, places, side="right") - 1
        heights = np.where(last < 0, 0.0, height[last] + slope[last] * (places - begin[last]))
        near = np.abs(places[:, None] - begin) <= way * (1.0 + 1e-9)
        rise = float(
            np.abs(np.where(near, heights[:, None] - heights[pieces : 2 * pieces], 0.0)).max()
        )
    return rise + float(np.ptp(terrain["grid"]))


@kernel
def surface_height(t: TerrainRecord, x: float, y: float) -> float:
    """Height of the ground at a place, m."""
    if t.level:
        return 0.0
    height = t.slope[0] * x + t.slope[1] * y + profile_height(t, x) + t.above
    if t.cells[2] > 0:
        height += grid_height(t, x, y)
    return float(height)


@kernel
def profile_height(t: TerrainRecord, x: float) -> float:
    """Height of the profile at a place, m."""
    i = _piece(t, x)
    if i < 0:
        return 0.0
    return float(t.profile[i, 1] + t.profile[i, 2] * (x - t.profile[i, 0]))


@kernel
def grid_height(t: TerrainRecord, x: float, y: float) -> float:
    """Height of the surface of a terrain's grid at a place, m."""
    u, v = _place(t, x, 0), _place(t, y, 1)
    a, b = _first(t, u, 0), _first(t, v, 1)
    c, d = _next(t, a, 0), _next(t, b, 1)
    u, v = u - a, v - b
    low = t.grid[a, b] + u * (t.grid[c, b] - t.grid[a, b])
    high = t.grid[a, d] + u * (t.grid[c, d] - t.grid[a, d])
    return float(low + v * (high - low))


@kernel
def surface_slope(t: TerrainRecord, x: float, y: float) -> tuple[float, float]:
    """Rise of the ground per metre along x and y at a place."""
    if t.level:
        return 0.0, 0.0
    along, across = t.slope[0], t.slope[1]
    i = _piece(t, x)
    if i >= 0:
        along += t.profile[i, 2]
    if t.cells[2] > 0:
        u, v = _place(t, x, 0), _place(t, y, 1)
        a, b = _first(t, u, 0), _first(t, v, 1)
        c, d = _next(t, a, 0), _next(t, b, 1)
        u, v = u - a, v - b
        if _inside(t, x, 0):
            rise = (1.0 - v) * (t.grid[c, b] - t.grid[a, b]) + v * (t.grid[c, d] - t.grid[a, d])
            along += rise / t.resolution
        if _inside(t, y, 1):
            rise = (1.0 - u) * (t.grid[a, d] - t.grid[a, b]) + u * (t.grid[c, d] - t.grid[c, b])
            across += rise / t.resolution
    return along, across


@kernel
def surface_normal(t: TerrainRecord, x: float, y: float) -> tuple[float, float, float]:
    """Normal of the ground at a place, of length one, upwards."""
    along, across = surface_slope(t, x, y)
    size = np.sqrt(1.0 + along * along + across * across)
    return -along / size, -across / size, 1.0 / size


@kernel
def _piece(t: TerrainRecord, x: float) -> int:
    """The piece of the profile that holds x; −1 before the first."""
    found = -1
    while found + 1 < t.pieces and t.profile[found + 1, 0] <= x:
        found += 1
    return found


@kernel
def _place(t: TerrainRecord, x: float, axis: int) -> float:
    """Place on the grid along an axis, in its points, within it."""
    u = (x - t.corner[axis]) / t.resolution
    n = t.cells[axis]
    if t.cells[2] == REPEATS:
        return float(u - n * np.floor(u / n))
    return float(min(max(u, 0.0), n - 1.0))


@kernel
def _inside(t: TerrainRecord, x: float, axis: int) -> bool:
    """Whether the grid has a slope there: beyond its edge it goes on level."""
    if t.cells[2] == REPEATS:
        return True
    u = (x - t.corner[axis]) / t.resolution
    inside: bool = 0.0 <= u < t.cells[axis] - 1
    return inside


@kernel
def _first(t: TerrainRecord, u: float, axis: int) -> int:
    """The point before a place on the grid; the last one has none behind it unless the grid
    repeats.
    """
    last: int = t.cells[axis] - 1
    if t.cells[2] != REPEATS:
        last -= 1
    return max(min(int(np.floor(u)), last), 0)


@kernel
def _next(t: TerrainRecord, a: int, axis: int) -> int:
    """The point behind another one."""
    if a + 1 < t.cells[axis]:
        return a + 1
    return 0
