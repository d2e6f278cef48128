"""The scene of the live page: robot, ground, forces in their cones, references.

The robot stays in the middle: what is drawn is where it is relative to a place on the ground that follows the body.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import viser

from harpy_pin.gaits.standing import Standing
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.live.live_arrows import Arrow
from harpy_pin.view.live.live_shapes import RobotShapes, quaternion
from harpy_pin.view.palette import APPLIED, CONTACT, FRICTION, SLIDING, TARGET, THRUST, as_rgb, ground_colour
from harpy_pin.view.scene.arrows import nice_scale
from harpy_pin.view.scene.drawn_cones import cone_mesh, cone_rim, sliding
from harpy_pin.view.scene.visuals import node_name

__all__ = ["Scene"]

FOLLOW_TIME = 0.4
"""Time constant with which the middle of the picture follows the body, s."""
JUMP = 0.5
"""Distance over which it does not follow but jumps, m."""
CELL, SECTION = 0.1, 0.5
"""Distance between thin and between strong lines of the ground, m."""
TRAIL, TRAIL_STEP = 150, 0.01
"""Points of a trail on the ground, at most, and the distance between two, m."""
STRIP = (110, 190, 250)
PUSH = "#cc3377"
HARPY_HEIGHT = 0.6
"""Of the body above the ground, m."""
SLANT = 0.18
"""Length of a cone's side, m."""
FULL = 0.97
"""Share of the friction from which on a force counts as on its cone's edge: the cone turns red."""


