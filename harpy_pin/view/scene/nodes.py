"""What a scene is made of: nodes with a shape and a look, and how they move.

Nodes are named by paths; what moves moves all below it, and what is hidden hides it. A backend
translates nodes and motions, and knows nothing of robots:
:mod:`harpy_pin.view.scene.meshcat_backend` for replays, and
:mod:`harpy_pin.contrib.live.live_scene` for the live page.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from harpy_pin.model.state import Vector

SIDES = 24


@dataclass(frozen=True)
class Box:
    """Its sides along x, y and z, m."""

    size: tuple[float, float, float]


@dataclass(frozen=True)
class Sphere:
    """Its radius, m."""

    radius: float


@dataclass(frozen=True)
class Cylinder:
    """Its length along z, about the origin, and its radius, m."""

    length: float
    radius: float


@dataclass(frozen=True, eq=False)
class Mesh:
    """(n, 3) corners, m, and (m, 3) triangles. On bodies all edges are sharp, else those where no
    corner is shared.
    """

    vertices: Vector
    faces: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Lines:
    """(n, 2, 3) ends of segments, m; short ones, as some renderers lose lines that pass the
    camera.
    """

    points: Vector


Shape: TypeAlias = Box | Sphere | Cylinder | Mesh | Lines


@dataclass(frozen=True)
class Look:
    """How a node looks."""

    colour: str  # #rrggbb
    opacity: float = 1.0  # between 0 and 1
    # body is lit and casts a shadow, ground is lit, bright glows, even has its colour whatever the
    # light, and shadow
    # shows nothing but shadows
    light: Literal["body", "ground", "bright", "even", "shadow"] = "even"
    # draws it through whatever stands before it, the larger the later; not where it is 0
    in_front: int = 0


@dataclass(frozen=True, eq=False)
class Node:
    """Something that is drawn."""

    path: str  # of names and slashes; its first names may be those of nodes that move
    shape: Shape  # in the node's own frame
    look: Look  # of it
    # (4, 4) in the frame of the node above; of a node that does not move by itself
    placement: Vector = field(default_factory=lambda: np.eye(4))


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """Where a node is at each of n moments, relative to the one above; what is None stays as it
    is.
    """

    position: Vector | None = None  # (n, 3), m
    quaternion: Vector | None = None  # (n, 4) x, y, z, w
    scale: Vector | None = None  # (n, 3), of a node that has a shape itself and no other below it
    visible: NDArray[np.bool_] | None = None  # (n,)


Motions: TypeAlias = dict[str, Motion]


def from_matrices(matrices: Vector) -> Motion:
    """Motion of a rigid body from (n, 4, 4) placements."""
    quaternion = Rotation.from_matrix(matrices[:, :3, :3]).as_quat()
    return Motion(position=np.ascontiguousarray(matrices[:, :3, 3]), quaternion=quaternion)


def turn_z_to(directions: Vector) -> Vector:
    """(n, 4) quaternions x, y, z, w of the shortest rotations that turn the z axis onto (n, 3) unit
    vectors.
    """
    x, y, z = directions.T
    quaternion = np.stack((-y, x, np.zeros_like(x), 1.0 + z), axis=1)
    quaternion[1.0 + z < 1e-9] = (1.0, 0.0, 0.0, 0.0)
    return np.asarray(quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True))


def shifted(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Vector:
    """(4, 4) placement without rotation."""
    placement = np.eye(4)
    placement[:3, 3] = x, y, z
    return placement


def revolved(profile: Sequence[tuple[float, float]]) -> Mesh:
    """A surface about the z axis.

    Args:
        profile: radius and height of its circles, m, from the lower end to the upper one; it has an
            edge at each.
    """
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    circle = np.stack((np.cos(angle), np.sin(angle), np.zeros(SIDES)), axis=1)
    rings = [radius * circle + (0.0, 0.0, height) for radius, height in profile]
    vertices = np.concatenate([ring for pair in pairwise(rings) for ring in pair])
    here, there = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    band = np.concatenate(
        (
            np.stack((here, there, SIDES + there), axis=1),
            np.stack((here, SIDES + there, SIDES + here), axis=1),
        )
    )
    return Mesh(vertices, np.concatenate([band + 2 * SIDES * k for k in range(len(profile) - 1)]))


def node_name(name: str) -> str:
    """A name without the characters that mean something in a path of the scene."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name) or "unnamed"
