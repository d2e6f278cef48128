"""The torques that a walk takes: of the legs that hold the weight, and of those that swing."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.errors import InputError
from harpy_pin.gaits.swing import toward
from harpy_pin.gaits.velocity import largest
from harpy_pin.gaits.walking.build import Build
from harpy_pin.model.legs import legs
from harpy_pin.model.posed import Posed
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector

SAMPLES = 30
"""Samples of a swing."""
ITERATIONS = 6
"""Iterations of the inverse kinematics at each of them, from the one before."""
HALVINGS = 7
"""Of the height in search of what a foot can be raised."""
SMALL = 1e-6
"""Regularises it where a leg is stretched, m²."""


def holding_load(robot: Robot, q: Vector, group: NDArray[np.int64]) -> float:
    """Largest torque of the motors of the legs that hold the weight, in equal shares, while each
    group of feet swings, as a share of their limits.
    """
    posed, limit, found, worst = Posed(robot, q), robot.torque_limit, legs(robot), 0.0
    weight = posed.holding
    for swinging in range(int(group.max()) + 1):
        holding = [
            leg for leg, number in zip(found, group, strict=True) if number != swinging
        ] or found
        for leg in holding:
            up = np.mean([posed.jacobian(name)[2] for name in leg.points], axis=0)
            joints = np.array(leg.columns)
            torque = weight[joints] - up[joints] * robot.mass * GRAVITY / len(holding)
            worst = max(worst, float(np.max(np.abs(torque) / limit[joints - 6])))
    return worst


def swing_load(
    robot: Robot,
    q: Vector,
    build: Build,
    speed: float,
    step_duration: float,
    double_support: float,
    clearance: float,
    upright: float,
) -> float:
    """Largest torque of the motors of legs that swing, as a share of their limits.

    The body goes straight on at the speed; a foot goes from half a stance behind its place to half
    a stance ahead. It moves vertically in the share ``upright`` of its swing, at the end. All legs
    swing at once: none moves a motor of another one, because the body goes on as it does.
    """
    model, data = robot.model, robot.model.createData()
    duration, limit = (1.0 - double_support) * step_duration, robot.torque_limit
    time, rest = np.linspace(0.0, duration, SAMPLES), (1.0 - upright) * duration
    ahead = np.array([toward(0.0, 0.0, 0.0, 1.0, rest, min(t, rest))[0] for t in time])
    u = np.minimum(time / rest, 1.0)
    way = np.zeros((SAMPLES, 3))
    way[:, 0] = speed * (
        2.0 * step_duration * ahead - 0.5 * (1.0 + double_support) * step_duration - time
    )
    way[:, 2] = q[2] - build.height + 64.0 * clearance * (u * (1.0 - u)) ** 3
    joints, worst = np.array([column for leg in legs(robot) for column in leg.columns]), 0.0
    try:
        followed = _follow(robot, q, way)
    except InputError:  # a linkage does not go so far
        return np.inf
    path = [robot.closed(at) for at in followed]
    rate = [pin.difference(model, a, b) / time[1] for a, b in pairwise(path)]
    for i in range(1, SAMPLES - 1):
        speeds, change = 0.5 * (rate[i - 1] + rate[i]), (rate[i] - rate[i - 1]) / time[1]
        torque = pin.rnea(model, data, path[i], speeds, change)
        torque = (robot.velocity_map(followed[i]).T @ torque)[joints]
        worst = max(worst, float(np.max(np.abs(torque) / limit[joints - 6])))
    return worst


def free_lift(robot: Robot, q: Vector, build: Build, clearance: float) -> float:
    """Height up to the clearance to which each foot can be raised at its place, before a joint of
    its leg comes to its end; the clearance itself where the leg is beyond one before.
    """
    lower, upper = robot.joint_lower, robot.joint_upper
    place, unbounded = robot.layout
    joints = np.array([column for leg in legs(robot) for column in leg.columns]) - 6
    ranged = joints[(lower < upper)[joints] & (unbounded[joints] == 0)]

    def reached(lift: float) -> bool:
        try:
            way = np.array([[0.0, 0.0, q[2] - build.height + lift]])
            angle = _follow(robot, q, way)[0][place[ranged]]
        except InputError:  # a linkage does not go so far
            return False
        return bool(np.all((lower[ranged] <= angle) & (angle <= upper[ranged])))

    return largest(reached, clearance, halvings=HALVINGS) or clearance


def _follow(robot: Robot, q: Vector, way: Vector) -> list[Vector]:
    """Configurations in which each leg brings its foot along a way (samples, 3) from its place."""
    posed, path = Posed(robot, q), []
    feet = [(leg.points[0], np.array(leg.columns)) for leg in legs(robot)]
    start = {foot: posed.frame(foot).translation.copy() for foot, _ in feet}
    for offset in way:
        for _ in range(ITERATIONS):
            step = np.zeros(robot.nv)
            for foot, joints in feet:
                jacobian = posed.jacobian(foot)[:3, joints]
                missing = start[foot] + offset - posed.frame(foot).translation
                step[joints] = jacobian.T @ np.linalg.solve(
                    jacobian @ jacobian.T + SMALL * np.eye(3), missing
                )
            q = robot.integrate(q, step)
            posed = Posed(robot, q)
        path.append(q)
    return path
