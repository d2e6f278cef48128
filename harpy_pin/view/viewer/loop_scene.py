"""What a viewer shows of a loop: the replay's scene of one moment, with the camera following the
robot.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.scene.frames import Frames
from harpy_pin.view.scene.ground import LINES, ground_nodes
from harpy_pin.view.scene.nodes import Motion, Motions
from harpy_pin.view.scene.scene import MIDDLE, RobotScene, picture_size

FOLLOW_TIME = 0.25
"""Time constant with which the middle of the picture follows the body, s."""
LEASH = 0.5
"""Largest distance of the body from it, as a share of the picture's height."""
REACH = 4.0
"""Distance from the origin at which the ground is drawn around a robot that stands there, m."""


class LoopScene:
    """Nodes of a robot and its ground, and where they are at a moment.

    Args:
        robot: who is drawn.
        ground: of :meth:`harpy_pin.Ground.to_dict`; empty where it is not known.
        first: moment (1,) that the sizes are taken from
            (:func:`harpy_pin.view.viewer.moments.moment_type`).

    Attributes:
        robot: as given.
        size: height that has to fit in the picture, m.
        scales: of forces.
        cones: whether there are friction cones.
        nodes: of everything, by paths below the node that stands for the world's frame.
    """

    def __init__(self, robot: Robot, ground: Mapping[str, Any], first: NDArray[Any]) -> None:
        self.robot, self._metadata = robot, {"ground": ground} if ground else {}
        frames = self._frames(first)
        self.cones = frames.ground is not None
        self.size, height = picture_size(frames), float(first["q"][0, 2])
        self._drawn = RobotScene(
            robot,
            height,
            cones=self.cones,
            per_axis=frames.contacts.per_axis,
            references=("target", "applied"),
        )
        self.scales = self._drawn.scales
        around = REACH * np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]])
        self.nodes = [*ground_nodes(around, frames.ground), *self._drawn.nodes]
        self._middle = self._below(frames)

    def motions(self, moment: NDArray[Any], passed: float = np.inf) -> Motions:
        """Where everything is at a moment (1,); that of the world has the empty path.

        Args:
            moment: see :func:`harpy_pin.view.viewer.moments.moment_type`.
            passed: time since the last one was drawn, s.
        """
        frames = self._frames(moment)
        self._follow(frames, passed)
        x, y, z = self._middle
        motions = {"": Motion(position=-np.array([[x, y, z + MIDDLE * self.size]]))}
        if frames.surface is None:  # the lines of level ground go along, by whole cells
            step = LINES[-1][1]
            cell = np.append(step * np.round(self._middle[:2] / step), 0.0)
            motions |= {f"ground/{name}": Motion(position=cell[None]) for name, *_ in LINES}
        return motions | self._drawn.motions(frames)

    def _frames(self, moment: NDArray[Any]) -> Frames:
        signals = {name: moment[name] for name in moment.dtype.names or ()}
        return Frames(Run(signals, self._metadata), self.robot)

    def _below(self, frames: Frames) -> Vector:
        """(3,) the place on the ground below the body, m; above it where the body flies out of the
        picture.
        """
        place = frames["q"][0, :3].copy()
        ground = (
            0.0
            if frames.surface is None
            else float(frames.surface.height(place[:1].copy(), place[1:2].copy())[0])
        )
        place[2] = max(ground, place[2] - LEASH * self.size)
        return np.asarray(place)

    def _follow(self, frames: Frames, passed: float) -> None:
        """Move the middle of the picture after the body."""
        gap = self._below(frames) - self._middle
        distance = max(float(np.linalg.norm(gap)), 1e-9)
        remaining = min(float(np.exp(-passed / FOLLOW_TIME)), LEASH * self.size / distance)
        self._middle = self._middle + (1.0 - remaining) * gap
