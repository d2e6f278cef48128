"""The scene of a run: robot, ground, forces in their friction cones and references, and how they
move.

The camera follows the walk: the node of the world slides the other way, so that the robot stays in
front of a camera that stands still, and turning the view with the mouse turns it about the robot.
"""

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import APPLIED, BODY, ESTIMATE, TARGET
from harpy_pin.view.scene.forces import Forces, Scales
from harpy_pin.view.scene.frames import Frames, normal_floor
from harpy_pin.view.scene.ground import (
    ground_nodes,
    marks,
    pressure_motions,
    pressure_nodes,
    slip_marks,
)
from harpy_pin.view.scene.nodes import Lines, Look, Motion, Motions, Node, Sphere
from harpy_pin.view.scene.robot_nodes import RobotNodes

FLIES, MOST_RISE = 0.2, 5.0
"""Rise of the body above the ground from which on the picture shows more, m, and up to which it
does.
"""
MIDDLE = 0.32
"""Height of the picture's middle above the ground, as a share of what fits."""
WINDOW = 1.5
"""Time over which the camera's path is averaged, s: two steps of the gait."""
BALLS = (
    ("target", TARGET, 0.030),
    ("applied", APPLIED, 0.023),
    ("estimate", ESTIMATE, 0.019),
    ("body", BODY, 0.016),
)
"""References, their colours, and their balls' radius as a share of the robot's height."""


@dataclass
class Scene:
    """What is drawn of a run."""

    size: float  # height that has to fit in the picture, m
    nodes: list[Node] = field(
        default_factory=list
    )  # by paths below the node that stands for the world's frame
    # one row for each frame, by the nodes' paths; that of the world has the empty path
    motions: Motions = field(default_factory=dict)


class RobotScene:
    """What shows a robot at any moment: links, forces in their friction cones, centre of pressure,
    references.

    Args:
        robot: who is drawn.
        height: of its body above the ground, m: the size of all that is not a link.
        cones: draw friction cones.
        references: places that are drawn, of those in :data:`BALLS`; the body is one where there is
            any.
        cone: further arguments of :class:`~harpy_pin.view.scene.forces.Forces`.

    Attributes:
        scales: of forces.
        nodes: of everything.
    """

    def __init__(
        self,
        robot: Robot,
        height: float,
        *,
        cones: bool,
        references: Collection[str] = (),
        **cone: Any,
    ) -> None:
        self.scales = Scales.of(robot, height)
        self._robot = RobotNodes(robot, height)
        self._forces = Forces(robot, self.scales, cones=cones, **cone)
        self._balls = [label for label, *_ in BALLS if label in references]
        self._balls += ["body"] if self._balls else []
        balls = [
            Node(
                f"reference/{label}",
                Sphere(radius * self.scales.height),
                Look(
                    colour, light="bright", in_front=10 + order
                ),  # through the body that they are in
            )
            for order, (label, colour, radius) in enumerate(BALLS)
            if label in self._balls
        ]
        self.nodes = [
            *pressure_nodes(self.scales.height),
            *self._robot.nodes,
            *self._forces.nodes,
            *balls,
        ]

    def motions(self, frames: Frames) -> Motions:
        """Where everything is at each of the frames."""
        contacts, surface = frames.contacts[frames.rows], frames.surface
        x, y = (contacts.position[..., axis].copy() for axis in range(2))
        normal = None if surface is None else surface.normal(x, y)
        forces = (frames["foot_force"], normal, frames.mount, frames["thrust"])
        motions = pressure_motions(frames) | self._robot.motions(frames.joints)
        motions |= self._forces.motions(contacts, *forces)
        places = {label: points[frames.rows] for label, points in frames.references.items()}
        known = {
            label: np.asarray(np.isfinite(points).all(axis=1)) for label, points in places.items()
        }
        if places:
            places["body"], known["body"] = frames["q"][:, :3], np.any(list(known.values()), axis=0)
        for label in self._balls:
            points, shown = places[label], known[label]
            motions[f"reference/{label}"] = Motion(
                position=np.where(shown[:, None], points, 0.0), visible=shown
            )
        return motions


def scene_of(frames: Frames) -> Scene:
    """The scene of a run."""
    height = float(frames["q"][0, 2])
    path, body, mu = follow(frames), frames["q"][:, 2], frames.contacts.mu
    drawn = RobotScene(
        frames.robot,
        height,
        cones=mu is not None and bool(np.any(mu[frames.rows] > 0.0)),
        per_axis=frames.contacts.per_axis,
        floor=normal_floor(frames.run),
        references=frames.references,
    )
    size, scales = picture_size(frames), drawn.scales
    rise = float((body - path[:, 2]).max() - body[0] + path[0, 2])
    scene = Scene(size + rise if FLIES < rise < MOST_RISE else size)
    scene.motions[""] = Motion(position=-path - (0.0, 0.0, MIDDLE * scene.size))
    scene.nodes += ground_nodes(path, frames.ground)
    scene.nodes += marks(frames, scales.height)
    slips, appear = slip_marks(frames, scales.height)
    scene.nodes += [*slips, *drawn.nodes, *_trails(frames)]
    scene.motions |= appear | drawn.motions(frames)
    return scene


def picture_size(frames: Frames) -> float:
    """What has to fit in the picture of a robot as it stands at the start, m."""
    height = float(np.clip(frames["q"][0, 2], 0.1, 10.0))
    points = np.concatenate((frames.joints[0, 1:, :3, 3], frames["foot_position"][0]))
    around = 2.0 * float(np.linalg.norm(points[:, :2] - frames["q"][0, :2], axis=1).max())
    return float(np.clip(max(1.75 * height, 1.6 * points[:, 2].max(), 1.6 * around), 0.2, 20.0))


def follow(frames: Frames) -> Vector:
    """(n, 3) where the camera looks, m: the body's path on the ground, without its sway."""
    path, surface = np.zeros((len(frames), 3)), frames.surface
    half = min(round(0.5 * WINDOW * frames.fps), len(frames) - 1)
    lines = [*frames["q"][:, :2].T]
    if surface is not None:
        lines.append(surface.height(lines[0].copy(), lines[1].copy()))
    for axis, line in enumerate(lines):
        # Continued straight on at both ends, so that the camera starts and stops with the body in
        # the middle.
        before = 2.0 * line[0] - line[half:0:-1]
        after = 2.0 * line[-1] - line[-2 : -half - 2 : -1]
        padded = np.concatenate((before, line, after))
        path[:, axis] = np.convolve(
            padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid"
        )
    return path


def _trails(frames: Frames) -> list[Node]:
    """The lines on which the references move."""
    trails = []
    for label, colour, _ in BALLS:
        if label not in frames.references:
            continue
        points = frames.references[label][frames.rows]
        line = points[np.isfinite(points).all(axis=1)]
        if len(line) > 1:
            pieces = Lines(np.stack((line[:-1], line[1:]), axis=1))
            trails.append(Node(f"trail/{label}", pieces, Look(colour, 0.7)))
    return trails
