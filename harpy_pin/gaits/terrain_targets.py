"""The ground around feet and body, and a gait's targets laid over it: the arithmetic of
:class:`~harpy_pin.gaits.on_terrain.OnTerrain`.

The flat world of a gait goes over into the true one by heights alone: of a foot by that of the
ground below it, of the body by that of the plane which fits the ground around it best. So a foot
that is as high as the ground in the one world is so in the other, and the body stays as high above
its support. Feet keep away from edges, because the friction cone about the normal of a riser holds
nothing.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.gaits.gait import GaitTargetRecord, copy_target
from harpy_pin.ground.surface import (
    TerrainRecord,
    grid_height,
    profile_height,
    surface_height,
    surface_normal,
    surface_slope,
)
from harpy_pin.kernels import kernel
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector

POINTS = 2
"""Points of the square that a plane is fitted to, on each side of its middle."""
RADIUS, SAMPLES = 0.12, 6
"""How far a swing foot looks around for higher ground, m, and at how many points on each side."""
STEEPEST = 1.0
"""Rise of its way over higher ground, per metre."""
LIFTED = 0.015
"""Height above flat ground from which on it goes all of that way, m."""
STEEP = 1.0
"""Rise per metre from which on ground is too steep for a foot."""
MARGIN = 0.025
"""Distance that a foothold keeps from such ground, along x and y, m."""
FARTHEST, PLACES = 0.152, 38
"""How far a foothold is moved at most in each of eight directions, m, and how many places are
looked at.
"""


class OnTerrainRecord(RecordOf):
    """What :class:`~harpy_pin.gaits.on_terrain.OnTerrain` knows."""

    terrain: TerrainRecord  # the surface
    reach: float  # half the side of the square around the body whose plane the body follows, m
    own_swings: int  # 1 where the gait says the world heights of swing feet
    leans: int  # 1 where the body leans with the ground
    normal_error: float  # error of the normals, an angle about y, rad
    offset: Vector = sized(3)  # how far the body is from where the gait has it, world axes, m
    time: float = 0.0  # of the last update, s
    swing_time: float = 0.0  # duration of a swing, s; zero where it is not known where feet land
    landing: Vector = sized(
        "feet", 2
    )  # where the swing of each foot ends: ahead of the body, and beside the path, m
    aside: Vector = sized(
        "feet", 2
    )  # how far from the gait's place each foot stands, or was lifted, m
    next_aside: Vector = sized(
        "feet", 2
    )  # how far from it the place is where a swing foot will land, m
    moving: Vector = sized("feet")  # 1 for a swing foot


@kernel
def fit_plane(t: TerrainRecord, x: float, y: float, reach: float) -> tuple[float, float, float]:
    """Height at (x, y) of the plane nearest to the ground around it, and its rise along x and y.

    That ground is the square to ``reach`` on each side. The plane goes on steadily where the place
    does, over the edge of a step, too.
    """
    if t.level:
        return 0.0, 0.0, 0.0
    height, along = _fit_profile(t, x, reach)
    height += t.slope[0] * x + t.slope[1] * y + t.above
    along, across = along + t.slope[0], t.slope[1] + 0.0
    if t.cells[2] > 0:
        low, rise, tilt = _fit_grid(t, x, y, reach)
        height, along, across = height + low, along + rise, across + tilt
    return height, along, across


@kernel
def _fit_profile(t: TerrainRecord, x: float, reach: float) -> tuple[float, float]:
    """Height and rise of the line nearest to the profile, by integrals over it."""
    height = along = 0.0
    for i in range(t.pieces):
        begin = max(t.profile[i, 0], x - reach)
        end = min(t.profile[i + 1, 0], x + reach) if i + 1 < t.pieces else x + reach
        if end > begin:
            width, middle = end - begin, 0.5 * (begin + end)
            z = t.profile[i, 1] + t.profile[i, 2] * (middle - t.profile[i, 0])
            height += width * z
            along += width * ((middle - x) * z + t.profile[i, 2] * width * width / 12.0)
    return height / (2.0 * reach), 1.5 * along / (reach * reach * reach)


@kernel
def _fit_grid(t: TerrainRecord, x: float, y: float, reach: float) -> tuple[float, float, float]:
    """Height and rise along x and y of the plane nearest to points of the grid's surface."""
    height = along = across = square = 0.0
    for i in range(-POINTS, POINTS + 1):
        for j in range(-POINTS, POINTS + 1):
            dx, dy = i * reach / POINTS, j * reach / POINTS
            z = grid_height(t, x + dx, y + dy)
            height += z
            along += dx * z
            across += dy * z
            square += dx * dx
    count = (2 * POINTS + 1) * (2 * POINTS + 1)
    return height / count, along / square, across / square


@kernel
def way_over(t: TerrainRecord, x: float, y: float) -> tuple[float, float, float]:
    """Height, and rise along x and y, of the lowest way over the ground that is nowhere steeper
    than ``STEEPEST``.
    """
    height = surface_height(t, x, y)
    along, across = surface_slope(t, x, y)
    along, across = min(max(along, -STEEPEST), STEEPEST), min(max(across, -STEEPEST), STEEPEST)
    high, slope = _over_profile(t, x)
    if high > 0.0:
        height, along = height + high, slope
    if t.cells[2] > 0:
        low = height
        for i in range(-SAMPLES, SAMPLES + 1):
            for j in range(-SAMPLES, SAMPLES + 1):
                dx, dy = i * RADIUS / SAMPLES, j * RADIUS / SAMPLES
                distance = np.sqrt(dx * dx + dy * dy)
                z = surface_height(t, x + dx, y + dy) - STEEPEST * distance
                if distance > 0.0 and z > low:
                    low, along, across = z, STEEPEST * dx / distance, STEEPEST * dy / distance
        height = low
    return float(height), float(along), float(across)


