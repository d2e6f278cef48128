"""Standing postures of robots whose files have none: legs bent, every foot below its hip, all feet
on one level.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.model.ik import Problem
from harpy_pin.model.legs import Leg, legs
from harpy_pin.model.posed import Posed
from harpy_pin.model.robot import Robot, configuration
from harpy_pin.model.state import Vector

BENT, SOLE_BENT = (0.75, 0.85, 0.65, 0.92), (0.92, 0.85, 0.75)
"""Heights of the hips above point feet and soles that are tried one after the other, in lengths of
the leg.
"""
STARTS, ITERATIONS, CLOSE = 12, 60, 1e-6
"""Configurations from which each leg's inverse kinematics begins, its steps from each, at most, and
its error, m.
"""
UPRIGHT = 0.7
"""Cosine of the angle between the normal of a sole and the vertical, below which a message says
it.
"""
LEVEL = 2e-3  # largest difference between the heights of the feet in a posture, m
BACKWARD = 0.1
"""Of postures alike in their angles the one with the knees further back is taken, in rad² per
metre.
"""


@checked
def find_posture(robot: Robot) -> Vector:
    """(joints,) angles in which a robot with feet stands, rad.

    They are those that were given; its file's, if its feet are on one level. Otherwise feet are
    below the hips, of sprawling legs below the knees as these are at zero; soles are level, and
    joints of no leg at zero or the next limit. An :class:`InputError` says that no such posture was
    found, and why it may be.
    """
    q = robot.neutral
    if robot.posture is not None:
        q[7:] = robot.posture
        posed = Posed(robot, q)
        heights = [posed.frame(name).translation[2] for name in robot.feet]
        if np.ptp(heights) < LEVEL or "posture" in robot.source:
            return robot.posture
    q[7:] = np.clip(robot.reference[7:], robot.joint_lower, robot.joint_upper)
    posed, found = Posed(robot, q), legs(robot)
    hips, lengths, ends = zip(*(_stretched(posed, leg) for leg in found), strict=True)
    for bent in SOLE_BENT if robot.flat_feet else BENT:
        below = (np.array(hips)[:, 2] - bent * np.array(lengths)).max()
        down = pin.SE3(np.eye(3), np.array((0.0, 0.0, below)))
        posture, pairs = q.copy(), zip(found, ends, strict=True)
        if all(leg.joints and _bend(robot, q, leg, down * end, posture) for leg, end in pairs):
            return np.array(posture[7:])
    raise InputError(_why_none(robot, posed, found), name="posture")


def _stretched(posed: Posed, leg: Leg) -> tuple[Vector, float, pin.SE3]:
    """Of a leg its hip (3,), its length, m, and where its first contact point is with the foot
    level below the hip, of which the height does not count.
    """
    corners = [posed.frame(name) for name in leg.points]
    middle = np.mean([corner.translation for corner in corners], axis=0)
    below = leg.joints[leg.knee :] if leg.sprawls else leg.way
    points = [*(posed.joint(j) for j in below), middle]
    length = sum(float(np.linalg.norm(b - a)) for a, b in pairwise(points))
    upward = np.array((0.0, 0.0, 1.0))
    turn = pin.Quaternion.FromTwoVectors(corners[0].rotation[:, 2], upward).matrix()
    aside = points[0][1] if leg.sprawls else middle[1]
    place = np.array((points[0][0], aside, 0.0)) + turn @ (corners[0].translation - middle)
    return points[0], length, pin.SE3(turn @ corners[0].rotation, place)


def _why_none(robot: Robot, posed: Posed, found: Sequence[Leg]) -> str:
    """That no posture was found, and why it may be."""
    message = f"no standing posture of '{robot.name}' was found: give one, of "
    message += f"{len(robot.joints)} angles in the order of robot.joints"
    up = [posed.frame(leg.points[0]).rotation[2, 2] for leg in found if len(leg.points) > 1]
    if min(up, default=1.0) < UPRIGHT:
        message += "; its soles do not face the ground at zero: a FlatFoot has an orientation"
    lame = [leg.points[0] for leg in found if not leg.joints]
    if lame:
        message += f"; no joint moves '{lame[0]}' alone"
    hub = next((leg for leg in found if leg.hub), None)
    if hub is not None:
        axis = robot.model.names[hub.joints[-1]]
        message += f"; '{hub.points[0]}' is on the axis of '{axis}', which cannot move it: "
        message += "a foot is at the end of its leg"
    still = np.flatnonzero(robot.joint_lower == robot.joint_upper)
    fixed = [robot.joints[k - 6] for leg in found for k in leg.columns if k - 6 in still]
    if fixed:
        message += f"; {len(fixed)} joints of its legs have no range, such as '{fixed[0]}'"
    return message


def _bend(robot: Robot, q: Vector, leg: Leg, end: pin.SE3, posture: Vector) -> bool:
    """Set the angles of a leg in a posture so that its first contact point is at a place, that of a
    sole turned as it is there; whether that is in reach. Joints of no leg stay as in q.
    """
    own, place, sole = [k - 6 for k in leg.columns], robot.layout[0], len(leg.points) > 1
    columns, others = place[own], np.delete(place, own)
    problem = Problem(robot, {leg.points[0]: end if sole else end.translation})
    problem.lower[others - 7] = problem.upper[others - 7] = q[others]
    low, high = (limit[columns - 7] for limit in problem.ranges)
    rng, least = np.random.default_rng(0), np.inf
    for _ in range(STARTS):
        start = q.copy()
        start[columns] = rng.uniform(low, high)
        start = problem.bounded(configuration(robot, start))
        found = problem.descend(start, tolerance=CLOSE, max_iterations=ITERATIONS)
        if not found.converged:
            continue
        knee = Posed(robot, found.q).joint(leg.way[-1])
        cost = float(np.sum(found.q[columns] ** 2)) + BACKWARD * float(knee[0])
        if cost < least:
            least, posture[columns] = cost, found.q[columns]
    if least < np.inf and len(columns) > (6 if sole else 3):
        _straighten(problem, posture, columns, leg.columns)
    return least < np.inf


def _straighten(
    problem: Problem, posture: Vector, columns: NDArray[np.int64], moving: Sequence[int]
) -> None:
    """Of a leg with more joints than its foot needs, move them to the least angles that leave the
    foot where it is.

    So legs that mirror each other have postures that do: of all that reach, drawn configurations
    find any.
    """
    for _ in range(ITERATIONS):
        jacobian, angles = problem.jacobian(posture)[:, list(moving)], posture[columns]
        nearer = posture.copy()
        nearer[columns] = np.linalg.pinv(jacobian) @ (jacobian @ angles)
        found = problem.descend(problem.bounded(nearer), tolerance=CLOSE, max_iterations=ITERATIONS)
        less = np.linalg.norm(found.q[columns]) < np.linalg.norm(angles)
        if not (found.converged and less):
            return
        posture[columns] = found.q[columns]
