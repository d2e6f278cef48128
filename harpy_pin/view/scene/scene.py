"""The scene of a run: robot, ground, forces, friction cones and references, with the animation that moves them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from meshcat import geometry as g
from meshcat.animation import Animation
from numpy.typing import NDArray

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.plant.run import Run
from harpy_pin.view.palette import APPLIED, BODY, CONTACT, TARGET, THRUST, as_int
from harpy_pin.view.scene.arrows import draw_arrow, nice_scale
from harpy_pin.view.scene.cones import Shape, draw_cone
from harpy_pin.view.scene.frames import Frames, local_friction
from harpy_pin.view.scene.motion import Motion
from harpy_pin.view.scene.pantograph import draw_pantograph, find_pantograph
from harpy_pin.view.scene.recorder import set_exactly
from harpy_pin.view.scene.stage import draw_ground, follow, frame_camera, light
from harpy_pin.view.scene.visuals import draw_robot, node_name

__all__ = ["ROOT", "Scales", "draw_scene"]

ROOT = "walk"
"""Path of the node that stands for the world's frame; it slides so that the camera follows."""


@dataclass(frozen=True)
class Scales:
    """Sizes of what is drawn, chosen from the robot's size and weight.

    Attributes:
        height: of the body above the ground at the start, m.
        contact: contact force that is drawn one metre long, N/m.
        thrust: thrust that is drawn one metre long, N/m.
    """

    height: float
    contact: float
    thrust: float

    @classmethod
    def of(cls, robot: Robot, frames: Frames) -> Scales:
        """The robot's weight is about two thirds of its height; thrusts are drawn twice as long as contact forces."""
        height = float(np.clip(frames.q[0, 2], 0.1, 10.0))
        contact = nice_scale(1.25 * robot.mass * 9.81 / (0.65 * height))
        return cls(height, contact, nice_scale(0.5 * contact))


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
    path = follow(frames)
    light(visualizer)
    frame_camera(visualizer, size=1.75 * scales.height)
    draw_ground(world["ground"], path)
    draw_robot(world["robot"], animation, robot, frames)
    for foot in robot.feet:
        leg = find_pantograph(robot, foot)
        if leg is not None:
            draw_pantograph(world["lower_leg"][node_name(foot)], animation, leg, frames)
    _draw_contacts(world, animation, run, robot, frames, scales)
    _draw_thrusts(world, animation, robot, frames, scales)
    _draw_references(world, animation, frames, scales)
    middle = np.array([0.0, 0.0, 0.56 * scales.height])
    Motion(position=-path - middle).apply(world, animation, frames.time)
    return animation


def _draw_contacts(world: Any, animation: Animation, run: Run, robot: Robot, frames: Frames, scales: Scales) -> None:
    """Contact-force arrow and friction cone of each foot."""
    mu = local_friction(run, frames.foot_position, time=frames.time)
    shape: Shape = "per_axis" if (run.metadata.get("ground") or {}).get("cone") == "per_axis" else "circular"
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
            radius=0.013 * scales.height,
        )
        if mu is not None and np.any(mu[:, k] > 0.0):
            draw_cone(
                world["friction_cone"][node_name(name)],
                animation,
                frames.time,
                foot,
                force,
                frames.foot_velocity[:, k],
                mu=mu[:, k],
                slant=0.3 * scales.height,
                shape=shape,
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
