"""How long the steps of a walk last, and how fast it goes, by the inverse dynamics of its legs."""

from dataclasses import dataclass
from math import inf, isinf

import numpy as np
from numpy.typing import NDArray

from harpy_pin.errors import InputError
from harpy_pin.gaits.velocity import largest, warn_maker
from harpy_pin.gaits.walking.build import Build
from harpy_pin.gaits.walking.parameters import WalkingParameters
from harpy_pin.gaits.walking.pendulum import upright_share
from harpy_pin.gaits.walking.schedules import draw_together
from harpy_pin.gaits.walking.swing_load import holding_load, swing_load
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import GRAVITY, Vector

SLOW = 0.1
"""Share of its usual velocity below which a robot is said to be slow."""
SLOWEST = 1e-6
"""Speed below which steps are not shortened, m/s."""
SAME = 1e-3
"""Difference of two distances between feet that does not count, m."""
HALVINGS = 7
"""How often the range of speeds is halved."""
PEAK = 15.6
"""Peak of the acceleration of two feet that are swung, in the velocity of the walk over the
duration of a step.
"""


@dataclass(frozen=True)
class Pace:
    """How long the steps of a walk last, and how far they go."""

    usual_step: float  # time from one touchdown to the next of a slow walk, s
    # share of a step in which every foot is on the ground, at the largest speed
    fast_double_support: float
    slow_double_support: float  # the same of a robot that hardly walks
    gentle: bool  # whether feet go down slowly, and take over the load slowly
    stride: float  # longest way of a step, m: beyond, steps are shorter in time


def pace_of(
    robot: Robot,
    q: Vector,
    build: Build,
    group: NDArray[np.int64],
    clearance: float,
    w: WalkingParameters,
    *,
    max_speed: float | None,
) -> tuple[Pace, float, str]:
    """The pace of a robot that stands in q, whose feet swing in the given groups; the largest
    velocity of a foot's place, m/s; and what limits it.

    This is what legs and motors can do, where none is given: what holds the robot in mid-step, and
    swings the other legs, and how far feet reach. An :class:`InputError` says that it is zero.
    """
    groups, feet, soles = int(group.max()) + 1, len(build.place), build.soles
    natural, runs = float(np.sqrt(build.leg / GRAVITY)), groups == 2 and feet > 2
    gentle = runs and not soles and not _one_behind_the_other(build, group)
    if soles:
        step, both = w.sole_step, w.sole_double_support
        share = w.rolling_speed if feet == 2 else w.sole_speed
    else:
        step = max(w.step, w.weak_step * GRAVITY / build.swing_acceleration)
        both = w.double_support if feet > 2 else w.point_double_support
        share = w.trot_speed if runs else w.point_speed
    duration, stride = step * natural, w.stride * build.leg if runs else inf

    def shortened(speed: float) -> float:
        return w.fast_sole_step * natural if soles else min(duration, stride / max(speed, SLOWEST))

    usual = share * GRAVITY * natural
    most, limited_by = usual, "the length of its legs"
    push = PEAK * float(np.abs(build.reaction[:, 0, 0]).max()) / GRAVITY
    if runs and push > 0.0 and (slower := float(np.sqrt(w.max_push * stride / push))) < most:
        most, limited_by = slower, "the push of the legs that it swings"
    if max_speed is not None:
        most, limited_by = max_speed, "max_speed"
    else:
        omega, near = float(np.sqrt(GRAVITY / build.rise)), w.near if gentle else w.straight_near
        creep = w.creep * (omega * build.height)

        def load(speed: float) -> float:
            lasts = shortened(speed)
            upright = upright_share(speed, creep, near, w.upright_end)
            pushed = max(push * speed / (lasts * w.free_push), 1.0) if runs else 1.0
            return pushed * swing_load(robot, q, build, speed, lasts, both, clearance, upright)

        held = holding_load(robot, q, group)
        allowed = w.swing_torque if runs else max(1.0, w.lift_torque * load(0.0))
        swung = 0.0
        if held <= 1.0:
            swung = largest(lambda speed: load(speed) <= allowed, most, halvings=HALVINGS)
        if swung == 0.0:
            holding = f"hold it in mid-step, which takes {held:.2g} times their torques"
            why = holding if held > 1.0 else "swing its legs"
            message = (
                f"at no speed can the motors of '{robot.name}' {why}: give a max_speed, or "
                f"larger efforts"
            )
            if held <= 1.0 and isinf(load(0.0)):
                message = (
                    f"the linkages of '{robot.name}' do not let its feet swing {clearance:.2g} m "
                    f"high: give a lower clearance, or another posture"
                )
            raise InputError(message, name="max_speed")
        if swung < most:
            most, limited_by = swung, "the torques of its motors"
    shortest = shortened(most)
    reached = 2.0 * _reach(build, group, w) / ((groups - 1 + both) * shortest)
    if reached <= 0.0:
        apart = f"its feet, {np.ptp(build.place[:, 1]):.2g} m apart, have to come together"
        raise InputError(
            f"'{robot.name}' cannot walk: {apart}, and its legs do not reach so far", name="robot"
        )
    if reached < most:
        most, limited_by = reached, "how far its feet reach"
    if most < SLOW * usual and max_speed is None:
        warn_maker(f"'{robot.name}' walks at {most:.2g} m/s at most, limited by {limited_by}")
    slow = w.slow_double_support if gentle else both
    pace = Pace(duration, both, slow, gentle, most * shortest if soles else stride)
    return pace, most, limited_by


def _one_behind_the_other(build: Build, group: NDArray[np.int64]) -> bool:
    """Whether two groups of feet stand one behind the other, so that the body goes to and fro
    between them.
    """
    first, second = (build.place[group == g, :2].mean(axis=0) for g in range(2))
    ahead, aside = np.abs(second - first)
    return bool(ahead > aside + SAME)


def _reach(build: Build, group: NDArray[np.int64], w: WalkingParameters) -> float:
    """Largest horizontal distance that a foot goes from its place in the walk, m."""
    if group.max() != 1:
        return build.reach
    two_soles = len(build.place) == 2 and build.sole[0] > 0.0
    used = w.knee_torque / max(build.knee, w.knee_torque) if two_soles else w.reach_used
    apart, together = build.around(), build.around()
    draw_together(together, group, build.narrow)
    drawn = float(np.linalg.norm(apart - together, axis=1).max())
    return used * (build.reach - drawn) if drawn > 0.0 else build.reach
