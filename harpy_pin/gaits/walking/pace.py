"""How long a step lasts and how fast a robot walks, from its legs and motors."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from harpy_pin.gaits.standing import GRAVITY
from harpy_pin.gaits.walking.motors import fastest_speed, swing_load
from harpy_pin.gaits.walking.settings import Build, draw_together
from harpy_pin.gaits.walking.swinging import NEAR, STRAIGHT_NEAR, upright_end
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["Pace", "pace_of"]

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
"""Share that is used of the reach that is left where feet are drawn together: a stretched leg carries nothing."""
MOST_PUSH, FREE_PUSH = 0.25, 0.22
"""Largest acceleration of the body by legs that are swung, as a share of gravity; and that from which on their motors,
which then have to hold the body too, swing them with less of their torques."""
PEAK = 15.6
"""Of the acceleration of two feet that are swung, in the velocity of the walk over the duration of a step."""
MOST_LOAD = 0.85
"""Largest torque of a leg that swings, as a share of its limit."""


@dataclass(frozen=True)
class Pace:
    """How long the steps of a walk last, and how fast it goes.

    Attributes:
        step_duration: of a slow walk, s.
        double_support: share of a step in which every foot is on the ground, at the largest speed.
        slow_double_support: the same of a robot that hardly walks.
        gentle: whether feet go down slowly, and take over the load slowly.
        stride: longest way of a step, m: beyond, steps are shorter in time.
        max_speed: largest velocity of a foot's place, m/s.
    """

    step_duration: float
    double_support: float
    slow_double_support: float
    gentle: bool
    stride: float
    max_speed: float


def pace_of(
    robot: Robot, q: Vector, build: Build, group: NDArray[np.int64], clearance: float, *, max_speed: float | None
) -> Pace:
    """The pace of a robot.

    Args:
        robot: with feet.
        q: (nq,) configuration in which it stands.
        build: how it is built.
        group: (feet,) in which step of the cycle each foot swings.
        clearance: height of a foot at mid-swing, m.
        max_speed: m/s, where that is given; otherwise what legs and motors can do.
    """
    groups = int(group.max()) + 1
    natural, soles = float(np.sqrt(build.leg / GRAVITY)), bool(robot.flat_feet)
    gentle = groups == 2 and len(build.place) == 4 and not soles and not _one_behind_the_other(build, group)
    double_support = SOLE_BOTH if soles else BOTH if len(build.place) == 4 else POINT_BOTH
    slow = SLOW_BOTH if gentle else double_support
    duration = (SOLE_STEP if soles else max(STEP, SWING * GRAVITY / build.swing)) * natural
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
