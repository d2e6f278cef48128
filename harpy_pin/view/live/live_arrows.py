"""Arrows of forces in viser: one mesh of unit length each, placed, turned and stretched."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import viser
from numpy.typing import NDArray

from harpy_pin.model.state import Vector
from harpy_pin.view.scene.motion import turn_z_to

__all__ = ["Arrow"]

SIDES = 24
SHAFT = 0.8
"""Share of the length that the shaft has; the head has the rest."""
HEAD_WIDTH = 2.4
"""Radius of the head in radii of the shaft."""
SHORTEST, SLENDER = 0.015, 0.15
"""Length below which an arrow is not drawn, and below which it becomes thinner, m."""


class Arrow:
    """One arrow; a force too short to be seen is not drawn.

    Args:
        scene: of viser.
        name: of its node.
        colour: red, green, blue.
        radius: of the shaft, m.
    """

    def __init__(self, scene: viser.SceneApi, name: str, colour: tuple[int, int, int], radius: float) -> None:
        vertices, faces = _mesh(radius)
        self._node = scene.add_mesh_simple(
            name, vertices, faces, color=colour, side="double", cast_shadow=False, receive_shadow=False, visible=False
        )

    def show(self, tail: Vector, force: Vector, *, metres_per_newton: float) -> None:
        """Draw a force.

        Args:
            tail: (3,) where it acts, in the scene, m.
            force: (3,) N.
            metres_per_newton: scale.
        """
        strength = float(np.linalg.norm(force))
        length = strength * metres_per_newton
        shown = length > SHORTEST
        if self._node.visible != shown:
            self._node.visible = shown
        if shown:
            x, y, z, w = turn_z_to(force[None] / strength)[0].tolist()
            width = min(1.0, length / SLENDER)
            self._node.position, self._node.wxyz = tail, (w, x, y, z)
            self._node.scale = width, width, length


def _mesh(radius: float) -> tuple[Vector, NDArray[np.int64]]:
    """An arrow from z = 0 to z = 1: lower end, shaft, shoulder and head, as rings that are joined."""
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    circle = np.stack((np.cos(angle), np.sin(angle), np.zeros(SIDES)), axis=1)
    profile = ((0.0, 0.0), (1.0, 0.0), (1.0, SHAFT), (HEAD_WIDTH, SHAFT), (0.0, 1.0))
    rings = [radius * width * circle + np.array((0.0, 0.0, height)) for width, height in profile]
    # Rings where the surface bends are there twice, so that the edge is drawn sharp.
    vertices = np.concatenate([ring for pair in pairwise(rings) for ring in pair])
    here, there = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    band = np.concatenate(
        (np.stack((here, there, SIDES + there), axis=1), np.stack((here, SIDES + there, SIDES + here), axis=1))
    )
    return vertices, np.concatenate([band + 2 * SIDES * k for k in range(len(profile) - 1)])