@kernel
def _over_profile(t: TerrainRecord, x: float) -> tuple[float, float]:
    """How much higher than the profile that way is, and its rise along x: cones stand on the
    corners of the profile.
    """
    best, slope = 0.0, 0.0
    for i in range(t.pieces):
        way = t.profile[i, 0] - x
        if 0.0 < abs(way) < RADIUS:
            high = t.profile[i, 1] - profile_height(t, x) - STEEPEST * abs(way)
            if high > best:
                best, slope = high, STEEPEST * way / abs(way)
    return best, slope


@kernel
def nearest_steppable(
    t: TerrainRecord, x: float, y: float, before_x: float, before_y: float
) -> tuple[float, float]:
    """The place (x, y), or the best one around it where a foot can be set, near to (before_x,
    before_y), too.

    Where there is none it is the place itself.
    """
    if steppable(t, x, y):
        return x, y
    best, best_x, best_y = 1e9, x, y
    for i in range(-1, 2):
        for j in range(-1, 2):
            for n in range(1, PLACES + 1):
                dx, dy = i * n * FARTHEST / PLACES, j * n * FARTHEST / PLACES
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


@kernel
def lay_over(t: float, p: OnTerrainRecord, g: GaitTargetRecord, o: GaitTargetRecord) -> None:
    """Targets ``o`` on the terrain from those of flat ground, ``g``, at the time t.

    At time zero, and where the clock has gone back by more than a swing, every foot is where the
    gait says.
    """
    if t <= 0.0 or t < p.time - p.swing_time:
        p.aside[:] = p.next_aside[:] = p.moving[:] = 0.0
    p.time = t
    copy_target(g, o)
    if p.terrain.level:
        return
    height, along, across = fit_plane(p.terrain, g.body[0], g.body[1], p.reach)
    rise = np.array([along, across])
    o.body[2] += height
    o.body[5] += rise @ g.body[3:5]
    o.body[8] += rise @ g.body[6:8]
    if p.leans:
        o.up[:] = np.array([-along, -across, 1.0]) / np.sqrt(1.0 + along**2 + across**2)
    for k in range(g.stance.shape[0]):
        _lay_foot(p, g, o, k)
        o.foot_position[k] -= p.offset
    o.body[:3] += p.offset


@kernel
def _lay_foot(p: OnTerrainRecord, g: GaitTargetRecord, o: GaitTargetRecord, k: int) -> None:
    """One foot: on the ground itself; one that is lifted goes over what is higher around it."""
    t = p.terrain
    _beside_edges(p, g, k, o)
    x, y = g.body[:2] + o.foot_position[k, :2]
    o.ground_height[k] = surface_height(t, x, y)
    nx, ny, nz = surface_normal(t, x, y)
    c, s = np.cos(p.normal_error), np.sin(p.normal_error)
    o.normal[k] = c * nx + s * nz, ny, c * nz - s * nx
    height, rise = o.ground_height[k], np.array([-nx / nz, -ny / nz])
    lifted = min(max((g.body[2] + g.foot_position[k, 2]) / LIFTED, 0.0), 1.0)
    if g.stance[k] == 0.0 and p.own_swings:
        height = 0.0
        rise[:] = 0.0
    elif g.stance[k] == 0.0 and lifted > 0.0 and (t.pieces > 0 or t.cells[2] > 0):
        high, steep_along, steep_across = way_over(t, x, y)
        height += lifted * (high - height)
        rise += lifted * (np.array([steep_along, steep_across]) - rise)
    velocity = rise @ (g.body[3:5] + o.foot_velocity[k, :2])
    acceleration = rise @ (g.body[6:8] + o.foot_acceleration[k, :2])
    o.foot_position[k, 2] = g.body[2] + g.foot_position[k, 2] + height - o.body[2]
    o.foot_velocity[k, 2] = g.body[5] + g.foot_velocity[k, 2] + velocity - o.body[5]
    o.foot_acceleration[k, 2] = g.body[8] + g.foot_acceleration[k, 2] + acceleration - o.body[8]


@kernel
def _beside_edges(p: OnTerrainRecord, g: GaitTargetRecord, k: int, o: GaitTargetRecord) -> None:
    """Move the target of foot k of ``o``, a copy of those on flat ground in ``g``, along the ground
    off edges.
    """
    if p.swing_time == 0.0:
        return
    if g.stance[k] != 0.0:
        if p.moving[k] != 0.0:
            p.moving[k] = 0.0
            p.aside[k] = p.next_aside[k]
        o.foot_position[k, :2] += p.aside[k]
        return
    u = g.phase[k]
    if p.moving[k] == 0.0:
        p.moving[k] = 1.0
        x, y = g.body[0] + g.body[3] * (1.0 - u) * p.swing_time + p.landing[k, 0], p.landing[k, 1]
        at_x, at_y = nearest_steppable(p.terrain, x, y, x, y)
        p.next_aside[k] = at_x - x, at_y - y
    way, rate = p.next_aside[k] - p.aside[k], 1.0 / p.swing_time
    o.foot_position[k, :2] += p.aside[k] + u**3 * (10.0 - 15.0 * u + 6.0 * u**2) * way
    o.foot_velocity[k, :2] += 30.0 * (u * (1.0 - u)) ** 2 * rate * way
    o.foot_acceleration[k, :2] += 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) * rate**2 * way