class Scene:
    """What is drawn.

    Args:
        server: viser's.
        robot: who is drawn.

    Attributes:
        origin: (3,) place in the world that is the scene's origin, m.
        body: (3,) the body in the scene, m.
        shapes: the robot's.
        scale: the robot's size, relative to Harpy's.
        newtons_per_metre: of the contact forces' arrows.
    """

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        self._scene = scene = server.scene
        self.robot = robot
        self.origin, self.body = np.zeros(3), np.zeros(3)
        scene.set_up_direction("+z")
        scene.world_axes.visible = False
        _light(scene)
        self._time, self._mu, self._slope = -1.0, -1.0, 0.0
        self._strip: tuple[float, float] | None = None  # where it lies along x, m
        self._floor = scene.add_grid(
            "/floor",
            width=14.0,
            height=14.0,
            cell_size=CELL,
            cell_color=(218, 222, 228),
            section_size=SECTION,
            section_color=(176, 184, 194),
            plane_color=as_rgb(ground_colour(1.0)),
            plane_opacity=1.0,
            fade_distance=9.0,
            shadow_opacity=0.35,
        )
        self._strip_box = scene.add_box(
            "/friction_strip", color=STRIP, dimensions=(1.0, 8.0, 0.002), opacity=0.75, visible=False, cast_shadow=False
        )
        self.shapes = RobotShapes(scene, robot)
        self.scale = scale = _size(robot)
        share = robot.mass * 9.81 * min(2.0 / len(robot.feet), 1.0)
        self.newtons_per_metre = nice_scale(1.25 * share / (0.4 * scale))
        one = np.zeros((1, 2, 3))
        self._forces = [
            Arrow(scene, f"/force/{node_name(foot)}", as_rgb(CONTACT), 0.008 * scale) for foot in robot.feet
        ]
        self._thrusts = [
            Arrow(scene, f"/thrust/{node_name(name)}", as_rgb(THRUST), 0.007 * scale) for name in robot.thrusters
        ]
        self._push = Arrow(scene, "/push", as_rgb(PUSH), 0.012 * scale)
        vertices, faces = cone_mesh(cone_rim(1.0, slant=np.sqrt(2.0)))
        self._cones = [
            {
                kind: scene.add_mesh_simple(
                    f"/cone/{node_name(foot)}/{kind}",
                    vertices,
                    faces,
                    color=as_rgb(colour),
                    opacity=0.35,
                    side="double",
                    cast_shadow=False,
                    receive_shadow=False,
                    visible=False,
                )
                for kind, colour in (("inside", FRICTION), ("edge", SLIDING))
            }
            for foot in robot.feet
        ]
        self._ghosts = {
            name: scene.add_box(
                f"/reference/{name}",
                color=as_rgb(colour),
                dimensions=(scale * size, scale * size, scale * size),
                wireframe=True,
                cast_shadow=False,
                visible=False,
            )
            for name, colour, size in (("target", TARGET, 0.16), ("applied", APPLIED, 0.15))
        }
        self._points: dict[str, list[Vector]] = {"target": [], "body": []}
        self._trails = {
            name: scene.add_line_segments(f"/trail/{name}", one, as_rgb(colour), thickness=0.006)
            for name, colour in (("target", TARGET), ("body", "#5b6573"))
        }

    def update(self, snapshot: Any) -> None:
        """Show a snapshot."""
        s = snapshot
        self._follow(s)
        mounts = self.shapes.place(s["q"], self.origin)
        scale = 1.0 / self.newtons_per_metre
        for k, cones in enumerate(self._cones):
            foot, force, mu = s["foot_position"][k] - self.origin, s["foot_force"][k], float(s["friction"][k])
            self._forces[k].show(foot, force, metres_per_newton=scale)
            self._show_cone(cones, foot, s["contact_force"][k], s["contact_velocity"][k], mu)
        for arrow, mount, thrust in zip(self._thrusts, mounts, s["thrust"], strict=True):
            arrow.show(mount, thrust, metres_per_newton=2.0 * scale)
        self._push.show(self.body, s["push"], metres_per_newton=scale)
        turn = quaternion(_about_z(float(s["heading"])))
        for name, ghost in self._ghosts.items():
            shown = bool(np.isfinite(s[name]).all())
            _set(ghost, visible=shown)
            if shown:
                ghost.position, ghost.wxyz = s[name] - self.origin, turn

    def lay_ground(self, friction: float, friction_strips: tuple[tuple[float, float, float], ...]) -> None:
        """Colour of the ground, and its first friction strip.

        Args:
            friction: of the ground.
            friction_strips: strips: from x, to x, m, and their friction.
        """
        if friction != self._mu:
            self._mu = friction
            self._floor.plane_color = as_rgb(ground_colour(friction))
        _set(self._strip_box, visible=bool(friction_strips))
        self._strip = friction_strips[0][:2] if friction_strips else None
        if self._strip is not None:
            self._strip_box.dimensions = (self._strip[1] - self._strip[0], 8.0, 0.002)

    def draw_trails(self) -> None:
        """Show the trails as they are; slower than the rest."""
        for name, handle in self._trails.items():
            points = np.array(self._points[name])
            if len(points) > 1:
                line = points - self.origin + (0.0, 0.0, 0.003)
                handle.points = np.stack((line[:-1], line[1:]), axis=1).astype(np.float32)

    def _follow(self, s: Any) -> None:
        """Move the scene's origin after the body, and what lies on the ground with it."""
        desired = np.array([s["q"][0], s["q"][1], s["below"]])
        self._tilt(float(s["slope"]))
        passed = float(s["time"]) - self._time
        self._time = float(s["time"])
        gap = desired - self.origin
        if np.hypot(gap[0], gap[1]) > JUMP or passed < 0.0:
            self.origin = desired
            for points in self._points.values():
                points.clear()
        else:
            self.origin = self.origin + gap * (1.0 - np.exp(-max(passed, 0.0) / FOLLOW_TIME))
        self.body = s["q"][:3] - self.origin
        for name, place in (("target", s["target"]), ("body", s["q"])):
            points = self._points[name]
            here = np.array([place[0], place[1], s["below"] + np.tan(s["slope"]) * (place[0] - s["q"][0])])
            if not points or np.linalg.norm(here - points[-1]) > TRAIL_STEP:
                points.append(here)
                del points[:-TRAIL]
        x, y = self.origin[:2]
        c, rise = np.cos(self._slope), np.tan(self._slope)
        along = -((x / c) % SECTION) * c
        self._floor.position = (along, -(y % SECTION), rise * along - 0.002)
        if self._strip is not None:
            middle = 0.5 * sum(self._strip) - x
            self._strip_box.position = (middle, -(y % SECTION), rise * middle - 0.001)

    def _tilt(self, slope: float) -> None:
        """Turn what lies on the ground, and the cones, about y."""
        if slope == self._slope:
            return
        self._slope = slope
        turn = (float(np.cos(0.5 * slope)), 0.0, -float(np.sin(0.5 * slope)), 0.0)
        for handle in (self._floor, self._strip_box, *(cone for cones in self._cones for cone in cones.values())):
            handle.wxyz = turn

    def _show_cone(self, cones: dict[str, Any], foot: Vector, force: Vector, velocity: Vector, mu: float) -> None:
        touching = force[2] > 0.5 and mu > 0.0
        tangential = float(np.hypot(force[0], force[1]))
        edge = bool(sliding(force, velocity)) or tangential > FULL * mu * force[2]
        height = self.scale * SLANT / np.hypot(1.0, mu)
        for kind, cone in cones.items():
            shown = touching and (kind == "edge") == edge
            _set(cone, visible=shown)
            if shown:
                cone.position = foot
                size = (mu * height, mu * height, height)
                if not np.allclose(cone.scale, size, atol=1e-6):
                    cone.scale = size


def _size(robot: Robot) -> float:
    """Size of a robot as it stands, relative to Harpy's; smaller ones fill the picture, too."""
    if robot.posture is None:
        return 1.0
    q, _ = Standing(robot).initial_state()
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    points = np.array([data.oMi[joint].translation for joint in range(1, robot.model.njoints)])
    feet = np.array([data.oMf[robot.frame_id(name)].translation for name in robot.feet])
    around = np.linalg.norm(np.concatenate((points, feet))[:, :2], axis=1).max()
    return float(max(q[2], 0.9 * points[:, 2].max(), 1.7 * around) / HARPY_HEIGHT)


def _light(scene: viser.SceneApi) -> None:
    """A bright sky, a lamp that casts shadows, and nothing from the network."""
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere("/light/sky", sky_color=(255, 255, 255), ground_color=(205, 200, 190), intensity=1.8)
    scene.add_light_directional("/light/lamp", intensity=2.0, cast_shadow=True, position=(1.5, -2.5, 5.0))


def _set(handle: Any, *, visible: bool) -> None:
    """Say so only where it changes."""
    if handle.visible != visible:
        handle.visible = visible


def _about_z(angle: float) -> Vector:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
