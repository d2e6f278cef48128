"""The robot: the shapes of its links at its joints, and Harpy's real lower leg.

Harpy's model is the equivalent serial chain (equations.md §3): thigh and tarsus in one link of 0.5
m, the shin at its end. The real shin begins at the knee motor, 0.3 m down the thigh, and stays
parallel to the serial one; the tarsus leads from its end to the foot, parallel to the thigh: a
parallelogram whose other two sides the URDF's chain draws.
"""

import warnings
from collections.abc import Iterable
from dataclasses import dataclass

import coal  # type: ignore[import-untyped]
import numpy as np
import pinocchio as pin

from harpy_pin.errors import RobotError
from harpy_pin.model.kinematics import LegGeometry
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import as_hex
from harpy_pin.view.scene.loop_rods import LoopRod, loop_ends, loop_rods
from harpy_pin.view.scene.meshes import mesh_parts
from harpy_pin.view.scene.nodes import (
    Box,
    Cylinder,
    Look,
    Mesh,
    Motion,
    Motions,
    Node,
    Shape,
    Sphere,
    from_matrices,
    node_name,
    revolved,
    shifted,
    turn_z_to,
)
from harpy_pin.view.scene.visuals import load_visuals

GREY, CARBON, ROD = (Look(colour, light="body") for colour in ("#666b75", "#22252a", "#bfc2c7"))
MOTOR_TOLERANCE = 0.02
"""How far the thigh's centre of mass may be from the knee motor's place, m."""


class RobotNodes:
    """A robot as it looks; one without visuals, or whose mesh files are missing, is a skeleton of
    rods between joints.

    Args:
        robot: who is drawn.
        height: of its body above the ground, m, from which a skeleton's rods are as thick as fits.

    Attributes:
        nodes: of all shapes.
    """

    def __init__(self, robot: Robot, height: float) -> None:
        self.names = [f"robot/{node_name(name)}" for name in robot.model.names]
        self.nodes: list[Node] = []
        for number, shape in enumerate(load_visuals(robot)):
            self._add_shape(
                f"{self.names[shape.parentJoint]}/{number}_{node_name(shape.name)}", shape
            )
        if not self.nodes:
            self._add_skeleton(robot, 0.02 * max(height, 0.1))
        legs = (find_pantograph(robot, foot) for foot in robot.feet)
        self._parts: list[Pantograph | LoopRod] = [
            *(leg for leg in legs if leg is not None),
            *loop_rods(robot),
        ]
        for part in self._parts:
            self.nodes += part.nodes

    def motions(self, joints: Vector) -> Motions:
        """Where everything is, from (n, model joints, 4, 4) joint placements."""
        motions = {name: from_matrices(joints[:, j]) for j, name in enumerate(self.names)}
        for part in self._parts:
            motions |= part.motions(joints)
        return motions

    def _add_shape(self, path: str, shape: pin.GeometryObject) -> None:
        """One shape in its joint's frame, in the URDF's colour or those of its mesh file."""
        place = shape.placement.homogeneous
        if isinstance(shape.geometry, coal.BVHModelBase):
            parts = mesh_parts(shape)
            for number, (mesh, colour) in enumerate(parts):
                name = path if len(parts) == 1 else f"{path}/{number}"
                self.nodes.append(Node(name, mesh, _look(colour), place))
            return
        if isinstance(shape.geometry, coal.Halfspace | coal.Plane):
            return  # a floor; the scene has its own
        drawn = _primitive(shape.geometry)
        if drawn is None:
            kind = type(shape.geometry).__name__
            warnings.warn(f"shape '{shape.name}' ({kind}) cannot be drawn", stacklevel=2)
        else:
            self.nodes.append(Node(path, drawn, _look(shape.meshColor), place))

    def _add_skeleton(self, robot: Robot, radius: float) -> None:
        """Rods from each joint to its child joints, feet and ends of loops, and a ball at each
        joint.
        """
        model = robot.model
        ends = [
            (model.parents[j], model.jointPlacements[j].translation)
            for j in range(2, model.njoints)
        ]
        frames = [model.frames[robot.frame_id(n)] for n in (*robot.feet, *loop_ends(robot))]
        ends += [(frame.parentJoint, frame.placement.translation) for frame in frames]
        for number, (joint, end) in enumerate(ends):
            name, length = self.names[joint], float(np.linalg.norm(end))
            self.nodes.append(Node(f"{name}/ball_{number}", Sphere(1.5 * radius), GREY))
            if length > 1e-6:
                turn = pin.Quaternion(turn_z_to((end / length)[None])[0]).matrix()
                placement = np.eye(4)
                placement[:3, :3], placement[:3, 3] = turn, 0.5 * end
                self.nodes.append(
                    Node(f"{name}/rod_{number}", Cylinder(length, radius), GREY, placement)
                )


