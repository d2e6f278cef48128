"""Ground that is not flat, in a scene: its surface with lines, and vectors about its normals."""

from __future__ import annotations

from typing import Any

import numpy as np
from meshcat import geometry as g
from numpy.typing import NDArray

from harpy_pin.log.run import Run
from harpy_pin.model.contact_frame import in_contact_frames
from harpy_pin.model.state import Vector
from harpy_pin.simulation.ground import Ground
from harpy_pin.simulation.terrain import Terrain
from harpy_pin.view.palette import as_int
from harpy_pin.view.scene.command_recorder import set_exactly

__all__ = ["about_normals", "draw_surface", "surface_of"]

CELL, MOST_CELLS = 0.05, 300
"""Side of the surface's cells, m, and how many there are at most in each direction."""
MARGIN = 1.5
"""How far the surface reaches beyond the walk, m."""
LINES = ((2, 0xDCE2EA, 0.001), (10, 0xB4BFCC, 0.0015))
"""Cells between two lines, their colour, and their height above the surface, m."""


def surface_of(run: Run) -> Terrain | None:
    """The terrain of a run; None where its ground is flat.

    Raises:
        InputError: the metadata hold a terrain that is none.
    """
    ground = run.metadata.get("ground")
    if not isinstance(ground, dict):
        return None
    given = {name: ground[name] for name in ("slope", "terrain") if ground.get(name)}
    surface = Ground(**given).surface if given else None
    return None if surface is None or surface.record["level"][0] else surface


def about_normals(surface: Terrain | None, place: Vector, vectors: Vector) -> Vector:
    """Vectors at feet, of world axes, in the frames of the contacts: their third part is along the normal.

    Args:
        surface: of the ground; where it is None they stay as they are.
        place: (..., 3) of the feet, m.
        vectors: (..., 3).
    """
    if surface is None:
        return vectors
    normal = surface.normal(np.nan_to_num(place[..., 0]), np.nan_to_num(place[..., 1]))
    flat = np.ascontiguousarray(vectors, dtype=np.float64).reshape(-1, 3)
    return in_contact_frames(np.ascontiguousarray(normal).reshape(-1, 3), flat).reshape(vectors.shape)


def draw_surface(node: Any, path: Vector, surface: Terrain, *, colour: str) -> None:
    """Add the surface around a path, with a line every 0.1 m and a stronger one every 0.5 m.

    Args:
        node: a Meshcat visualizer at the ground's path; its parent's frame is the world's.
        path: (n, 3) points that it has to reach, world, m.
        colour: ``#rrggbb``.
    """
    low = np.floor((path[:, :2].min(axis=0) - MARGIN) / CELL).astype(int)
    high = np.ceil((path[:, :2].max(axis=0) + MARGIN) / CELL).astype(int)
    high = np.minimum(high, low + MOST_CELLS)
    x, y = (CELL * np.arange(low[axis], high[axis] + 1) for axis in range(2))
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    height = surface.height(places[..., 0].copy(), places[..., 1].copy())
    points = np.concatenate((places, height[..., None]), axis=-1)
    rows, columns = height.shape
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))])
    node["plane"].set_object(
        g.TriangularMeshGeometry(points.reshape(-1, 3).astype(np.float32), faces),
        g.MeshLambertMaterial(color=as_int(colour), side=2),
    )
    for name, (every, shade, above) in zip(("fine", "coarse"), LINES, strict=True):
        lines = _lines(points + np.array((0.0, 0.0, above)), low, every)
        node[name].set_object(
            g.LineSegments(g.PointsGeometry(lines.T.astype(np.float32)), g.LineBasicMaterial(color=shade))
        )
    for name in ("plane", "fine", "coarse"):
        set_exactly(node[name]["<object>"], "castShadow", False)


def _lines(points: Vector, low: NDArray[np.int64], every: int) -> Vector:
    """(2 segments, 3) ends of lines along the surface's grid, at whole multiples of a number of cells."""
    found = []
    for axis in range(2):
        grid = np.moveaxis(points, axis, 0)[(-low[axis]) % every :: every]
        found.append(np.stack((grid[:, :-1], grid[:, 1:]), axis=2).reshape(-1, 3))
    return np.concatenate(found)
