"""The ground in the colours of its friction, and what a walk marks on it: footholds, slip, the
target's way.
"""

import numpy as np
from numpy.typing import NDArray

from harpy_pin.ground.ground import Ground
from harpy_pin.ground.terrain import Terrain
from harpy_pin.log.measures import SLIDING_SPEED
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import PRESSURE, SLIP, TARGET, ground_colour
from harpy_pin.view.scene.frames import Frames, surface_of
from harpy_pin.view.scene.nodes import (
    Box,
    Cylinder,
    Lines,
    Look,
    Mesh,
    Motion,
    Motions,
    Node,
    shifted,
)

LINES = (("fine", 0.1, "#dce2ea"), ("coarse", 0.5, "#b4bfcc"))
"""Distance between two lines of the grid, m, and their colour."""
MARGIN, FARTHEST = 2.5, 30.0
"""How far the grid reaches beyond the walk, and from the origin, m, for runs that flew away."""
CELL, MOST_CELLS, SURFACE_MARGIN = 0.05, 300, 1.5
"""Side of a surface's cells, m, their largest number in each direction, and how far it reaches
beyond the walk.
"""
PATH_HEIGHT, FOOTHOLD_HEIGHT, SLIP_HEIGHT = 0.0006, 0.0010, 0.0014
"""Over the ground, m: one above the other, and above the lines of the grid."""
MAX_MARKS = 150
"""Objects that slip marks are drawn with: those of a longer run appear several at a time."""
SHORTEST = 0.1
"""A contact that lasts as long leaves a foothold, s."""


def ground_nodes(path: Vector, ground: Ground | None) -> list[Node]:
    """The ground in the colours of its friction, with lines.

    Args:
        path: (n, 3) points that it has to reach, world, m.
        ground: of the run; None where it is not known.
    """
    surface = surface_of(ground)
    return _flat_ground(path, ground) if surface is None else _surface_ground(path, surface, ground)


def _flat_ground(path: Vector, ground: Ground | None) -> list[Node]:
    """The ground z = 0, and its strips of another friction."""
    low = np.clip(np.floor(path[:, :2].min(axis=0) - MARGIN), -FARTHEST, FARTHEST)
    high = np.clip(np.ceil(path[:, :2].max(axis=0) + MARGIN), -FARTHEST, FARTHEST)
    # An even colour whatever the light, and a second plane that shows nothing but shadows.
    nodes = [
        Node("ground/plane", Box((400.0, 400.0, 0.02)), _ground_look(ground), shifted(z=-0.0135)),
        Node(
            "ground/shadow",
            Box((400.0, 400.0, 0.001)),
            Look("#22304a", 0.28, light="shadow"),
            shifted(z=-0.001),
        ),
    ]
    for height, (name, step, colour) in zip((0.0, 0.0003), LINES, strict=True):
        nodes.append(Node(f"ground/{name}", Lines(_grid(low, high, step, height)), Look(colour)))
    strips = () if ground is None else ground.friction_strips
    for number, (begin, end, friction) in enumerate(strips):
        place = shifted(x=0.5 * (begin + end), z=-0.002)  # below the lines of the grid
        strip = Box((end - begin, 400.0, 0.001))
        nodes.append(
            Node(f"ground/strip/{number + 1}", strip, Look(ground_colour(friction)), place)
        )
    return nodes


