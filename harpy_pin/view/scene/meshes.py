"""Meshes of a robot's visuals as they are drawn: in the colours of their files, and with no more
triangles than needed.

The mesh files of many robots hold several geometries, each with a material of its own. Pinocchio
reads them as one mesh without colours; they are read by trimesh, where it is installed (the extra
``robots``), and drawn part by part.
"""

import warnings
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import coal  # type: ignore[import-untyped]
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.errors import install_line
from harpy_pin.model.state import Vector
from harpy_pin.view.scene.nodes import Mesh

MAX_TRIANGLES = 8000
"""Most triangles of a mesh: what a replay page can hold of every link, and more than is seen of
it.
"""
FINEST = 1.0 / 300.0
"""Size of the first cells in which corners are merged, beside that of the mesh."""
CELLS = 1 << 10
"""More than there are along one side."""
COARSER = 1.25
"""Growth of these cells until there are few enough triangles."""
SAME_PLACE = 2e-3
"""Largest distance between the bounds of a mesh as Pinocchio and as trimesh read it, m."""
WHITE = 0.9
"""Brightness from which on the colour in a URDF is none."""
COLOURED = (".dae", ".obj", ".glb", ".gltf")
"""Mesh files that may hold colours."""
Colour: TypeAlias = tuple[float, float, float, float]
"""Red, green, blue and opacity, between 0 and 1."""


def mesh_parts(shape: pin.GeometryObject) -> list[tuple[Mesh, Colour]]:
    """The parts of a shape that is a mesh, in its frame, and the colours that they are drawn in.

    The colour of the URDF comes first, but for one that is white or missing, and for files of
    several colours.
    """
    red, green, blue, alpha = (float(np.clip(c, 0.0, 1.0)) for c in shape.meshColor)
    vertices = np.asarray(shape.geometry.vertices(), dtype=float)
    path, scale = str(shape.meshPath), tuple(float(s) for s in shape.meshScale)
    read = _read_parts(path, scale)
    if read is None or np.max(np.abs(read[1] - _bounds(vertices))) > SAME_PLACE:
        faces = _faces(shape.geometry)
        # Of a file with several geometries Pinocchio numbers the corners of each from zero: those
        # of the last ones are
        # left over.
        if len(np.unique(faces)) < len(vertices):
            _warn_of_wrong_surfaces()
        return [(thin_out(Mesh(vertices, faces), MAX_TRIANGLES), (red, green, blue, alpha))]
    plain = not shape.overrideMaterial or min(red, green, blue) > WHITE
    if Path(path).suffix.lower() in COLOURED and (plain or len(read[0]) > 1):
        return read[0]
    return [(mesh, (red, green, blue, alpha)) for mesh, _ in read[0]]


def thin_out(mesh: Mesh, most: int) -> Mesh:
    """A mesh of at most so many triangles: corners in the same cell of a grid become one, in their
    middle.
    """
    vertices, faces = mesh.vertices, mesh.faces
    if len(faces) <= most:
        return mesh
    low = vertices.min(axis=0)
    cell = FINEST * float(np.ptp(vertices, axis=0).max())
    while True:
        x, y, z = np.floor((vertices - low) / cell).astype(np.int64).T
        _, place, count = np.unique(
            (x * CELLS + y) * CELLS + z, return_inverse=True, return_counts=True
        )
        kept = place[faces]
        flat = (kept[:, 0] == kept[:, 1]) | (kept[:, 1] == kept[:, 2]) | (kept[:, 2] == kept[:, 0])
        kept = np.unique(kept[~flat], axis=0)
        if len(kept) <= most:
            break
        cell *= COARSER
    middles = np.zeros((len(count), 3))
    np.add.at(middles, place, vertices)
    return Mesh(middles / count[:, None], kept)


@lru_cache(maxsize=256)
def _read_parts(
    path: str, scale: tuple[float, ...]
) -> tuple[list[tuple[Mesh, Colour]], Vector] | None:
    """The parts of a file by colour, and the (2, 3) bounds of all; None without trimesh, or if it
    cannot read it.
    """
    try:
        import trimesh
    except ImportError:
        return None
    try:
        meshes: list[Any] = trimesh.load_scene(path).dump()
        by_colour: dict[Colour, list[Any]] = {}
        for mesh in meshes:
            by_colour.setdefault(_colour(mesh), []).append(mesh)
    except (
        Exception
    ):  # a stranger's reader, whose errors are of all kinds: the shape is drawn without its colours
        return None
    total = sum(len(mesh.faces) for mesh in meshes)
    parts, corners = [], []
    for colour, group in by_colour.items():
        whole: Any = trimesh.util.concatenate(group)
        most = max(int(MAX_TRIANGLES * len(whole.faces) / max(total, 1)), 50)
        vertices = np.array(scale) * np.asarray(whole.vertices, dtype=float)
        corners.append(vertices)
        parts.append((thin_out(Mesh(vertices, np.asarray(whole.faces)), most), colour))
    return (parts, _bounds(np.concatenate(corners))) if parts else None


@cache
def _warn_of_wrong_surfaces() -> None:
    """Say once that meshes are drawn from wrong triangles."""
    warnings.warn(
        f"meshes of several parts are drawn with wrong surfaces: {install_line('robots')}",
        stacklevel=2,
    )


def _colour(mesh: Any) -> Colour:
    """Colour of a mesh of trimesh's, which raises where it has none: of its material, or the mean
    of its texture.
    """
    colours = mesh.visual.to_color().vertex_colors
    red, green, blue, alpha = (float(c) for c in np.mean(np.atleast_2d(colours), axis=0) / 255.0)
    return round(red, 2), round(green, 2), round(blue, 2), round(alpha, 2)


def _bounds(vertices: Vector) -> Vector:
    """(2, 3) least and largest coordinates, m."""
    return np.array([vertices.min(axis=0), vertices.max(axis=0)])


def _faces(geometry: coal.BVHModelBase) -> NDArray[np.int64]:
    """(m, 3) triangles of Pinocchio's mesh, which it gives one by one."""
    triangles = (geometry.tri_indices(k) for k in range(geometry.num_tris))
    return np.array(
        [[triangle[i] for i in range(3)] for triangle in triangles], dtype=np.int64
    ).reshape(-1, 3)
