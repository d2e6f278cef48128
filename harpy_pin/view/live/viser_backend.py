"""Nodes and motions as viser draws them: what has changed is sent to the pages."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import viser

from harpy_pin.model.state import Vector
from harpy_pin.view.palette import as_rgb
from harpy_pin.view.scene.nodes import Box, Cylinder, Lines, Motions, Node, Sphere, from_matrices

__all__ = ["ViserScene"]

EDGE = 1.5
"""Width of lines, pixels."""


class ViserScene:
    """Nodes below a frame that stands for the world's.

    Args:
        scene: of viser.

    Attributes:
        handles: of nodes that cast a shadow: the robot.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene, self.handles = scene, list[Any]()
        self._by_path: dict[str, Any] = {"": scene.add_frame("/walk", show_axes=False)}

    def add(self, nodes: Iterable[Node]) -> None:
        """Draw nodes."""
        for node in nodes:
            for place, character in enumerate(node.path):
                if character == "/" and node.path[:place] not in self._by_path:
                    above = self._scene.add_frame(f"/walk/{node.path[:place]}", show_axes=False)
                    self._by_path[node.path[:place]] = above
            handle = self._by_path[node.path] = self._draw(node)
            if node.look.light == "body":
                self.handles.append(handle)

    def move(self, motions: Motions) -> None:
        """Put nodes where they are at the first of n moments; what is hidden stays where it was."""
        for path, motion in motions.items():
            handle = self._by_path.get(path)
            if handle is None:  # a joint without shapes
                continue
            if motion.visible is not None:
                shown = bool(motion.visible[0])
                if handle.visible != shown:
                    handle.visible = shown
                if not shown:
                    continue
            if motion.position is not None and not np.array_equal(handle.position, motion.position[0]):
                handle.position = motion.position[0]
            if motion.quaternion is not None:
                x, y, z, w = motion.quaternion[0].tolist()
                if not np.array_equal(handle.wxyz, (w, x, y, z)):
                    handle.wxyz = w, x, y, z
            if motion.scale is not None and not np.allclose(handle.scale, motion.scale[0], rtol=0.0, atol=1e-6):
                handle.scale = tuple(motion.scale[0].tolist())

    def _draw(self, node: Node) -> Any:
        scene, shape, look, name = self._scene, node.shape, node.look, f"/walk/{node.path}"
        place = _place(node.placement)
        if isinstance(shape, Lines):
            return scene.add_line_segments(
                name, shape.points, as_rgb(look.colour), thickness=EDGE, thickness_units="screen", **place
            )
        body = look.light == "body"
        place |= {"color": as_rgb(look.colour), "cast_shadow": body, "receive_shadow": body}
        place |= {"opacity": look.opacity if look.opacity < 1.0 else None}
        if isinstance(shape, Box):
            return scene.add_box(name, dimensions=shape.size, **place)
        if isinstance(shape, Sphere):
            return scene.add_icosphere(name, radius=shape.radius, **place)
        if isinstance(shape, Cylinder):
            return scene.add_cylinder(name, radius=shape.radius, height=shape.length, **place)
        return scene.add_mesh_simple(
            name, shape.vertices, shape.faces, flat_shading=body, side="front" if body else "double", **place
        )


def _place(placement: Vector) -> dict[str, Any]:
    """Position and quaternion of a placement, as viser takes them."""
    motion = from_matrices(placement[None])
    assert motion.position is not None
    assert motion.quaternion is not None
    x, y, z, w = motion.quaternion[0].tolist()
    return {"position": tuple(motion.position[0].tolist()), "wxyz": (w, x, y, z)}