def _surface_ground(path: Vector, surface: Terrain, ground: Ground | None) -> list[Node]:
    """Ground that is not flat around a path."""
    low = np.floor((path[:, :2].min(axis=0) - SURFACE_MARGIN) / CELL).astype(int)
    high = np.ceil((path[:, :2].max(axis=0) + SURFACE_MARGIN) / CELL).astype(int)
    high = np.minimum(high, low + MOST_CELLS)
    x, y = (CELL * np.arange(low[axis], high[axis] + 1) for axis in range(2))
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    height = surface.height(places[..., 0].copy(), places[..., 1].copy())
    points = np.concatenate((places, height[..., None]), axis=-1)
    number = np.arange(height.size).reshape(height.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate(
        [np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))]
    )
    look = Look(_ground_look(ground).colour, light="ground")
    nodes = [Node("ground/plane", Mesh(points.reshape(-1, 3), faces), look)]
    for above, (name, step, colour) in zip((0.001, 0.0015), LINES, strict=True):
        every, segments = round(step / CELL), []
        for axis in range(2):
            grid = np.moveaxis(points + np.array((0.0, 0.0, above)), axis, 0)[
                (-low[axis]) % every :: every
            ]
            segments.append(np.stack((grid[:, :-1], grid[:, 1:]), axis=2).reshape(-1, 2, 3))
        nodes.append(Node(f"ground/{name}", Lines(np.concatenate(segments)), Look(colour)))
    return nodes


def _ground_look(ground: Ground | None) -> Look:
    return Look("#f1f4f8" if ground is None else ground_colour(ground.mu_s))


def _grid(low: Vector, high: Vector, step: float, height: float) -> Vector:
    """(segments, 2, 3) ends of a grid's segments, none longer than 1 m."""
    blocks = []
    for axis in range(2):
        lines = np.arange(low[axis], high[axis] + 0.5 * step, step)
        cuts = np.linspace(low[1 - axis], high[1 - axis], 2 + int(high[1 - axis] - low[1 - axis]))
        block = np.full((len(lines), len(cuts) - 1, 2, 3), height)
        block[..., axis] = lines[:, None, None]
        block[..., 0, 1 - axis], block[..., 1, 1 - axis] = cuts[:-1], cuts[1:]
        blocks.append(block.reshape(-1, 2, 3))
    return np.concatenate(blocks)


def slip_steps(frames: Frames) -> tuple[NDArray[np.intp], Vector]:
    """Where stance feet slid from one frame to the next, faster than 10 mm/s.

    Returns:
        (m,) number of the frame at which each step ends, increasing, and (m, 2, 2) where it begins
        and ends on the ground, m.
    """
    touching, place = frames["foot_force"][..., 2] > 0.0, frames["foot_position"][..., :2]
    length = np.linalg.norm(np.diff(place, axis=0), axis=2)
    slid = touching[1:] & touching[:-1] & (length > SLIDING_SPEED * np.diff(frames.time)[:, None])
    row, foot = np.nonzero(slid)
    return row + 1, np.stack((place[row, foot], place[row + 1, foot]), axis=1)


def footholds(frames: Frames) -> Vector:
    """(m, 2) places where feet touch down and stay on the ground for a while, m."""
    touching, position = frames["foot_force"][..., 2] > 0.0, frames["foot_position"]
    places = []
    for k in range(touching.shape[1]):
        edges = np.flatnonzero(np.diff(touching[:, k].astype(np.int8), prepend=0, append=0))
        for begin, end in edges.reshape(-1, 2):
            if frames.time[end - 1] - frames.time[begin] >= SHORTEST:
                places.append(position[begin, k, :2])
    return np.array(places).reshape(-1, 2)


def centre_of_pressure(frames: Frames) -> Vector:
    """(n, 2) mean of the feet's places, weighted by their normal forces, m; NaN without contact."""
    normal = np.maximum(frames["foot_force"][..., 2], 0.0)
    total = normal.sum(axis=1)[:, None]
    weighted = (normal[..., None] * frames["foot_position"][..., :2]).sum(axis=1)
    return np.asarray(
        np.divide(weighted, total, out=np.full(weighted.shape, np.nan), where=total > 0.0)
    )


