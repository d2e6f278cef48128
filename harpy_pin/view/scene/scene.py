"""The scene of a run: robot, ground, forces in their friction cones and references, and how they move.

The camera follows the walk: the node of the world slides the other way, so that the robot stays in front of a camera
that stands still, and turning the view with the mouse turns it about the robot.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from harpy_pin.arguments import checked
from harpy_pin.ground.terrain import Terrain
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import APPLIED, BODY, CONTACT, TARGET, THRUST
from harpy_pin.view.scene.forces import Arrow, Cone, nice_scale
from harpy_pin.view.scene.frames import (
    Frames,
    friction_strips,
    is_per_axis,
    local_friction,
    normal_floor,
    static_friction,
)
from harpy_pin.view.scene.ground import (
    about_normals,
    flat_ground,
    marks,
    pressure,
    slip_marks,
    surface_ground,
    surface_of,
)
from harpy_pin.view.scene.nodes import Lines, Look, Motion, Motions, Node, Sphere, node_name
from harpy_pin.view.scene.robot_nodes import RobotNodes

__all__ = ["Scales", "Scene", "follow", "scene_of"]

FLIES, MOST_RISE = 0.2, 5.0
"""Rise of the body above the ground from which on the picture shows more, m, and up to which it does."""
CONE_SLANT = 0.45
"""Side of a friction cone, as a share of the robot's height."""
WINDOW = 1.5
"""Time over which the camera's path is averaged, s: two steps of the gait."""
BALLS = (("target", TARGET, 0.030), ("applied", APPLIED, 0.023), ("body", BODY, 0.016))
"""References, their colours, and their balls' radius as a share of the robot's height."""


@dataclass(frozen=True)
class Scales:
    """Sizes of what is drawn, chosen from the robot's size and weight.

    Attributes:
        height: of the body above the ground at the start, m.
        size: what has to fit in the picture, m.
        contact: contact force that is drawn one metre long, N/m.
        thrust: thrust that is drawn one metre long, N/m.
    """

    height: float
    size: float
    contact: float
    thrust: float

    @classmethod
    def of(cls, robot: Robot, frames: Frames) -> Scales:
        """Half the robot's weight is about a third of its height; thrusts are drawn twice as long as contact forces."""
        height = float(np.clip(frames.q[0, 2], 0.1, 10.0))
        points = np.concatenate((frames.joints[0, 1:, :3, 3], frames.foot_position[0]))
        around = 2.0 * float(np.linalg.norm(points[:, :2] - frames.q[0, :2], axis=1).max())
        size = float(np.clip(max(1.75 * height, 1.6 * points[:, 2].max(), 1.6 * around), 0.2, 20.0))
        share = robot.mass * 9.81 * min(2.0 / max(len(robot.feet), 1), 1.0)
        contact = nice_scale(1.25 * share / (0.65 * height))
        return cls(height, size, contact, nice_scale(0.5 * contact))


@dataclass
class Scene:
    """What is drawn of a run.

    Attributes:
        size: height that has to fit in the picture, m.
        nodes: by paths below the node that stands for the world's frame.
        motions: one row for each frame, by the nodes' paths; that of the world has the empty path.
    """

    size: float
    nodes: list[Node] = field(default_factory=list)
    motions: Motions = field(default_factory=dict)


@checked
def scene_of(run: Run, robot: Robot, frames: Frames) -> Scene:
    """The scene of a run.

    Args:
        run: the log (its metadata gives the friction).
        robot: the robot.
        frames: the rows that are drawn.
    """
    scales, surface = Scales.of(robot, frames), surface_of(run)
    path = follow(frames, surface)
    rise = float((frames.q[:, 2] - path[:, 2]).max() - frames.q[0, 2] + path[0, 2])
    scene = Scene(scales.size + rise if FLIES < rise < MOST_RISE else scales.size)
    scene.motions[""] = Motion(position=-path - (0.0, 0.0, 0.32 * scene.size))
    mu = static_friction(run)
    if surface is not None:
        scene.nodes += surface_ground(path, surface, mu)
    else:
        scene.nodes += flat_ground(path, mu, () if mu is None else friction_strips(run))
    scene.nodes += marks(frames, scales.height, surface)
    for nodes, motions in (slip_marks(frames, scales.height, surface), pressure(frames, scales.height, surface)):
        scene.nodes += nodes
        scene.motions |= motions
    drawn = RobotNodes(robot, float(frames.q[0, 2]))
    scene.nodes += drawn.nodes
    scene.motions |= drawn.motions(frames.joints)
    _add_forces(scene, run, robot, frames, scales, surface)
    _add_references(scene, frames, scales)
    return scene


def follow(frames: Frames, surface: Terrain | None = None) -> Vector:
    """(n, 3) where the camera looks, m: the body's path on the ground, or on its surface, without its sway."""
    path = np.zeros((len(frames), 3))
    half = min(round(0.5 * WINDOW * frames.fps), len(frames) - 1)
    lines = [frames.q[:, 0], frames.q[:, 1]]
    if surface is not None:
        lines.append(surface.height(lines[0].copy(), lines[1].copy()))
    for axis, line in enumerate(lines):
        # Continued straight on at both ends, so that the camera starts and stops with the body in the middle.
        before = 2.0 * line[0] - line[half:0:-1]
        after = 2.0 * line[-1] - line[-2 : -half - 2 : -1]
        padded = np.concatenate((before, line, after))
        path[:, axis] = np.convolve(padded, np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
    return path


def _add_forces(scene: Scene, run: Run, robot: Robot, frames: Frames, scales: Scales, surface: Terrain | None) -> None:
    """Arrow and friction cone of each foot, the cone about the ground's normal, and arrow of each thruster."""
    floor = normal_floor(run)
    mu = local_friction(run, frames.foot_position, time=frames.time)
    for k, name in enumerate(robot.feet):
        foot, force = frames.foot_position[:, k], frames.foot_force[:, k]
        # Thin, so that the cone around it is seen.
        radius, scale = 0.009 * scales.height, 1.0 / scales.contact
        arrow = Arrow(f"contact_force/{node_name(name)}", CONTACT, radius=radius, metres_per_newton=scale)
        scene.nodes += arrow.nodes
        scene.motions |= arrow.motions(foot, force)
        if mu is not None and np.any(mu[:, k] > 0.0):
            cone = Cone(
                f"friction_cone/{node_name(name)}",
                slant=CONE_SLANT * scales.height,
                per_axis=is_per_axis(run),
                floor=None if floor is None else floor / scales.contact,
            )
            normal = None if surface is None else surface.normal(foot[:, 0].copy(), foot[:, 1].copy())
            given, velocity = (about_normals(surface, foot, each) for each in (force, frames.foot_velocity[:, k]))
            scene.nodes += cone.nodes
            scene.motions |= cone.motions(foot, given, velocity, mu[:, k], normal)
    for k, name in enumerate(robot.thrusters):
        radius, scale = 0.013 * scales.height, 1.0 / scales.thrust
        arrow = Arrow(f"thrust/{node_name(name)}", THRUST, radius=radius, metres_per_newton=scale)
        scene.nodes += arrow.nodes
        scene.motions |= arrow.motions(frames.mount[:, k], frames.thrust[:, k])


def _add_references(scene: Scene, frames: Frames, scales: Scales) -> None:
    """Balls at the target, the applied reference and the body itself, and the lines on which the first two move.

    The balls are drawn through the body that they are in.
    """
    if not frames.references:
        return
    for order, (label, colour, radius) in enumerate(BALLS):
        points = frames.references.get(label, frames.q[:, :3] if label == "body" else None)
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
