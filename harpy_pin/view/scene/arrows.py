"""Force arrows: made once with unit length, then placed, turned and stretched frame by frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from meshcat import geometry as g
from meshcat.animation import Animation

from harpy_pin.model.state import Vector
from harpy_pin.view.palette import as_int
from harpy_pin.view.scene.command_recorder import set_exactly
from harpy_pin.view.scene.motion import Motion, turn_z_to

__all__ = ["ArrowMotion", "arrow_motion", "draw_arrow", "nice_scale"]

HEAD_LENGTH = 3.2
"""Length of an arrow's head in shaft diameters."""
HEAD_WIDTH = 2.4
"""Diameter of an arrow's head in shaft diameters."""
Y_TO_Z = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Turns the axis of Meshcat's cylinders, y, to z."""


@dataclass(frozen=True, eq=False)
class ArrowMotion:
    """Motion of an arrow's three nodes.

    Attributes:
        whole: of the arrow; its z axis points along the force. Relative to the world.
        shaft: of a shaft of unit length from z = 0 to z = 1. Relative to the whole.
        head: of a head of its nominal length that begins at z = 0. Relative to the whole.
    """

    whole: Motion
    shaft: Motion
    head: Motion


def arrow_motion(origin: Vector, force: Vector, *, metres_per_newton: float, head: float) -> ArrowMotion:
    """Arrows that start at a point, point along a force, and are as long as it is strong.

    A force shorter than a hundredth of a head, or zero, is not drawn. An arrow shorter than its head consists of a
    head alone, smaller in proportion.

    Args:
        origin: (n, 3) tail of the arrow, world, m.
        force: (n, 3) world axes, N.
        metres_per_newton: scale.
        head: nominal length of the head, m.
    """
    strength = np.linalg.norm(force, axis=1)
    length = strength * metres_per_newton
    shown = length > 0.01 * head
    direction = np.where(shown[:, None], force / np.where(shown, strength, 1.0)[:, None], (0.0, 0.0, 1.0))
    small = np.clip(length / head, 0.01, 1.0)
    shaft = np.maximum(length - head, 0.0)
    zero = np.zeros_like(length)
    return ArrowMotion(
        whole=Motion(position=origin, quaternion=turn_z_to(direction), visible=shown),
        shaft=Motion(scale=np.stack((small, small, np.maximum(shaft, 1e-4)), axis=1), visible=shaft > 0.0),
        head=Motion(position=np.stack((zero, zero, shaft), axis=1), scale=np.repeat(small[:, None], 3, axis=1)),
    )


def draw_arrow(
    node: Any,
    animation: Animation,
    time: Vector,
    origin: Vector,
    force: Vector,
    *,
    colour: str,
    metres_per_newton: float,
    radius: float,
    in_front: bool = False,
) -> None:
    """Add an arrow to a scene and its animation.

    Args:
        node: a Meshcat visualizer at the arrow's path; its parent's frame is the world's.
        animation: the animation to add to.
        time: (n,) time of the frames, s.
        origin: (n, 3) tail of the arrow, world, m.
        force: (n, 3) world axes, N.
        colour: ``#rrggbb``.
        metres_per_newton: scale.
        radius: of the shaft, m.
        in_front: draw it through whatever stands before it.
    """
    head = 2.0 * radius * HEAD_LENGTH
    material = g.MeshLambertMaterial(
        color=as_int(colour),
        emissive=as_int(colour),
        emissiveIntensity=0.4 if in_front else 0.2,
        side=0,
        transparent=in_front,
        depthTest=not in_front,
    )
    lift = np.eye(4)
    lift[2, 3] = 0.5
    node["shaft/rod"].set_object(g.Cylinder(1.0, radius), material)
    node["shaft/rod"].set_transform(lift @ Y_TO_Z)
    lift[2, 3] = 0.5 * head
    # A cylinder with an upper radius of zero; y, its axis, is turned to z.
    cone = g.Cylinder(head, radiusTop=0.0, radiusBottom=radius * HEAD_WIDTH)
    node["head/cone"].set_object(cone, material)
    node["head/cone"].set_transform(lift @ Y_TO_Z)
    for part in ("shaft/rod/<object>", "head/cone/<object>"):
        set_exactly(node[part], "castShadow", False)
        if in_front:
            set_exactly(node[part], "renderOrder", 5)
    motion = arrow_motion(origin, force, metres_per_newton=metres_per_newton, head=head)
    motion.whole.apply(node, animation, time)
    motion.shaft.apply(node["shaft"], animation, time)
    motion.head.apply(node["head"], animation, time)


def nice_scale(newtons_per_metre: float) -> float:
    """The nearest of 1, 2, 5, 10, 20, … N/m below or at a scale, so that a legend can name it."""
    if not np.isfinite(newtons_per_metre) or newtons_per_metre <= 0.0:
        return 100.0
    decade = 10.0 ** np.floor(np.log10(newtons_per_metre))
    steps = [s for s in (1.0, 2.0, 5.0) if s * decade <= newtons_per_metre * (1.0 + 1e-12)]
    return float(steps[-1] * decade)
