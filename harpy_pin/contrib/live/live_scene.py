"""The scene of the live page: robot, ground, forces in their cones, references.

The robot stays in the middle: the world moves so that a place on the ground that follows the body
is where it was.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pinocchio as pin
import viser

from harpy_pin.contrib.live.settings import is_harpy
from harpy_pin.gaits.standing import Standing
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import APPLIED, ESTIMATE, TARGET, as_rgb, ground_colour
from harpy_pin.view.scene.forces import Arrow, Forces, Scales
from harpy_pin.view.scene.frames import PLACES, Contacts
from harpy_pin.view.scene.nodes import (
    Box,
    Cylinder,
    Lines,
    Look,
    Motion,
    Motions,
    Node,
    Sphere,
    from_matrices,
)
from harpy_pin.view.scene.robot_nodes import RobotNodes

FOLLOW_TIME = 0.4
"""Time constant with which the middle of the picture follows the body, s."""
JUMP = 0.5
"""Distance over which it does not follow but jumps, m."""
CELL, SECTION = 0.1, 0.5
"""Distance between thin and between strong lines of the ground, m."""
TRAIL, TRAIL_STEP = 150, 0.01
"""Points of a trail on the ground, at most, and the distance between two, m."""
STRIP, PUSH, WAY = "#6ebefa", "#cc3377", "#5b6573"
HARPY_HEIGHT = 0.6
"""Height of Harpy's body above the ground, m."""
EDGE = 1.5
"""Width of lines, pixels."""
FULL = 0.97
"""Share of the friction from which on a force counts as on its cone's edge: the cone turns red."""


class LiveScene:
    """What is drawn.

    Args:
        server: viser's.
        robot: who is drawn.

    Attributes:
        origin: (3,) place in the world that is the scene's origin, m.
        body: (3,) the body in the scene, m.
        handles: of the robot's shapes.
        scale: the robot's size, relative to Harpy's.
    """

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        scene = server.scene
        self.origin, self.body = np.zeros(3), np.zeros(3)
        self._time, self._mu, self._slope = -1.0, -1.0, 0.0
        self._strip: tuple[float, float] | None = None  # where it lies along x, m
        self._closed, self._data = robot.closed, robot.model.createData()
        self._model = robot.model
        self._mounts = [robot.frame_id(name) for name in robot.thrusters]
        self.scale = scale = _size(robot)
        _set_stage(scene)
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
        self._drawn = ViserScene(scene)
        height = HARPY_HEIGHT * scale
        scales = Scales.of(robot, height)
        self._robot, self._forces = RobotNodes(robot, height), Forces(robot, scales, full=FULL)
        self._push = Arrow("push", PUSH, radius=0.012 * scale, metres_per_newton=1.0 / scales.force)
        for part in (self._robot, self._forces, self._push):
            self._drawn.add(part.nodes)
        self._drawn.add(
            [Node("friction_strip", Box((1.0, 8.0, 0.002)), Look(STRIP, 0.75, light="ground"))]
        )
        for name, size, colour in (
            ("target", 0.16, TARGET),
            ("applied", 0.15, APPLIED),
            ("estimate", 0.14, ESTIMATE),
        ):
            self._drawn.add([Node(f"reference/{name}", _frame(size * scale), Look(colour))])
        self.handles = self._drawn.handles
        self._points: dict[str, list[Vector]] = {"target": [], "body": []}
        self._trails = {
            name: scene.add_line_segments(
                f"/walk/trail/{name}", np.zeros((1, 2, 3)), as_rgb(colour), thickness=0.006
            )
            for name, colour in (("target", TARGET), ("body", WAY))
        }

    def update(self, snapshot: Any) -> None:
        """Show a snapshot."""
        s = snapshot
        self._follow(s)
        pin.framesForwardKinematics(self._model, self._data, self._closed(s["q"]))
        motions: Motions = {"": Motion(position=-self.origin[None])}
        motions |= self._robot.motions(
            np.stack([placement.homogeneous for placement in self._data.oMi])[None]
        )
        place, normal = s["foot_position"][None], np.zeros((1, len(s["foot_position"]), 3))
        normal[..., 0], normal[..., 2] = -np.sin(self._slope), np.cos(self._slope)
        contacts = Contacts(
            place,
            *(s[name][None] for name in ("contact_force", "contact_velocity", "foot_friction")),
        )
        mounts = np.reshape(
            [self._data.oMf[mount].translation for mount in self._mounts], (1, -1, 3)
        )
        motions |= self._forces.motions(
            contacts, s["foot_force"][None], normal, mounts, s["thrust"][None]
        )
        motions |= self._push.motions(s["q"][None, :3], s["push"][None])
        half = 0.5 * float(s["heading"][0])
        for name, signal in PLACES.items():
            place, heading = s[signal][None, :3], np.array([[0.0, 0.0, np.sin(half), np.cos(half)]])
            motions[f"reference/{name}"] = Motion(
                position=place,
                quaternion=s[signal][None, 3:7] if name == "estimate" else heading,
                visible=np.isfinite(place).all(keepdims=True)[0],
            )
        (begin, end), (x, y) = self._strip or (0.0, 1.0), s["q"][:2]
        middle, turn = 0.5 * (begin + end), 0.5 * self._slope
        motions["friction_strip"] = Motion(
            position=np.array(
                [[middle, y, s["below"] + np.tan(self._slope) * (middle - x) - 0.001]]
            ),
            quaternion=np.array([[0.0, -np.sin(turn), 0.0, np.cos(turn)]]),
            scale=np.array([[end - begin, 1.0, 1.0]]),
            visible=np.array([self._strip is not None]),
        )
        self._drawn.move(motions)

    def lay_ground(
        self, friction: float, friction_strips: tuple[tuple[float, float, float], ...]
    ) -> None:
        """Colour the ground by its friction, and lay the first strip: from x, to x, m, and friction
        of each.
        """
        if friction != self._mu:
            self._mu = friction
            self._floor.plane_color = as_rgb(ground_colour(friction))
        self._strip = friction_strips[0][:2] if friction_strips else None

    def draw_trails(self) -> None:
        """Show the trails as they are; slower than the rest."""
        for name, handle in self._trails.items():
            line = np.array(self._points[name])
            if len(line) > 1:
                handle.points = np.stack((line[:-1], line[1:]), axis=1).astype(np.float32)

    def _follow(self, s: Any) -> None:
        """Move the scene's origin after the body, and the floor with it."""
        desired = np.array([s["q"][0], s["q"][1], s["below"]])
        if self._slope != (slope := float(s["ground_slope"])):
            self._slope = slope
            self._floor.wxyz = (float(np.cos(0.5 * slope)), 0.0, -float(np.sin(0.5 * slope)), 0.0)
        passed = float(s["t"]) - self._time
        self._time = float(s["t"])
        gap = desired - self.origin
        if np.hypot(gap[0], gap[1]) > JUMP or passed < 0.0:
            self.origin = desired
            for points in self._points.values():
                points.clear()
        else:
            self.origin = self.origin + gap * (1.0 - np.exp(-max(passed, 0.0) / FOLLOW_TIME))
        self.body = s["q"][:3] - self.origin
        for name, place in (("target", s["x_r"]), ("body", s["q"])):
            points = self._points[name]
            height = s["below"] + np.tan(s["ground_slope"]) * (place[0] - s["q"][0]) + 0.003
            here = np.array([place[0], place[1], height])
            if not points or np.linalg.norm(here - points[-1]) > TRAIL_STEP:
                points.append(here)
                del points[:-TRAIL]
        x, y = self.origin[:2]
        c, rise = np.cos(self._slope), np.tan(self._slope)
        along = -((x / c) % SECTION) * c
        self._floor.position = (along, -(y % SECTION), rise * along - 0.002)


