"""A standing posture for robots whose files have none: legs bent, every foot below its hip, all feet on one level."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin

from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.model.ik import solve_ik
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

BENT, SOLE_BENT = (0.75, 0.85, 0.65, 0.92), (0.92, 0.85, 0.75)
"""Heights of the hips above point feet and soles that are tried one after the other, in lengths of the leg."""
STARTS, ITERATIONS, CLOSE = 12, 60, 1e-6
"""Configurations from which each leg's inverse kinematics begins, its steps from each, at most, and its error, m."""
LEVEL = 2e-3
"""Largest difference between the heights of the feet in a posture, m."""
BACKWARD = 0.1
"""Of postures alike in their angles the one with the knees further back is taken, in rad² per metre."""


def leg_joints(robot: Robot, foot: str) -> list[int]:
    """Pinocchio's numbers of the joints between the base and the frame of a foot."""
    return [j for j in robot.model.supports[robot.model.frames[robot.frame_id(foot)].parentJoint] if j > 1]


@checked
def find_posture(robot: Robot) -> Vector:
    """(joints,) angles in which a robot stands, rad: those that were given; its file's, if its feet are on one level.

    Otherwise soles are level, and joints of no leg at zero or the next limit.

    Args:
        robot: with feet.

    Raises:
        InputError: no posture was found.
    """
    model, data, q = robot.model, robot.model.createData(), pin.neutral(robot.model)
    if robot.posture is not None:
        q[7:] = robot.posture
        pin.framesForwardKinematics(model, data, q)
        heights = [data.oMf[robot.frame_id(name)].translation[2] for name in robot.feet]
        if np.ptp(heights) < LEVEL or "posture" in robot.source:
            return robot.posture
    q[7:] = np.clip(0.0, robot.joint_lower, robot.joint_upper)
    pin.framesForwardKinematics(model, data, q)
    feet = [robot.feet[end - n : end] for end, n in zip(np.cumsum(robot.corners), robot.corners, strict=True)]
    hip, leg, target = np.empty((len(feet), 3)), np.empty(len(feet)), []
    for k, foot in enumerate(feet):
        corners = [data.oMf[robot.frame_id(name)] for name in foot]
        middle = np.mean([corner.translation for corner in corners], axis=0)
        joints = leg_joints(robot, foot[0])[-2 if len(foot) == 1 else -4 :]  # from the hip's pitch on
        points = [*(data.oMi[j].translation for j in joints), middle]
        hip[k], leg[k] = points[0], sum(float(np.linalg.norm(b - a)) for a, b in pairwise(points))
        turn = pin.Quaternion.FromTwoVectors(corners[0].rotation[:, 2], np.array((0.0, 0.0, 1.0))).matrix()
        place = np.array((hip[k, 0], middle[1], 0.0)) + turn @ (corners[0].translation - middle)
        target.append(pin.SE3(turn @ corners[0].rotation, place))
    for bent in SOLE_BENT if robot.flat_feet else BENT:
        posture, down = q.copy(), pin.SE3(np.eye(3), np.array((0.0, 0.0, (hip[:, 2] - bent * leg).max())))
        ends = [(foot, down * end) for foot, end in zip(feet, target, strict=True)]
        if all(_bend(robot, q, foot[0], end if len(foot) > 1 else end.translation, posture) for foot, end in ends):
            return np.array(posture[7:])
    message = f"no standing posture of '{robot.name}' was found: give one, of {len(robot.joints)} angles"
    raise InputError(f"{message} in the order of robot.joints", name="posture")


def _bend(robot: Robot, q: Vector, foot: str, target: pin.SE3 | Vector, posture: Vector) -> bool:
    """Set the angles of a leg in a posture so that its frame is at a target; whether that is in reach."""
    model, data, joints = robot.model, robot.model.createData(), leg_joints(robot, foot)
    rng, least, columns = np.random.default_rng(0), np.inf, [model.joints[j].idx_q for j in joints]
    low, high = np.maximum(model.lowerPositionLimit, -np.pi), np.minimum(model.upperPositionLimit, np.pi)
    for _ in range(STARTS):
        start = q.copy()
        start[columns] = rng.uniform(low[columns], high[columns])
        found = solve_ik(robot, {foot: target}, start, tolerance=CLOSE, max_iterations=ITERATIONS, restarts=0)
        pin.forwardKinematics(model, data, found.q)
        cost = float(np.sum(found.q[columns] ** 2)) + BACKWARD * float(data.oMi[joints[-1]].translation[0])
        if found.converged and cost < least:
            least, posture[columns] = cost, found.q[columns]
    return least < np.inf
