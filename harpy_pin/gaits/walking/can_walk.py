"""Whether the legs of a robot can walk."""

import numpy as np

from harpy_pin.gaits.fitting import leg_length
from harpy_pin.model.legs import legs
from harpy_pin.model.posed import Posed
from harpy_pin.model.robot import Robot

DIRECTION = 0.3
"""Least singular value of the Jacobian of a level sole that moves forward and aside, in lengths of
the leg.
"""
SHORT_LEG = "'{}' has a leg of fewer than three joints: its feet cannot go aside"
"""Why a robot cannot walk."""


def why_no_walk(robot: Robot) -> str:
    """Why the legs of a robot cannot walk, in one sentence; empty where they can.

    A foot has to go forward and aside, and a sole to stay level on its way: directions of the
    foot's Jacobian that the joints of its leg have to have, in the posture or at zero. They need
    not turn it about the vertical.
    """
    q = robot.neutral
    zero = np.clip(0.0, robot.joint_lower, robot.joint_upper)
    q[7:] = zero if robot.posture is None else robot.posture
    posed = Posed(robot, q)
    for leg in legs(robot):
        joints = len(leg.joints)
        if joints < 3:
            return SHORT_LEG.format(robot.name)
        jacobian = np.mean([posed.jacobian(name) for name in leg.points], axis=0)
        level = jacobian[:, leg.columns][[0, 4, 1, 3]]  # (forward, pitch, aside, roll)
        level = level[:3] if len(leg.points) == 2 else level  # a line rolls
        level[[0, 2]] /= leg_length(robot)
        way, size, _ = np.linalg.svd(level)
        if len(leg.points) > 1 and size[-1] < DIRECTION:
            where = "aside" if np.abs(way[2:, -1]).max() > np.abs(way[:2, -1]).max() else "forward"
            return (
                f"'{robot.name}' cannot walk on soles: the {joints} joints of the leg of "
                f"'{leg.points[0]}' cannot move it {where} and keep it level"
            )
    return ""
