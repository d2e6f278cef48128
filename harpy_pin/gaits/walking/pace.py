"""How long a step lasts and how fast a robot walks, from its legs and the inverse dynamics of their swing."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from math import inf

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.gaits.standing import GRAVITY
from harpy_pin.gaits.walking.build import Build, Pace, draw_together
from harpy_pin.gaits.walking.pendulum import toward
from harpy_pin.gaits.walking.swinging import NEAR, STRAIGHT_NEAR, UPRIGHT_END, upright_end
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["fastest_speed", "pace_of", "swing_load"]

STEP, SOLE_STEP = 0.82, 1.7
"""Duration of a step on points and on soles, in √(leg / g)."""
SWING = 15.5
"""Least duration of a step of heavy legs with weak motors, in √(g leg) over the acceleration that these give a foot."""
STRIDE = 0.6
"""Longest way of a step, in lengths of the leg."""
BOTH, POINT_BOTH, SOLE_BOTH = 0.05, 0.1, 0.15
"""Share of a step in which every foot is on the ground: on four feet, on two points, on soles."""
SLOW_BOTH = 0.2
"""The same on four feet that hardly walk: where the load goes over slowly, ground that gives way hardly moves feet."""
SPEED, SLOW_SPEED, SOLE_SPEED = 0.8, 0.65, 0.13
"""Largest velocity of a foot's place in √(g leg): where two groups of point feet on four legs take turns; on other
points; on soles."""
LEFT = 0.75
"""Share that is used of the reach that is left where feet are drawn together: a stretched leg cannot push."""
MOST_PUSH, FREE_PUSH = 0.25, 0.22
"""Largest acceleration of the body by legs that are swung, as a share of gravity; and that from which on their motors,
which then have to hold the body too, swing them with less of their torques."""
PEAK = 15.6
"""Of the acceleration of two feet that are swung, in the velocity of the walk over the duration of a step."""
MOST_LOAD = 0.85
"""Largest torque of a leg that swings, as a share of its limit."""
SAMPLES = 30
"""Of a swing."""
ITERATIONS = 6
"""Of the inverse kinematics at each of them, from the one before."""
SMALL = 1e-6
"""Regularises it where a leg is stretched, m²."""
HALVINGS = 7
"""Of the range of speeds."""


def pace_of(
    robot: Robot, q: Vector, build: Build, group: NDArray[np.int64], clearance: float, *, max_speed: float | None
) -> Pace:
    """The pace of a robot that stands in q, whose feet swing in the given groups.

    The largest speed is what legs and motors can do, where none is given.
    """
    groups = int(group.max()) + 1
    natural, soles = float(np.sqrt(build.leg / GRAVITY)), bool(robot.flat_feet)
    gentle = groups == 2 and len(build.place) == 4 and not soles and not _one_behind_the_other(build, group)
    double_support = SOLE_BOTH if soles else BOTH if len(build.place) == 4 else POINT_BOTH
    slow = SLOW_BOTH if gentle else double_support
    duration = (SOLE_STEP if soles else max(STEP, SWING * GRAVITY / build.swing_acceleration)) * natural
    runs = groups == 2 and len(build.place) == 4
    stride = STRIDE * build.leg if runs else inf
    share = SOLE_SPEED if soles else SPEED if runs else SLOW_SPEED
    most = share * GRAVITY * natural
    push = PEAK * float(np.abs(build.reaction[:, 0, 0]).max()) / GRAVITY
    if runs:
        most = min(most, float(np.sqrt(MOST_PUSH * stride / push)))
    if max_speed is not None:
        most = max_speed
    elif runs:

        def load(speed: float) -> float:
            shortened = min(duration, stride / speed)
            near = NEAR if gentle else STRAIGHT_NEAR
            upright = upright_end(speed, float(np.sqrt(GRAVITY / build.rise)) * build.height, near)
            pushed = max(push * speed / (shortened * FREE_PUSH), 1.0)
            return pushed * swing_load(robot, q, build, speed, shortened, double_support, clearance, upright)

        most = fastest_speed(load, most, MOST_LOAD)
    stance = (groups - 1 + double_support) * min(duration, stride / most)
    most = min(most, 2.0 * _reach(build, group) / stance)
    return Pace(duration, double_support, slow, gentle, stride, most)


def _one_behind_the_other(build: Build, group: NDArray[np.int64]) -> bool:
    """Whether two groups of feet stand one behind the other, so that the body goes to and fro between them."""
    ahead, aside = np.abs(build.place[group == 1, :2].mean(axis=0) - build.place[group == 0, :2].mean(axis=0))
    return bool(ahead > aside)


def _reach(build: Build, group: NDArray[np.int64]) -> float:
    """Largest horizontal distance that a foot goes from its place in the walk, m."""
    if group.max() != 1:
        return build.reach
    apart = build.place[:, :2] - build.place[:, :2].mean(axis=0)
    together = apart.copy()
    draw_together(together, group, build.narrow)
    drawn = float(np.linalg.norm(apart - together, axis=1).max())
    return LEFT * (build.reach - drawn) if drawn > 0.0 else build.reach


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

    The body goes straight on at the speed; a foot goes from half a stance behind its place to half a stance ahead. It
    moves vertically in the share ``upright`` of its swing, at the end.
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
    """Largest speed up to ``high`` at which a load, which grows with it, is not above ``most``."""
    if load(high) <= most:
        return high
    low = 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if load(middle) <= most else (low, middle)
    return low
