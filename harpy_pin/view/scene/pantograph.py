"""Harpy's real lower leg: shin and tarsus of the parallelogram whose other two sides the URDF's chain draws.

The model is the equivalent serial chain (equations.md §3): thigh and tarsus in one link of 0.5 m, the shin at its end.
The real shin begins at the knee motor, 0.3 m down the thigh, and stays parallel to the serial one; the tarsus leads
from its end to the foot, parallel to the thigh.

A ``node`` is a Meshcat visualizer at the path of what is drawn, in world axes; what moves is added to ``animation``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from meshcat import geometry as g
from meshcat.animation import Animation

from harpy_pin.errors import RobotError
from harpy_pin.model.kinematics import LegGeometry
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.scene.frames import Frames
from harpy_pin.view.scene.motion import Motion
from harpy_pin.view.scene.motion import from_matrices as rigid

__all__ = ["Pantograph", "draw_pantograph", "find_pantograph"]

MOTOR_TOLERANCE = 0.02
"""How far the thigh's centre of mass may be from the knee motor's place, m."""
CARBON, ROD = 0x22252A, 0xBFC2C7


@dataclass(frozen=True)
class Pantograph:
    """Lower leg of one foot.

    Attributes:
        foot: name of the foot's frame.
        thigh_joint: index of the hip sagittal joint, whose frame is the thigh's.
        shank_joint: index of the serial chain's knee.
        thigh: hip sagittal axis to knee motor, m.
        shin: length of the shin, m.
        tarsus: length of the tarsus, m.
    """

    foot: str
    thigh_joint: int
    shank_joint: int
    thigh: float
    shin: float
    tarsus: float

    def motor(self, joints: Vector) -> Vector:
        """(n, 3) knee motor, world, m, from (n, model joints, 4, 4) joint placements."""
        thigh = joints[:, self.thigh_joint]
        return np.asarray(thigh[:, :3, 3] - self.thigh * thigh[:, :3, 2])

    def ankle(self, joints: Vector) -> Vector:
        """(n, 3) end of the shin, where the tarsus begins, world, m."""
        return np.asarray(self.motor(joints) - self.shin * joints[:, self.shank_joint, :3, 2])

    def end(self, joints: Vector) -> Vector:
        """(n, 3) end of the tarsus, which is the foot, world, m."""
        return np.asarray(self.ankle(joints) - self.tarsus * joints[:, self.thigh_joint, :3, 2])


def find_pantograph(robot: Robot, foot: str) -> Pantograph | None:
    """The lower leg of a foot, where the leg is of Harpy's kind.

    That is: a hip x, hip y, knee y chain whose upper link is longer than the lower one, with its mass (the knee motor)
    where the shin of a parallelogram would begin. An ordinary serial leg has its mass elsewhere.

    Returns:
        None where the leg is of another kind.
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
    return Pantograph(foot, int(chain[1]), int(chain[2]), thigh, leg.lower, leg.lower)


def draw_pantograph(node: Any, animation: Animation, leg: Pantograph, frames: Frames) -> None:
    """Add shin and tarsus to a scene and its animation."""
    joints = frames.joints
    shin, tarsus = joints[:, leg.shank_joint].copy(), joints[:, leg.thigh_joint].copy()
    shin[:, :3, 3], tarsus[:, :3, 3] = leg.motor(joints), leg.ankle(joints)
    for name, placement, length, width in (("shin", shin, leg.shin, 0.022), ("tarsus", tarsus, leg.tarsus, 0.018)):
        bar = np.eye(4)
        bar[2, 3] = -0.5 * length
        node[name]["bar"].set_object(g.Box([width, 0.014, length]), g.MeshPhongMaterial(color=CARBON, shininess=45))
        node[name]["bar"].set_transform(bar)
        rigid(placement).apply(node[name], animation, frames.time)
    # Pins where the bars turn: the ankle, and the serial knee at the opposite corner of the parallelogram.
    pin_material = g.MeshPhongMaterial(color=ROD, shininess=60)
    for name, joint, point in (
        ("ankle_pin", leg.thigh_joint, leg.ankle(joints)),
        ("knee_pin", leg.shank_joint, joints[:, leg.shank_joint, :3, 3]),
    ):
        node[name]["pin"].set_object(g.Cylinder(0.05, 0.008), pin_material)
        motion = rigid(joints[:, joint])
        Motion(position=point, quaternion=motion.quaternion).apply(node[name], animation, frames.time)
