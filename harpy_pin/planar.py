"""The robot in the sagittal plane: the same URDF on a base that moves in x, z and pitch, frontal joints locked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin

from harpy_pin.errors import InputError
from harpy_pin.robot import Robot

__all__ = ["planar_robot"]


def planar_robot(robot: Robot, *, locked: Sequence[str] = ("left_hip_frontal", "right_hip_frontal")) -> Robot:
    """A robot restricted to the plane y = 0.

    The base's coordinates are (x, z, pitch), its velocities their derivatives, so q and v have the same length.

    Args:
        robot: a robot on a free flyer.
        locked: joints held at zero.

    Raises:
        InputError: a joint to lock does not exist.
    """
    for name in locked:
        if not robot.model.existJointName(name):
            raise InputError.unknown("joint", name, robot.joints)
    base = pin.JointModelComposite(3)
    base.addJoint(pin.JointModelPX())
    base.addJoint(pin.JointModelPZ())
    base.addJoint(pin.JointModelRY())
    full = pin.buildModelFromUrdf(str(robot.urdf), base)
    for name in robot.joints:
        column = full.joints[full.getJointId(name)].idx_v
        full.armature[column] = robot.model.armature[robot.model.joints[robot.model.getJointId(name)].idx_v]
    model = pin.buildReducedModel(full, [full.getJointId(name) for name in locked], np.zeros(full.nq))
    model.gravity = robot.model.gravity
    return replace(robot, model=model)
