"""The scene of a run: robot, ground, forces in their friction cones and references, and how they move.

The camera follows the walk: the node of the world slides the other way, so that the robot stays in front of a camera
that stands still, and turning the view with the mouse turns it about the robot.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from harpy_pin.model.state import Vector
from harpy_pin.view.palette import APPLIED, BODY, ESTIMATE, TARGET
from harpy_pin.view.scene.forces import Forces, Scales
from harpy_pin.view.scene.frames import Frames, normal_floor
from harpy_pin.view.scene.ground import ground_nodes, marks, pressure, slip_marks
from harpy_pin.view.scene.nodes import Lines, Look, Motion, Motions, Node, Sphere
from harpy_pin.view.scene.robot_nodes import RobotNodes

FLIES, MOST_RISE = 0.2, 5.0
"""Rise of the body above the ground from which on the picture shows more, m, and up to which it does."""
WINDOW = 1.5
"""Time over which the camera's path is averaged, s: two steps of the gait."""
BALLS = (("target", TARGET, 0.030), ("applied", APPLIED, 0.023), ("estimate", ESTIMATE, 0.019), ("body", BODY, 0.016))
"""References, their colours, and their balls' radius as a share of the robot's height."""


@dataclass
class Scene:
    """What is drawn of a run."""

    size: float  # height that has to fit in the picture, m
    nodes: list[Node] = field(default_factory=list)  # by paths below the node that stands for the world's frame
    # one row for each frame, by the nodes' paths; that of the world has the empty path
    motions: Motions = field(default_factory=dict)


def scene_of(frames: Frames) -> Scene:
    """The scene of a run."""
    height = float(frames["q"][0, 2])
    scales, size = Scales.of(frames.robot, height), picture_size(frames)
    path, body = follow(frames), frames["q"][:, 2]
    rise = float((body - path[:, 2]).max() - body[0] + path[0, 2])
    scene = Scene(size + rise if FLIES < rise < MOST_RISE else size)
    scene.motions[""] = Motion(position=-path - (0.0, 0.0, 0.32 * scene.size))
    scene.nodes += ground_nodes(path, frames.ground)
    scene.nodes += marks(frames, scales.height)
    for nodes, motions in (slip_marks(frames, scales.height), pressure(frames, scales.height)):
        scene.nodes += nodes
        scene.motions |= motions
    drawn = RobotNodes(frames.robot, height)
    scene.nodes += drawn.nodes
    scene.motions |= drawn.motions(frames.joints)
    contacts, surface = frames.contacts[frames.rows], frames.surface
    rubs = contacts.mu is not None and bool(np.any(contacts.mu > 0.0))
    floor = normal_floor(frames.run)
    forces = Forces(frames.robot, scales, cones=rubs, per_axis=contacts.per_axis, floor=floor)
    x, y = (contacts.position[..., axis].copy() for axis in range(2))
    normal = None if surface is None else surface.normal(x, y)
    scene.nodes += forces.nodes
    scene.motions |= forces.motions(contacts, frames["foot_force"], normal, frames.mount, frames["thrust"])
    _add_references(scene, frames, scales)
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
        # Continued straight on at both ends, so that the camera starts and stops with the body in the middle.
        before = 2.0 * line[0] - line[half:0:-1]
        after = 2.0 * line[-1] - line[-2 : -half - 2 : -1]
        padded = np.concatenate((before, line, after))
        path[:, axis] = np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
    return path


def _add_references(scene: Scene, frames: Frames, scales: Scales) -> None:
    """Balls at the target, the applied reference and the body itself, and the lines on which the first two move.

    The balls are drawn through the body that they are in.
    """
    if not frames.references:
        return
    places = {**{label: points[frames.rows] for label, points in frames.references.items()}, "body": frames["q"][:, :3]}
    for order, (label, colour, radius) in enumerate(BALLS):
        points = places.get(label)
        if points is None:
            continue
        known = np.asarray(np.isfinite(points).all(axis=1))
        look = Look(colour, light="bright", in_front=10 + order)
        scene.nodes.append(Node(f"reference/{label}", Sphere(radius * scales.height), look))
        scene.motions[f"reference/{label}"] = Motion(position=np.where(known[:, None], points, 0.0), visible=known)
        line = points[known]
        if label != "body" and len(line) > 1:
            pieces = Lines(np.stack((line[:-1], line[1:]), axis=1))
            scene.nodes.append(Node(f"trail/{label}", pieces, Look(colour, 0.7)))
