"""Legs of a robot: which joints move a foot, and which of them is the knee, by their axes."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from harpy_pin.model.robot import Robot, feet_moved
from harpy_pin.model.tree import tree_record

PARALLEL = 0.9
"""Least cosine of the angle between the axes of hip and knee."""
APART = 5e-3
"""Least distance between these axes, m."""
HUB = 1e-3
"""Distance from the axis of the last joint within which a foot is its hub, m."""


@dataclass(frozen=True)
class Leg:
    """The joints that move one foot and no other.

    Attributes:
        points: frame names of the foot's contact points.
        joints: Pinocchio's numbers of the actuated joints, from the base on.
        columns: of these joints in a velocity.
        way: joints from the last one above the knee to the foot, passive ones, too; the leg's
            length is measured along them.
        knee: which of ``joints`` is the knee: the first one whose axis is parallel to that of a
            joint above it, and beside it, so that the two bend the leg; without such joints the
            second one, −1 where there are none.
        sprawls: whether the first of three joints turns the leg about the vertical at zero, as
            insects have it, and the last one moves the foot.
        hub: whether the foot is on the axis of the last joint, which then cannot move it.
    """

    points: tuple[str, ...]
    joints: tuple[int, ...]
    columns: tuple[int, ...]
    way: tuple[int, ...]
    knee: int
    sprawls: bool
    hub: bool


def legs(robot: Robot) -> list[Leg]:
    """The legs of a robot, in the order of its feet.

    Args:
        robot: any. Joints between its base and several feet, such as a waist, belong to no leg.
    """
    model, data = robot.model, robot.model.createData()
    moved, driven = feet_moved(model, robot.feet, robot.loops), robot.driven
    pin.forwardKinematics(model, data, robot.closed(robot.reference))
    own = tree_record(model)["axis"][0]
    axis = [np.zeros(3), *(data.oMi[j].rotation @ own[j - 1] for j in range(1, model.njoints))]
    found = []
    for last, corners in zip(np.cumsum(robot.corners), robot.corners, strict=True):
        points = robot.feet[last - corners : last]
        end = model.frames[robot.frame_id(points[0])]
        joints = tuple(j for j in robot.carriers(points[0]) if moved[j] == 1)
        bends = [
            any(
                abs(axis[i] @ axis[j]) > PARALLEL
                and np.linalg.norm(
                    np.cross(axis[j], data.oMi[j].translation - data.oMi[i].translation)
                )
                > APART
                for i in joints[:k]
            )
            for k, j in enumerate(joints)
        ]
        knee = bends.index(True) if any(bends) else min(1, len(joints) - 1)
        last_joint = end.parentJoint
        hub = last_joint in joints and bool(
            np.linalg.norm(np.cross(own[last_joint - 1], end.placement.translation)) < HUB
        )
        hip = joints[max(knee - 1, 0)] if joints else model.njoints
        way = tuple(j for j in model.supports[end.parentJoint] if j >= hip)
        columns = tuple(6 + driven.index(j) for j in joints)
        sprawls = len(joints) == 3 and not hub and bool(abs(axis[joints[0]][2]) > PARALLEL)
        found.append(Leg(points, joints, columns, way, knee, sprawls, hub))
    return found
