"""What the walk leaves on the ground and in the air: slip marks, footholds, the target's path, trails, pressure.

A ``node`` is a Meshcat visualizer at the path of what is drawn, in world axes; what moves is added to ``animation``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from meshcat import geometry as g
from meshcat.animation import Animation
from numpy.typing import NDArray

from harpy_pin.log.measures import SLIDING_SPEED
from harpy_pin.model.state import Vector
from harpy_pin.simulation.terrain import Terrain
from harpy_pin.view.palette import PRESSURE, SLIP, TARGET, as_int
from harpy_pin.view.scene.arrows import Y_TO_Z
from harpy_pin.view.scene.command_recorder import set_exactly
from harpy_pin.view.scene.frames import Frames
from harpy_pin.view.scene.motion import Motion

__all__ = [
    "centre_of_pressure",
    "draw_footholds",
    "draw_path",
    "draw_pressure",
    "draw_slip_marks",
    "draw_trail",
    "footholds",
    "slip_steps",
]

PATH_HEIGHT, FOOTHOLD_HEIGHT, SLIP_HEIGHT = 0.0006, 0.0010, 0.0014
"""Over the ground, m: one above the other, and above the lines of the grid."""
FOOTHOLD = "#7f93a8"
SIDES = 32
MAX_MARKS = 150
"""Objects that slip marks are drawn with: those of a longer run appear several at a time."""
SHORTEST = 0.1
"""A contact that lasts as long leaves a foothold, s."""


def slip_steps(frames: Frames) -> tuple[NDArray[np.intp], Vector]:
    """Where held feet slid from one frame to the next, faster than 10 mm/s.

    Returns:
        (m,) number of the frame at which each step ends, increasing, and (m, 2, 2) where it begins and ends on the
        ground, m.
    """
    touching = frames.foot_force[..., 2] > 0.0
    place = frames.foot_position[..., :2]
    length = np.linalg.norm(np.diff(place, axis=0), axis=2)
    slid = touching[1:] & touching[:-1] & (length > SLIDING_SPEED * np.diff(frames.time)[:, None])
    row, foot = np.nonzero(slid)
    return row + 1, np.stack((place[row, foot], place[row + 1, foot]), axis=1)


def footholds(frames: Frames) -> Vector:
    """(m, 2) places where feet touch down and stay on the ground for a while, m."""
    touching = frames.foot_force[..., 2] > 0.0
    places = []
    for k in range(touching.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate(([False], touching[:, k], [False])).astype(np.int8)))
        for begin, end in edges.reshape(-1, 2):
            if frames.time[end - 1] - frames.time[begin] >= SHORTEST:
                places.append(frames.foot_position[begin, k, :2])
    return np.array(places).reshape(-1, 2)


def centre_of_pressure(frames: Frames) -> Vector:
    """(n, 3) mean of the feet's places, weighted by their normal forces, on the ground, m; NaN without contact."""
    normal = np.maximum(frames.foot_force[..., 2], 0.0)
    total = normal.sum(axis=1)
    weighted = (normal[..., None] * frames.foot_position).sum(axis=1)
    point = np.divide(weighted, total[:, None], out=np.full(weighted.shape, np.nan), where=total[:, None] > 0.0)
    point[:, 2] *= 0.0
    return np.asarray(point)


