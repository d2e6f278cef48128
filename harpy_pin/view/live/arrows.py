"""Arrows of forces in viser: made once, then placed, turned and stretched."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray

from harpy_pin.model.state import Vector
from harpy_pin.view.scene.arrows import arrow_motion
from harpy_pin.view.scene.motion import Motion

__all__ = ["Arrow"]

SIDES = 24


class Arrow:
    """One arrow; a force too short to be seen is not drawn.

    Args:
        scene: of viser.
        name: of its node.
        colour: red, green, blue.
        radius: of the shaft, m.
    """

    def __init__(self, scene: viser.SceneApi, name: str, colour: tuple[int, int, int], radius: float) -> None:
        self._head_length = 6.0 * radius
        self._whole = scene.add_frame(name, show_axes=False, visible=False)
        self._shaft, self._head = (
            scene.add_mesh_simple(
                f"{name}/{part}", *mesh, color=colour, flat_shading=True, cast_shadow=False, receive_shadow=False
            )
            for part, mesh in (("shaft", _rod(radius)), ("head", _head(2.4 * radius, self._head_length)))
        )

    def show(self, tail: Vector, force: Vector, *, metres_per_newton: float) -> None:
        """Draw a force.

        Args:
            tail: (3,) where it acts, in the scene, m.
            force: (3,) N.
            metres_per_newton: scale.
        """
        motion = arrow_motion(tail[None], force[None], metres_per_newton=metres_per_newton, head=self._head_length)
        whole, shaft, head = (_first(part) for part in (motion.whole, motion.shaft, motion.head))
        if self._whole.visible != whole["visible"]:
            self._whole.visible = whole["visible"]
        if not whole["visible"]:
            return
        x, y, z, w = whole["quaternion"]
        self._whole.position, self._whole.wxyz = whole["position"], (w, x, y, z)
        thick, _, length = shaft["scale"]
        self._shaft.scale = thick, thick, length
        self._head.position, self._head.scale = head["position"], tuple(head["scale"])


def _first(motion: Motion) -> dict[str, Any]:
    """The first row of what a motion says."""
    parts = {name: getattr(motion, name) for name in ("position", "quaternion", "scale", "visible")}
    return {name: values[0].tolist() for name, values in parts.items() if values is not None}


def _rod(radius: float) -> tuple[Vector, NDArray[np.int64]]:
    """The side of a cylinder from z = 0 to z = 1, with its lower end."""
    ring = _ring(radius)
    vertices = np.vstack((ring, ring + np.array((0.0, 0.0, 1.0)), np.zeros(3)))
    here, there = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    sides = (np.stack((here, there, SIDES + there), axis=1), np.stack((here, SIDES + there, SIDES + here), axis=1))
    return vertices, np.vstack((*sides, np.stack((there, here, np.full(SIDES, 2 * SIDES)), axis=1)))


def _ring(radius: float) -> Vector:
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    return np.stack((radius * np.cos(angle), radius * np.sin(angle), np.zeros(SIDES)), axis=1)


def _head(radius: float, length: float) -> tuple[Vector, NDArray[np.int64]]:
    """A cone that stands on z = 0 and points along z, with its base."""
    vertices = np.vstack((_ring(radius), (0.0, 0.0, length), (0.0, 0.0, 0.0)))
    here, there = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    sides = np.stack((here, there, np.full(SIDES, SIDES)), axis=1)
    base = np.stack((there, here, np.full(SIDES, SIDES + 1)), axis=1)
    return vertices, np.vstack((sides, base))
