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

__all__ = ["find_posture", "leg_joints"]

BENT, SOLE_BENT = (0.75, 0.85, 0.65, 0.92), (0.92, 0.85, 0.75)
"""Heights of the hips above point feet and soles that are tried one after the other, in lengths of the leg."""
STARTS, ITERATIONS = 12, 60
"""Configurations from which each leg's inverse kinematics begins, and most of its steps from each."""
CLOSE = 1e-6
"""Largest error of a foot's place, m, and of a sole's orientation, rad."""
BACKWARD = 0.1
"""Of postures alike in their angles the one with the knees further back is taken, in rad² per metre."""


def leg_joints(robot: Robot, foot: str) -> list[int]:
    """Pinocchio's numbers of the joints between the base and the frame of a foot."""
    return [j for j in robot.model.supports[robot.model.frames[robot.frame_id(foot)].parentJoint] if j > 1]


@checked
def find_posture(robot: Robot) -> Vector:
    """(joints,) angles of a posture in which a robot stands, rad.

    Soles are level, and joints of no leg are at zero, or at the limit next to it.

    Args:
        robot: with feet.

    Raises:
        InputError: no posture was found.
    """
    model, data, q = robot.model, robot.model.createData(), pin.neutral(robot.model)
    q[7:] = np.clip(q[7:], robot.joint_lower, robot.joint_upper)
    pin.framesForwardKinematics(model, data, q)
    ends = np.cumsum(robot.corners)
    feet = [robot.feet[end - count : end] for end, count in zip(ends, robot.corners, strict=True)]
    hip, place, leg = np.empty((len(feet), 3)), np.empty((len(feet), 3)), np.empty(len(feet))
    for k, foot in enumerate(feet):
        place[k] = np.mean([data.oMf[robot.frame_id(name)].translation for name in foot], axis=0)
        joints = leg_joints(robot, foot[0])[-2 if len(foot) == 1 else -4 :]  # from the hip's pitch on
        points = [*(data.oMi[j].translation for j in joints), place[k]]
        hip[k], leg[k] = points[0], sum(float(np.linalg.norm(b - a)) for a, b in pairwise(points))
    for bent in SOLE_BENT if robot.flat_feet else BENT:
        level = np.full(len(feet), (hip[:, 2] - bent * leg).max())
        for aside in (place[:, 1], hip[:, 1]):
            desired, posture = np.column_stack((hip[:, 0], aside, level)), q.copy()
            if all(_bend(robot, q, foot, desired[k], posture) for k, foot in enumerate(feet)):
                return np.array(posture[7:])
    message = f"no standing posture of '{robot.name}' was found: give one, of {len(robot.joints)} angles"
    raise InputError(f"{message} in the order of robot.joints", name="posture")


def _bend(robot: Robot, q: Vector, foot: tuple[str, ...], place: Vector, posture: Vector) -> bool:
    """Set the angles of a leg in a posture so that its foot is at a place; whether that is in reach from q.

    The foot is its contact points: several are the corners of a sole, which is level there.
    """
    model, data, joints = robot.model, robot.model.createData(), leg_joints(robot, foot[0])
    target: pin.SE3 | Vector = place
    if len(foot) > 1:
        corners = [model.frames[robot.frame_id(name)].placement for name in foot]
        middle = corners[0].actInv(np.mean([corner.translation for corner in corners], axis=0))
        pin.framesForwardKinematics(model, data, q)
        turn = data.oMf[robot.frame_id(foot[0])].rotation
        turn = pin.Quaternion.FromTwoVectors(turn[:, 2], np.array((0.0, 0.0, 1.0))).matrix() @ turn
        target = pin.SE3(turn, place - turn @ middle)
    rng, least = np.random.default_rng(0), np.inf
    columns = [model.joints[j].idx_q for j in joints]
    low, high = np.maximum(model.lowerPositionLimit, -np.pi), np.minimum(model.upperPositionLimit, np.pi)
    for _ in range(STARTS):
        start = q.copy()
        start[columns] = rng.uniform(low[columns], high[columns])
        found = solve_ik(robot, {foot[0]: target}, start, tolerance=CLOSE, max_iterations=ITERATIONS, restarts=0)
        pin.forwardKinematics(model, data, found.q)
        cost = float(np.sum(found.q[columns] ** 2)) + BACKWARD * float(data.oMi[joints[-1]].translation[0])
        if found.converged and cost < least:
            least, posture[columns] = cost, found.q[columns]
    return least < np.inf
