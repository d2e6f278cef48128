"""Keyframes: how a node of the scene moves, as arrays with one row per frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from meshcat.animation import Animation, AnimationClip, AnimationTrack
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from harpy_pin.model.state import Vector

__all__ = ["Motion", "from_matrices", "turn_z_to"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Motion:
    """Keyframes of one node, relative to its parent; what is None stays as it is.

    Attributes:
        position: (n, 3), m.
        quaternion: (n, 4) x, y, z, w.
        scale: (n, 3).
        visible: (n,).
    """

    position: Vector | None = None
    quaternion: Vector | None = None
    scale: Vector | None = None
    visible: NDArray[np.bool_] | None = None

    def apply(self, node: Any, animation: Animation, time: Vector) -> None:
        """Put a node at its first frame and, where there is more than one, add the others to an animation.

        Args:
            node: a Meshcat visualizer at the node's path.
            animation: the animation to add to.
            time: (n,) time of the frames, s.
        """
        fps = animation.default_framerate
        keys = [float(t) * fps for t in time]
        tracks = {}
        for name, kind, values in (
            ("position", "vector3", self.position),
            ("quaternion", "quaternion", self.quaternion),
            ("scale", "vector3", self.scale),
            ("visible", "boolean", self.visible),
        ):
            if values is None:
                continue
            rows = values.tolist()
            node.set_property(name, rows[0])
            tracks[name] = AnimationTrack(name, kind, keys, rows)
        if len(keys) > 1:
            animation.clips[node.path] = AnimationClip(tracks, fps=fps)


def from_matrices(matrices: Vector) -> Motion:
    """Motion of a rigid body.

    Args:
        matrices: (n, 4, 4) placements.
    """
    quaternion = Rotation.from_matrix(matrices[:, :3, :3]).as_quat()
    return Motion(position=np.ascontiguousarray(matrices[:, :3, 3]), quaternion=quaternion)


def turn_z_to(directions: Vector) -> Vector:
    """Quaternions of the shortest rotations that turn the z axis onto directions.

    Args:
        directions: (n, 3) unit vectors.

    Returns:
        (n, 4) x, y, z, w.
    """
    x, y, z = directions.T
    quaternion = np.stack((-y, x, np.zeros_like(x), 1.0 + z), axis=1)
    quaternion[1.0 + z < 1e-9] = (1.0, 0.0, 0.0, 0.0)
    return np.asarray(quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True))
