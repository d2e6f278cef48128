"""Friction cones: the set of forces that a foot can stand on, drawn at the foot while it is in contact."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from meshcat import geometry as g
from meshcat.animation import Animation
from numpy.typing import NDArray

from harpy_pin.log.measures import SLIDING_SPEED
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import FLOOR, FRICTION, SLIDING, as_int
from harpy_pin.view.scene.command_recorder import set_exactly
from harpy_pin.view.scene.motion import Motion, turn_z_to

__all__ = ["Shape", "cone_mesh", "cone_rim", "draw_cone", "friction_used", "outside", "sliding", "tangential_force"]

SIDES = 64
Shape = Literal["circular", "per_axis"]
"""How the ground bounds the friction; the names are those of :class:`harpy_pin.simulation.ground.Ground`."""


def cone_rim(mu: float, *, slant: float, shape: Shape = "circular") -> Vector:
    """Corners of the upper edge of a friction cone with its apex at the origin and its axis along z.

    Args:
        mu: friction coefficient; the half-angle is atan(mu).
        slant: length of the side of the circular cone, m; it fixes the height, slant · cos(atan(mu)).
        shape: ``circular``, or ``per_axis`` for the pyramid |f_x| ≤ μ f_z, |f_y| ≤ μ f_z.

    Returns:
        (corners, 3), m, counter-clockwise seen from above.
    """
    height = slant / np.hypot(1.0, mu)
    if shape == "per_axis":
        corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    else:
        angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
        corners = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    return np.column_stack((mu * height * corners, np.full(len(corners), height)))


def cone_mesh(rim: Vector) -> tuple[Vector, NDArray[np.int64]]:
    """Side surface of a cone or pyramid with its apex at the origin.

    Every face has corners of its own, so that the edges of a pyramid are drawn sharp.

    Args:
        rim: (corners, 3) :func:`cone_rim`.

    Returns:
        (3 corners, 3) vertices, m, and (corners, 3) faces.
    """
    faces = np.stack((np.zeros_like(rim), rim, np.roll(rim, -1, axis=0)), axis=1)
    return faces.reshape(-1, 3), np.arange(3 * len(rim)).reshape(-1, 3)


def sliding(force: Vector, velocity: Vector) -> NDArray[np.bool_]:
    """Whether feet slide: in contact and faster along the ground than 10 mm/s.

    Args:
        force: (..., 3) force of the ground, world axes, N.
        velocity: (..., 3) velocity of the foot, world axes, m/s.
    """
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    return np.asarray((force[..., 2] > 0.0) & (speed > SLIDING_SPEED))


def tangential_force(force: Vector, *, per_axis: bool = False) -> Vector:
    """(...,) what the ground's friction bounds, N: the length of the tangential part, or the larger of |f_x| and |f_y|.

    Args:
        force: (..., 3) force of the ground, world axes, N.
        per_axis: the bound holds for x and y apart.
    """
    sides = np.abs(force[..., :2])
    return np.asarray(sides.max(axis=-1) if per_axis else np.hypot(sides[..., 0], sides[..., 1]))


def friction_used(force: Vector, mu: Vector, *, per_axis: bool = False) -> Vector:
    """Tangential force as a share of what the friction cone allows.

    Args:
        force: (..., 3) force of the ground, world axes, N.
        mu: (...,) friction coefficient.
        per_axis: see :func:`tangential_force`.

    Returns:
        (...,): 1 on the cone, more outside; zero without contact, infinite for any tangential force where μ is zero.
    """
    tangential, normal = tangential_force(force, per_axis=per_axis), force[..., 2]
    bound = mu * np.maximum(normal, 0.0)
    share = np.divide(tangential, bound, out=np.full(bound.shape, np.inf), where=bound > 0.0)
    return np.where((normal > 0.0) & (tangential > 0.0), share, 0.0)


def outside(force: Vector, mu: Vector, *, per_axis: bool = False) -> NDArray[np.bool_]:
    """Whether forces lie outside their friction cone, by more than rounding.

    Args:
        force: (..., 3) force of the ground, world axes, N.
        mu: (...,) friction coefficient.
        per_axis: see :func:`tangential_force`.
    """
    return np.asarray(friction_used(force, mu, per_axis=per_axis) > 1.0 + 1e-6)


def draw_cone(
    node: Any,
    animation: Animation,
    time: Vector,
    foot: Vector,
    force: Vector,
    velocity: Vector,
    *,
    mu: Vector,
    slant: float,
    shape: Shape,
    floor: float | None = None,
    normal: Vector | None = None,
) -> None:
    """Add a foot's friction cone to a scene and its animation.

    It is blue while the foot sticks, and red while the foot slides or its force lies outside the cone.

    Args:
        node: a Meshcat visualizer at the cone's path; its parent's frame is the world's.
        animation: the animation to add to.
        time: (n,) time of the frames, s.
        foot: (n, 3) apex, world, m.
        force: (n, 3) force of the ground on the foot, its third part along the cone's axis, N.
        velocity: (n, 3) of the foot, likewise, m/s.
        mu: (n,) friction coefficient under the foot; where it is zero there is no cone.
        slant: length of the cone's side, m.
        shape: of the cone.
        floor: height at which a ring marks the smallest normal force that is desired, m; none where the cone ends
            below.
        normal: (n, 3) the cone's axis, world; the vertical by default.
    """
    touching = force[:, 2] > 0.0
    slides = sliding(force, velocity) | outside(force, mu, per_axis=shape == "per_axis")
    turn = None if normal is None else turn_z_to(normal)
    Motion(position=foot, quaternion=turn, visible=touching).apply(node, animation, time)
    values = np.unique(mu[mu > 0.0])
    for i, value in enumerate(values):
        suffix = "" if len(values) == 1 else f"_{i + 1}"
        rim = cone_rim(float(value), slant=slant, shape=shape)
        _draw_sides(node, suffix, animation, time, rim, shape, slides, mu == value)
        if floor is not None and floor < rim[0, 2]:
            ring = rim * (floor / rim[0, 2])
            line = g.LineBasicMaterial(color=as_int(FLOOR), linewidth=2.0)
            node["floor" + suffix].set_object(g.LineLoop(g.PointsGeometry(ring.T.astype(np.float32)), line))
            set_exactly(node["floor" + suffix]["<object>"], "castShadow", False)
            Motion(visible=mu == value).apply(node["floor" + suffix], animation, time)


def _draw_sides(
    node: Any,
    suffix: str,
    animation: Animation,
    time: Vector,
    rim: Vector,
    shape: Shape,
    slides: NDArray[np.bool_],
    here: NDArray[np.bool_],
) -> None:
    """The cone of one friction coefficient, in both colours; seen while the foot is on such ground (``here``)."""
    vertices, faces = cone_mesh(rim)
    for kind, colour, shown in (("sticking", FRICTION, ~slides & here), ("sliding", SLIDING, slides & here)):
        name = kind + suffix
        side = g.MeshBasicMaterial(color=as_int(colour), opacity=0.3, depthWrite=False)
        node[name]["side"].set_object(g.TriangularMeshGeometry(vertices, faces), side)
        set_exactly(node[name]["side/<object>"], "castShadow", False)
        edge = g.LineBasicMaterial(color=as_int(colour), linewidth=2.0)
        node[name]["rim"].set_object(g.LineLoop(g.PointsGeometry(rim.T.astype(np.float32)), edge))
        set_exactly(node[name]["rim/<object>"], "castShadow", False)
        if shape == "per_axis":
            spokes = np.stack((np.zeros_like(rim), rim), axis=1).reshape(-1, 3)
            node[name]["edges"].set_object(g.LineSegments(g.PointsGeometry(spokes.T.astype(np.float32)), edge))
            set_exactly(node[name]["edges/<object>"], "castShadow", False)
        Motion(visible=shown).apply(node[name], animation, time)
