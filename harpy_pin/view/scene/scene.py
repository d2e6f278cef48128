"""The scene of a run: robot, ground, forces, friction cones and references, with the animation that moves them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from meshcat import geometry as g
from meshcat.animation import Animation
from numpy.typing import NDArray

from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.simulation.terrain import Terrain
from harpy_pin.view.palette import APPLIED, BODY, CONTACT, TARGET, THRUST, as_int, ground_colour
from harpy_pin.view.scene.arrows import draw_arrow, nice_scale
from harpy_pin.view.scene.command_recorder import set_exactly
from harpy_pin.view.scene.drawn_cones import Shape, draw_cone
from harpy_pin.view.scene.frames import (
    Frames,
    friction_strips,
    is_per_axis,
    local_friction,
    normal_floor,
    static_friction,
)
from harpy_pin.view.scene.marks import draw_footholds, draw_path, draw_pressure, draw_slip_marks, draw_trail
from harpy_pin.view.scene.motion import Motion
from harpy_pin.view.scene.pantograph import draw_pantograph, find_pantograph
from harpy_pin.view.scene.stage import draw_friction_strips, draw_ground, follow, frame_camera, light
from harpy_pin.view.scene.surface import about_normals, draw_surface, surface_of
from harpy_pin.view.scene.visuals import draw_robot, node_name

__all__ = ["ROOT", "Scales", "draw_scene"]

ROOT = "walk"
"""Path of the node that stands for the world's frame; it slides so that the camera follows."""
CONTACT_RADIUS = 0.009
"""Of a contact force's arrow, as a share of the robot's height: thin, so that the cone around it is seen."""
FLIES, MOST_RISE = 0.2, 5.0
"""Rise of the body above the ground from which on the picture shows more, m, and up to which it does."""
CONE_SLANT = 0.45
"""Side of a friction cone, as a share of the robot's height."""


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


def draw_scene(visualizer: Any, run: Run, robot: Robot, frames: Frames) -> Animation:
    """Fill a Meshcat visualizer with the scene of a run, at its first frame.

    Args:
        visualizer: a ``meshcat.Visualizer``.
        run: the log (its metadata gives the friction).
        robot: the robot.
        frames: the rows that are drawn.

    Returns:
        The animation, to be handed to ``visualizer.set_animation``.
    """
    animation = Animation(default_framerate=frames.fps)
    scales = Scales.of(robot, frames)
    world = visualizer[ROOT]
    surface = surface_of(run)
    path = follow(frames, surface)
    rise = float((frames.q[:, 2] - path[:, 2]).max() - frames.q[0, 2] + path[0, 2])
    if FLIES < rise < MOST_RISE:
        scales = replace(scales, size=scales.size + rise)
    light(visualizer)
    frame_camera(visualizer, size=scales.size)
    _draw_ground(world, animation, run, frames, scales, path, surface)
    draw_robot(world["robot"], animation, robot, frames)
    for foot in robot.feet:
        leg = find_pantograph(robot, foot)
        if leg is not None:
            draw_pantograph(world["lower_leg"][node_name(foot)], animation, leg, frames)
    _draw_contacts(world, animation, run, robot, frames, scales, surface)
    _draw_thrusts(world, animation, robot, frames, scales)
    _draw_references(world, animation, frames, scales)
    middle = np.array([0.0, 0.0, 0.32 * scales.size])
    Motion(position=-path - middle).apply(world, animation, frames.time)
    return animation


def _draw_ground(
    world: Any, animation: Animation, run: Run, frames: Frames, scales: Scales, path: Vector, surface: Terrain | None
) -> None:
    """The ground in the colours of its friction, and what is marked on it."""
    mu = static_friction(run)
    if surface is not None:
        draw_surface(world["ground"], path, surface, colour="#f1f4f8" if mu is None else ground_colour(mu))
    elif mu is None:
        draw_ground(world["ground"], path)
    else:
        draw_ground(world["ground"], path, colour=ground_colour(mu))
        draw_friction_strips(world["ground/strip"], friction_strips(run))
    if "target" in frames.references:
        draw_path(world["path"], frames.references["target"], width=0.012 * scales.height, surface=surface)
    draw_footholds(world["foothold"], frames, radius=0.06 * scales.height, surface=surface)
    draw_slip_marks(world["slip"], animation, frames, width=0.03 * scales.height, surface=surface)
    draw_pressure(world["pressure"], animation, frames, radius=0.035 * scales.height, surface=surface)


def _draw_contacts(
    world: Any, animation: Animation, run: Run, robot: Robot, frames: Frames, scales: Scales, surface: Terrain | None
) -> None:
    """Contact-force arrow and friction cone of each foot, the cone about the ground's normal."""
    floor = normal_floor(run)
    mu = local_friction(run, frames.foot_position, time=frames.time)
    shape: Shape = "per_axis" if is_per_axis(run) else "circular"
    for k, name in enumerate(robot.feet):
        foot, force = frames.foot_position[:, k], frames.foot_force[:, k]
        draw_arrow(
            world["contact_force"][node_name(name)],
            animation,
            frames.time,
            foot,
            force,
            colour=CONTACT,
            metres_per_newton=1.0 / scales.contact,
            radius=CONTACT_RADIUS * scales.height,
            in_front=True,
        )
        if mu is not None and np.any(mu[:, k] > 0.0):
            draw_cone(
                world["friction_cone"][node_name(name)],
                animation,
                frames.time,
                foot,
                about_normals(surface, foot, force),
                about_normals(surface, foot, frames.foot_velocity[:, k]),
                mu=mu[:, k],
                normal=None if surface is None else surface.normal(foot[:, 0].copy(), foot[:, 1].copy()),
                slant=CONE_SLANT * scales.height,
                shape=shape,
                floor=None if floor is None else floor / scales.contact,
            )


def _draw_thrusts(world: Any, animation: Animation, robot: Robot, frames: Frames, scales: Scales) -> None:
    """Arrow of each thruster's force on the robot."""
    for k, name in enumerate(robot.thrusters):
        draw_arrow(
            world["thrust"][node_name(name)],
            animation,
            frames.time,
            frames.mount[:, k],
            frames.thrust[:, k],
            colour=THRUST,
            metres_per_newton=1.0 / scales.thrust,
            radius=0.013 * scales.height,
            in_front=True,
        )


def _draw_references(world: Any, animation: Animation, frames: Frames, scales: Scales) -> None:
    """Balls at the target, the applied reference and the body itself; they are drawn through the body they are in."""
    body = frames.q[:, :3]
    for order, (label, colour, radius) in enumerate(
        (("target", TARGET, 0.030), ("applied", APPLIED, 0.023), ("body", BODY, 0.016))
    ):
        points: Vector | None = frames.references.get(label, body if label == "body" and frames.references else None)
        if points is None:
            continue
        known: NDArray[np.bool_] = np.isfinite(points.sum(axis=1))
        material = g.MeshLambertMaterial(
            color=as_int(colour), emissive=as_int(colour), emissiveIntensity=0.5, transparent=True, depthTest=False
        )
        node = world["reference"][label]
        node["ball"].set_object(g.Sphere(radius * scales.height), material)
        set_exactly(node["ball/<object>"], "castShadow", False)
        set_exactly(node["ball/<object>"], "renderOrder", 10 + order)
        Motion(position=np.where(known[:, None], points, 0.0), visible=known).apply(node, animation, frames.time)
        if label != "body":
            draw_trail(world["trail"][label], points, colour=colour)