def marks(frames: Frames, size: float) -> list[Node]:
    """The way of the target on the ground, and a ring where each foot touches down, past and to
    come.

    Args:
        frames: the motion.
        size: height of the robot, m.
    """
    nodes, surface = [], frames.surface
    if "target" in frames.references:
        points, width = frames.references["target"][frames.rows], 0.012 * size
        ground = points[np.isfinite(points).all(axis=1), :2]
        # Pieces of at least their own width: many more would look the same.
        way = np.cumsum(np.linalg.norm(np.diff(ground, axis=0, prepend=ground[:1]), axis=1))
        corners = ground[np.flatnonzero(np.diff(np.floor(way / width), prepend=-1.0) > 0.0)]
        if len(corners) > 1:
            steps = np.stack((corners[:-1], corners[1:]), axis=1)
            nodes.append(
                Node("path", _ribbons(steps, PATH_HEIGHT, width, surface), Look(TARGET, 0.35))
            )
    places, radius = footholds(frames), 0.06 * size
    if len(places):
        angle = 2.0 * np.pi * np.arange(33) / 32
        circle = radius * np.stack((np.cos(angle), np.sin(angle)), axis=1)
        rings = (places[:, None, None] + np.stack((circle[:-1], circle[1:]), axis=1)[None]).reshape(
            -1, 2, 2
        )
        ribbons = _ribbons(rings, FOOTHOLD_HEIGHT, 0.2 * radius, surface)
        nodes.append(Node("foothold", ribbons, Look("#7f93a8", 0.8)))
    return nodes


def slip_marks(frames: Frames, size: float) -> tuple[list[Node], Motions]:
    """Dark marks where stance feet slid; each appears when it is made, and stays. For arguments see
    :func:`marks`.
    """
    row, steps = slip_steps(frames)
    share = -(-len(frames) // MAX_MARKS)
    nodes, motions = [], {}
    for piece in np.unique(row // share):
        mine = row // share == piece
        name = f"slip/{piece}"
        nodes.append(
            Node(
                name,
                _ribbons(steps[mine], SLIP_HEIGHT, 0.03 * size, frames.surface),
                Look(SLIP, 0.85),
            )
        )
        motions[name] = Motion(visible=np.arange(len(frames)) >= row[mine][0])
    return nodes, motions


def pressure_nodes(size: float) -> list[Node]:
    """A disc that stands for the centre of pressure of a robot of a height, m."""
    radius = 0.035 * size
    return [
        Node("pressure/edge", Cylinder(0.002, radius), Look("#1b2430")),
        Node("pressure/disc", Cylinder(0.003, 0.8 * radius), Look(PRESSURE)),
    ]


def pressure_motions(frames: Frames) -> Motions:
    """Where the centre of pressure is; hidden without contact."""
    point = centre_of_pressure(frames)
    known = np.asarray(np.isfinite(point).all(axis=1))
    place = np.where(known[:, None], point, 0.0)
    height = SLIP_HEIGHT + _heights(frames.surface, place)
    return {"pressure": Motion(position=np.column_stack((place, height)), visible=known)}


def _heights(surface: Terrain | None, places: Vector) -> Vector:
    """(n,) height of the ground at (n, 2) places, m."""
    return (
        np.zeros(len(places))
        if surface is None
        else surface.height(places[:, 0].copy(), places[:, 1].copy())
    )


def _ribbons(steps: Vector, height: float, width: float, surface: Terrain | None) -> Mesh:
    """Flat strips along (m, 2, 2) steps on the ground."""
    along = steps[:, 1] - steps[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.divide(along, length, out=np.zeros_like(along), where=length > 0.0)
    across = 0.5 * width * np.stack((-along[:, 1], along[:, 0]), axis=1)
    # Longer by a quarter of the width at both ends, so that one goes over into the next.
    begin, end = steps[:, 0] - 0.25 * width * along, steps[:, 1] + 0.25 * width * along
    corners = np.stack(
        (begin - across, end - across, end + across, begin + across), axis=1
    ).reshape(-1, 2)
    faces = 4 * np.arange(len(steps))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(
        np.column_stack((corners, height + _heights(surface, corners))), faces.reshape(-1, 3)
    )
