"""Forces: arrows, and the friction cones that the ground's forces on feet must stay in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.log.measures import SLIDING_SPEED
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import FLOOR, FRICTION, SLIDING
from harpy_pin.view.scene.nodes import Lines, Look, Mesh, Motion, Motions, Node, revolved, turn_z_to

__all__ = ["Arrow", "Cone", "friction_used", "nice_scale", "sliding", "tangential_force"]

HEAD_LENGTH, HEAD_WIDTH = 3.2, 2.4
"""Length and diameter of an arrow's head in shaft diameters."""
SIDES = 64
ROUNDING = 1.0 + 1e-6


class Arrow:
    """Arrow of a force: it starts at a point, points along the force, and is as long as the force is strong.

    One shorter than its head consists of a head alone, smaller in proportion; one shorter than a hundredth of it is not
    drawn.

    Args:
        path: of its node.
        colour: ``#rrggbb``.
        radius: of the shaft, m.
        metres_per_newton: scale.

    Attributes:
        nodes: a shaft from z = 0 to z = 1, which is stretched, and a head from z = 0 on.
        head: length of the head, m.
    """

    def __init__(self, path: str, colour: str, *, radius: float, metres_per_newton: float) -> None:
        self._path, self._scale = path, metres_per_newton
        self.head = 2.0 * radius * HEAD_LENGTH
        look = Look(colour, light="bright", in_front=5)
        self.nodes = [
            Node(f"{path}/shaft", revolved([(0.0, 0.0), (radius, 0.0), (radius, 1.0)]), look),
            Node(f"{path}/head", revolved([(0.0, 0.0), (radius * HEAD_WIDTH, 0.0), (0.0, self.head)]), look),
        ]

    def motions(self, origin: Vector, force: Vector) -> Motions:
        """Motion of the arrow from (n, 3) points, m, and forces, N."""
        strength = np.linalg.norm(force, axis=1)
        length = strength * self._scale
        shown = length > 0.01 * self.head
        direction = np.where(shown[:, None], force / np.where(shown, strength, 1.0)[:, None], (0.0, 0.0, 1.0))
        small = np.clip(length / self.head, 0.01, 1.0)
        shaft = np.maximum(length - self.head, 0.0)
        zero = np.zeros_like(length)
        return {
            self._path: Motion(position=origin, quaternion=turn_z_to(direction), visible=shown),
            f"{self._path}/shaft": Motion(
                scale=np.stack((small, small, np.maximum(shaft, 1e-4)), axis=1), visible=shaft > 0.0
            ),
            f"{self._path}/head": Motion(
                position=np.stack((zero, zero, shaft), axis=1), scale=np.repeat(small[:, None], 3, axis=1)
            ),
        }


class Cone:
    """Friction cone of a foot: blue while the foot sticks, red while it slides or its force lies outside.

    Args:
        path: of its node.
        slant: length of the side of the circular cone, m.
        per_axis: the pyramid |f_x| ≤ μ f_z, |f_y| ≤ μ f_z instead of a circular cone.
        floor: height at which a ring marks the smallest normal force that is desired, m; none where the cone ends
            below.
        full: share of its friction from which on a force counts as outside.

    Attributes:
        nodes: of half-angle 45° and height 1, stretched as the friction is.
    """

    def __init__(
        self, path: str, *, slant: float, per_axis: bool = False, floor: float | None = None, full: float = ROUNDING
    ) -> None:
        self._path, self._slant, self._per_axis, self._floor, self._full = path, slant, per_axis, floor, full
        if per_axis:
            corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
        else:
            angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
            corners = np.stack((np.cos(angle), np.sin(angle)), axis=1)
        rim = np.column_stack((corners, np.ones(len(corners))))
        ring, spokes = np.stack((rim, np.roll(rim, -1, axis=0)), axis=1), np.stack((np.zeros_like(rim), rim), axis=1)
        triangles = np.concatenate((np.zeros((len(rim), 1, 3)), ring), axis=1)  # unshared corners: sharp edges
        side = Mesh(triangles.reshape(-1, 3), np.arange(3 * len(rim)).reshape(-1, 3))
        edges = Lines(np.concatenate((ring, spokes)) if per_axis else ring)
        self.nodes = [
            Node(f"{path}/{kind}/{name}", shape, Look(colour, opacity))
            for kind, colour in (("sticking", FRICTION), ("sliding", SLIDING))
            for name, shape, opacity in (("side", side, 0.3), ("edges", edges, 1.0))
        ]
        if floor is not None:
            self.nodes.append(Node(f"{path}/floor", Lines(ring), Look(FLOOR)))

    def motions(self, foot: Vector, force: Vector, velocity: Vector, mu: Vector, normal: Vector | None) -> Motions:
        """Motion of the cone.

        Args:
            foot: (n, 3) apex, world, m.
            force: (n, 3) of the ground on the foot, its third part along the cone's axis, N.
            velocity: (n, 3) of the foot, in the same axes, m/s.
            mu: (n,) friction coefficient under the foot; where it is zero there is no cone.
            normal: (n, 3) the cone's axis, world; None is the vertical.
        """
        slides = sliding(force, velocity) | (friction_used(force, mu, per_axis=self._per_axis) > self._full)
        height = self._slant / np.hypot(1.0, mu)
        scale = np.stack((mu * height, mu * height, height), axis=1)
        motions = {
            self._path: Motion(
                position=foot,
                quaternion=None if normal is None else turn_z_to(normal),
                visible=(force[:, 2] > 0.0) & (mu > 0.0),
            )
        }
        for kind, shown in (("sticking", ~slides), ("sliding", slides)):
            motions[f"{self._path}/{kind}"] = Motion(visible=shown)
            for name in ("side", "edges"):
                motions[f"{self._path}/{kind}/{name}"] = Motion(scale=np.maximum(scale, 1e-6))
        if self._floor is not None:
            ring = self._floor * np.stack((mu, mu, np.ones_like(mu)), axis=1)
            motions[f"{self._path}/floor"] = Motion(scale=np.maximum(ring, 1e-6), visible=self._floor < height)
        return motions


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


def nice_scale(newtons_per_metre: float) -> float:
    """The nearest of 1, 2, 5, 10, 20, … N/m below or at a scale, so that a legend can name it."""
    if not np.isfinite(newtons_per_metre) or newtons_per_metre <= 0.0:
        return 100.0
    decade = 10.0 ** np.floor(np.log10(newtons_per_metre))
    steps = [s for s in (1.0, 2.0, 5.0) if s * decade <= newtons_per_metre * (1.0 + 1e-12)]
    return float(steps[-1] * decade)