def draw_slip_marks(
    node: Any, animation: Animation, frames: Frames, *, width: float, surface: Terrain | None = None
) -> None:
    """Add dark marks where held feet slid; each appears when it is made, and stays.

    Args:
        width: of a mark, m.
        surface: of the ground, where it is not flat.
    """
    row, steps = slip_steps(frames)
    if len(row) == 0:
        return
    share = -(-len(frames) // MAX_MARKS)
    for piece in np.unique(row // share):
        mine = row // share == piece
        mark = node[str(piece)]
        _set_ribbons(mark, steps[mine], SLIP_HEIGHT, width, SLIP, 0.85, surface)
        made = np.arange(len(frames)) >= row[mine][0]
        Motion(visible=made).apply(mark, animation, frames.time)


def draw_path(node: Any, points: Vector, *, width: float, surface: Terrain | None = None) -> None:
    """Add the way of the target to the ground, past and to come.

    Args:
        points: (n, 3), m; where they are not finite there is no way.
        width: of the line, m.
        surface: of the ground, where it is not flat.
    """
    ground = points[np.isfinite(points).all(axis=1), :2]
    # Pieces of at least their own width: many more would look the same.
    way = np.cumsum(np.linalg.norm(np.diff(ground, axis=0, prepend=ground[:1]), axis=1))
    keep = np.flatnonzero(np.diff(np.floor(way / width), prepend=-1.0) > 0.0)
    corners = ground[keep]
    if len(corners) > 1:
        _set_ribbons(node, np.stack((corners[:-1], corners[1:]), axis=1), PATH_HEIGHT, width, TARGET, 0.35, surface)


def draw_footholds(node: Any, frames: Frames, *, radius: float, surface: Terrain | None = None) -> None:
    """Add a ring where each foot touches down, past and to come.

    Args:
        radius: of a ring, m.
        surface: of the ground, where it is not flat.
    """
    places = footholds(frames)
    if len(places) == 0:
        return
    angle = 2.0 * np.pi * np.arange(SIDES + 1) / SIDES
    circle = radius * np.stack((np.cos(angle), np.sin(angle)), axis=1)
    steps = np.stack((circle[:-1], circle[1:]), axis=1)
    rings = (places[:, None, None] + steps[None]).reshape(-1, 2, 2)
    _set_ribbons(node, rings, FOOTHOLD_HEIGHT, 0.2 * radius, FOOTHOLD, 0.8, surface)


def draw_pressure(
    node: Any, animation: Animation, frames: Frames, *, radius: float, surface: Terrain | None = None
) -> None:
    """Add a disc at the centre of pressure.

    Args:
        radius: of the disc, m.
        surface: of the ground, where it is not flat.
    """
    point = centre_of_pressure(frames)
    known = np.asarray(np.isfinite(point).all(axis=1))
    if not known.any():
        return
    for name, share, height, colour in (("edge", 1.0, 0.002, "#1b2430"), ("disc", 0.8, 0.003, PRESSURE)):
        node[name].set_object(g.Cylinder(height, share * radius), g.MeshBasicMaterial(color=as_int(colour)))
        node[name].set_transform(Y_TO_Z)
        set_exactly(node[name]["<object>"], "castShadow", False)
    position = np.where(known[:, None], point, 0.0)
    position[:, 2] = SLIP_HEIGHT
    if surface is not None:
        position[:, 2] += surface.height(position[:, 0].copy(), position[:, 1].copy())
    Motion(position=position, visible=known).apply(node, animation, frames.time)


def draw_trail(node: Any, points: Vector, *, colour: str) -> None:
    """Add the line on which a point moves, past and to come.

    Args:
        points: (n, 3), m; where they are not finite there is no line.
        colour: ``#rrggbb``.
    """
    known = points[np.isfinite(points).all(axis=1)]
    if len(known) < 2:
        return
    material = g.LineBasicMaterial(color=as_int(colour), linewidth=2.0, opacity=0.7, transparent=True)
    # Short pieces, as some renderers lose lines that pass the camera.
    pieces = np.stack((known[:-1], known[1:]), axis=1).reshape(-1, 3)
    node.set_object(g.LineSegments(g.PointsGeometry(pieces.T.astype(np.float32)), material))
    set_exactly(node["<object>"], "castShadow", False)


def _set_ribbons(
    node: Any, steps: Vector, height: float, width: float, colour: str, opacity: float, surface: Terrain | None
) -> None:
    """Flat strips along (m, 2, 2) steps on the ground, as one object with six corners each."""
    along = steps[:, 1] - steps[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.divide(along, length, out=np.zeros_like(along), where=length > 0.0)
    across = 0.5 * width * np.stack((-along[:, 1], along[:, 0]), axis=1)
    # Longer by a quarter of the width at both ends, so that one goes over into the next.
    begin, end = steps[:, 0] - 0.25 * width * along, steps[:, 1] + 0.25 * width * along
    corners = np.stack((begin - across, end - across, end + across, begin + across), axis=1).reshape(-1, 2)
    heights = np.full(len(corners), height)
    if surface is not None:
        heights += surface.height(corners[:, 0].copy(), corners[:, 1].copy())
    vertices = np.column_stack((corners, heights))
    faces = 4 * np.arange(len(steps))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    material = g.MeshBasicMaterial(color=as_int(colour), opacity=opacity, transparent=True, depthWrite=False)
    node.set_object(g.TriangularMeshGeometry(vertices.astype(np.float32), faces.reshape(-1, 3)), material)
    for name in ("castShadow", "receiveShadow"):
        set_exactly(node["<object>"], name, False)
