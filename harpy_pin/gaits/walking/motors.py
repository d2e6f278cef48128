"""How fast a robot's motors let it swing its legs: by the inverse dynamics of a swing at that speed."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pinocchio as pin

from harpy_pin.gaits.walking.pendulum import toward
from harpy_pin.gaits.walking.settings import Build
from harpy_pin.gaits.walking.swinging import UPRIGHT_END
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["fastest_speed", "swing_load"]

SAMPLES = 30
"""Of a swing."""
ITERATIONS = 6
"""Of the inverse kinematics at each of them, from the one before."""
SMALL = 1e-6
"""Regularises it where a leg is stretched, m²."""
HALVINGS = 7
"""Of the range of speeds."""


def swing_load(
    robot: Robot,
    q: Vector,
    build: Build,
    speed: float,
    step_duration: float,
    double_support: float,
    clearance: float,
    upright: float = UPRIGHT_END,
) -> float:
    """Largest torque of the motors of a leg that swings, as a share of their limits; of the weakest leg.

    The body goes straight on at the speed; a foot goes from half a stance behind its place to half a stance ahead.

    Args:
        robot: with feet.
        q: (nq,) configuration in which it stands.
        build: how it is built.
        speed: forward, m/s.
        step_duration: s.
        double_support: share of a step in which every foot is on the ground.
        clearance: height of a foot at mid-swing, m.
        upright: share of its swing, at the end, in which a foot moves vertically.
    """
    model, data = robot.model, robot.model.createData()
    duration = (1.0 - double_support) * step_duration
    time, rest = np.linspace(0.0, duration, SAMPLES), (1.0 - upright) * duration
    ahead = np.array([toward(0.0, 0.0, 0.0, 1.0, rest, min(t, rest))[0] for t in time])
    u = np.minimum(time / rest, 1.0)
    way = np.zeros((SAMPLES, 3))
    way[:, 0] = speed * (2.0 * step_duration * ahead - 0.5 * (1.0 + double_support) * step_duration - time)
    way[:, 2] = q[2] - build.height + 64.0 * clearance * (u * (1.0 - u)) ** 3
    worst = 0.0
    for first in np.cumsum((0, *robot.corners))[:-1]:
        path, joints = _follow(robot, q, robot.feet[first], way)
        rate = [pin.difference(model, a, b) / time[1] for a, b in pairwise(path)]
        for i in range(1, SAMPLES - 1):
            torque = pin.rnea(model, data, path[i], 0.5 * (rate[i - 1] + rate[i]), (rate[i] - rate[i - 1]) / time[1])
            worst = max(worst, float(np.max(np.abs(torque[joints]) / model.effortLimit[joints])))
    return worst


def _follow(robot: Robot, q: Vector, foot: str, way: Vector) -> tuple[list[Vector], list[int]]:
    """Configurations in which one leg brings its foot along a way, and the columns of this leg's joints."""
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id(foot)
    pin.framesForwardKinematics(model, data, q)
    start, path = data.oMf[frame].translation.copy(), []
    joints = [model.joints[j].idx_v for j in model.supports[model.frames[frame].parentJoint] if j > 1]
    for offset in way:
        for _ in range(ITERATIONS):
            jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:3, joints]
            step = np.zeros(model.nv)
            missing = start + offset - data.oMf[frame].translation
            step[joints] = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + SMALL * np.eye(3), missing)
            q = pin.integrate(model, q, step)
            pin.framesForwardKinematics(model, data, q)
        path.append(q)
    return path, joints


def fastest_speed(load: Callable[[float], float], high: float, most: float) -> float:
    """Largest speed up to some bound at which a load is below another.

    Args:
        load: of a speed, growing.
        high: the bound, m/s.
        most: of the load.
    """
    if load(high) <= most:
        return high
    low = 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if load(middle) <= most else (low, middle)
    return low