def _size(robot: Robot) -> float:
    """Size of a robot as it stands, relative to Harpy's; smaller ones fill the picture, too."""
    if is_harpy(robot):
        return 1.0
    q, _ = Standing(robot).initial_state()
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.closed(q))
    points = np.array([data.oMi[joint].translation for joint in range(1, robot.model.njoints)])
    feet = np.array([data.oMf[robot.frame_id(name)].translation for name in robot.feet])
    around = np.linalg.norm(np.concatenate((points, feet))[:, :2], axis=1).max()
    return float(max(q[2], 0.9 * points[:, 2].max(), 1.7 * around) / HARPY_HEIGHT)


def _frame(size: float) -> Lines:
    """The twelve edges of a cube."""
    corners = (
        0.5
        * size
        * np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    )
    pairs = [(a, b) for a in range(8) for b in range(a) if (a ^ b) in (1, 2, 4)]
    return Lines(corners[np.array(pairs)])


def _set_stage(scene: viser.SceneApi) -> None:
    """A bright sky, a lamp that casts shadows, and nothing from the network."""
    scene.set_up_direction("+z")
    scene.world_axes.visible = False
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False)
    scene.add_light_hemisphere(
        "/light/sky", sky_color=(255, 255, 255), ground_color=(205, 200, 190), intensity=1.8
    )
    scene.add_light_directional(
        "/light/lamp", intensity=2.0, cast_shadow=True, position=(1.5, -2.5, 5.0)
    )


class ViserScene:
    """Nodes and motions as viser draws them, below a frame that stands for the world's: what has
    changed is sent.

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
            if motion.position is not None and not np.array_equal(
                handle.position, motion.position[0]
            ):
                handle.position = motion.position[0]
            if motion.quaternion is not None:
                x, y, z, w = motion.quaternion[0].tolist()
                if not np.array_equal(handle.wxyz, (w, x, y, z)):
                    handle.wxyz = w, x, y, z
            if motion.scale is not None and not np.allclose(
                handle.scale, motion.scale[0], rtol=0.0, atol=1e-6
            ):
                handle.scale = tuple(motion.scale[0].tolist())

    def _draw(self, node: Node) -> Any:
        scene, shape, look, name = self._scene, node.shape, node.look, f"/walk/{node.path}"
        place = _place(node.placement)
        if isinstance(shape, Lines):
            return scene.add_line_segments(
                name,
                shape.points,
                as_rgb(look.colour),
                thickness=EDGE,
                thickness_units="screen",
                **place,
            )
        body = look.light == "body"
        place |= {
            "color": as_rgb(look.colour),
            "cast_shadow": body,
            "receive_shadow": body or look.light == "ground",
        }
        place |= {"opacity": look.opacity if look.opacity < 1.0 else None}
        if isinstance(shape, Box):
            return scene.add_box(name, dimensions=shape.size, **place)
        if isinstance(shape, Sphere):
            return scene.add_icosphere(name, radius=shape.radius, **place)
        if isinstance(shape, Cylinder):
            return scene.add_cylinder(name, radius=shape.radius, height=shape.length, **place)
        return scene.add_mesh_simple(
            name,
            shape.vertices,
            shape.faces,
            flat_shading=body,
            side="front" if body else "double",
            **place,
        )


def _place(placement: Vector) -> dict[str, Any]:
    """Position and quaternion of a placement, as viser takes them."""
    motion = from_matrices(placement[None])
    assert motion.position is not None
    assert motion.quaternion is not None
    x, y, z, w = motion.quaternion[0].tolist()
    return {"position": tuple(motion.position[0].tolist()), "wxyz": (w, x, y, z)}