def _primitive(shape: coal.CollisionGeometry) -> Shape | None:
    """A shape that is no mesh; None if it is of an unknown kind."""
    if isinstance(shape, coal.Box):
        x, y, z = (float(2.0 * side) for side in shape.halfSide)
        return Box((x, y, z))
    if isinstance(shape, coal.Sphere):
        return Sphere(float(shape.radius))
    if isinstance(shape, coal.Ellipsoid):
        angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 24)
        ball = revolved([(float(np.cos(a)), float(np.sin(a))) for a in angles])
        return Mesh(ball.vertices * shape.radii, ball.faces)
    if isinstance(
        shape, coal.Cylinder | coal.Capsule
    ):  # a capsule as a cylinder of the same overall length
        ends = shape.radius if isinstance(shape, coal.Capsule) else 0.0
        return Cylinder(float(2.0 * (shape.halfLength + ends)), float(shape.radius))
    if isinstance(shape, coal.Cone):
        half, radius = float(shape.halfLength), float(shape.radius)
        return revolved([(0.0, -half), (radius, -half), (0.0, half)])
    return None


def _look(rgba: Iterable[float]) -> Look:
    colour = tuple(rgba)
    return Look(as_hex(colour[:3]), float(np.clip(colour[3], 0.0, 1.0)), light="body")


@dataclass(frozen=True)
class Pantograph:
    """Lower leg of one foot."""

    path: str  # of its node
    thigh_joint: int  # index of the hip sagittal joint, whose frame is the thigh's
    shank_joint: int  # index of the serial chain's knee
    thigh: float  # hip sagittal axis to knee motor, m
    shin: float  # length of the shin and of the tarsus, m

    def motor(self, joints: Vector) -> Vector:
        """(n, 3) knee motor, world, m, from (n, model joints, 4, 4) joint placements."""
        thigh = joints[:, self.thigh_joint]
        return np.asarray(thigh[:, :3, 3] - self.thigh * thigh[:, :3, 2])

    def ankle(self, joints: Vector) -> Vector:
        """(n, 3) end of the shin, where the tarsus begins, world, m."""
        return np.asarray(self.motor(joints) - self.shin * joints[:, self.shank_joint, :3, 2])

    @property
    def nodes(self) -> list[Node]:
        """Shin, tarsus, and pins where they turn: the ankle, and the serial knee at the opposite
        corner.
        """
        half, across = shifted(z=-0.5 * self.shin), np.eye(4)
        across[:3, :3] = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
        bars = (("shin", 0.022), ("tarsus", 0.018))
        return [
            *(
                Node(f"{self.path}/{name}/bar", Box((width, 0.014, self.shin)), CARBON, half)
                for name, width in bars
            ),
            *(
                Node(f"{self.path}/{name}_pin/pin", Cylinder(0.05, 0.008), ROD, across)
                for name in ("ankle", "knee")
            ),
        ]

    def motions(self, joints: Vector) -> Motions:
        """The lower leg follows the joints of the equivalent chain."""
        shank, thigh = (
            from_matrices(joints[:, j]).quaternion for j in (self.shank_joint, self.thigh_joint)
        )
        ankle, knee = self.ankle(joints), joints[:, self.shank_joint, :3, 3]
        return {
            f"{self.path}/shin": Motion(position=self.motor(joints), quaternion=shank),
            f"{self.path}/tarsus": Motion(position=ankle, quaternion=thigh),
            f"{self.path}/ankle_pin": Motion(position=ankle, quaternion=thigh),
            f"{self.path}/knee_pin": Motion(position=knee, quaternion=shank),
        }


def find_pantograph(robot: Robot, foot: str) -> Pantograph | None:
    """The lower leg of a foot, where the leg is of Harpy's kind; None where it is of another.

    That is: a hip x, hip y, knee y chain whose upper link is longer than the lower one, with its
    mass (the knee motor) where the shin of a parallelogram would begin. An ordinary serial leg has
    its mass elsewhere.
    """
    try:
        leg = LegGeometry.from_robot(robot, foot)
    except RobotError:
        return None
    model = robot.model
    chain = list(model.supports[model.frames[robot.frame_id(foot)].parentJoint])[2:]
    thigh = leg.upper - leg.lower
    mass_at = -float(model.inertias[chain[1]].lever[2])
    if thigh <= 0.0 or leg.lower <= 0.0 or abs(mass_at - thigh) > MOTOR_TOLERANCE:
        return None
    return Pantograph(
        f"lower_leg/{node_name(foot)}", int(chain[1]), int(chain[2]), thigh, leg.lower
    )
