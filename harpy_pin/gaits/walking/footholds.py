"""Where the feet of the group that swings land: from the pendulum at touchdown, in reach and apart from the others."""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.gaits.terrain_targets import MARGIN, nearest_steppable
from harpy_pin.gaits.walking.pendulum import (
    cyclic_offset,
    desired_after,
    hip_place,
    nearest_in_hull,
    predict,
    real_duration,
    stance_points,
)
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.swinging import ACROSS
from harpy_pin.model.state import Vector

APART = 0.4
"""Least distance between two feet in the direction in which they stand apart, as a share of that when standing."""
CLEAR = 0.01
"""Least gap between two soles, m."""
FROZEN = 0.25
"""Share of a step before its end from which on footholds stay where they are."""
EARLY_FROZEN = 0.4
"""Share of a step before its end from which on footholds stay, where feet step over the ground."""


@kernel
def is_frozen(p: WalkingRecord, left: float) -> bool:
    """Whether footholds stay where they are, at the time ``left`` before touchdown."""
    frozen: bool = left < (EARLY_FROZEN if p.steps_over else FROZEN) * p.step_duration
    return frozen


@kernel
def out_of_reach(p: WalkingRecord, left: float) -> float:
    """How far the foothold of a step that ends after the time ``left`` would be from where the foot may land, m.

    A robot on soles that has been pushed is balanced by a step at a place that it reaches, or by an earlier one. That
    soles must not touch does not count here: steps of an ordinary walk would end early.
    """
    x, y = _landing_middle(p, left)
    heading, g, worst = p.path[2], p.swings, 0.0
    c, s = np.cos(heading), np.sin(heading)
    for k in range(p.group.shape[0]):
        if p.group[k] == g:
            before_x, before_y = p.foothold[k, 0], p.foothold[k, 1]
            p.foothold[k, 0], p.foothold[k, 1] = x, y
            _keep_apart(p, k, c, s, False)
            _keep_in_reach(p, k, left)
            worst = max(worst, np.hypot(p.foothold[k, 0] - x, p.foothold[k, 1] - y))
            p.foothold[k, 0], p.foothold[k, 1] = before_x, before_y
    return float(worst)


@kernel
def choose_footholds(p: WalkingRecord, left: float) -> None:
    """Footholds of the group that swings, at the time ``left`` before its touchdown."""
    if is_frozen(p, left):
        return
    x, y = _landing_middle(p, left)
    heading = p.path[2] + p.velocity[2] * (left + 0.5 * p.step_duration * (p.groups - 1))
    c, s = np.cos(heading), np.sin(heading)
    g, moving = p.swings, left < (1.0 - ACROSS) * (1.0 - p.double_support) * p.step_duration
    for k in range(p.group.shape[0]):
        if p.group[k] == g:
            ahead, aside = p.spread[k, 0], p.spread[k, 1]
            before_x, before_y = p.foothold[k, 0], p.foothold[k, 1]
            p.foothold[k, 0] = x + c * ahead - s * aside
            p.foothold[k, 1] = y + s * ahead + c * aside
            p.foothold[k, 2] = heading
            _keep_apart(p, k, c, s, p.soles != 0)
            _keep_in_reach(p, k, left)
            if p.steps_over:
                keep_off_edges(p, k, before_x, before_y, moving)
    if p.steps_over:
        keep_line(p, x, y)


@kernel
def _landing_middle(p: WalkingRecord, left: float) -> tuple[float, float]:
    """Where the middle of the group's feet lands, m."""
    m, g = p.measured, p.swings
    stance = np.empty((p.measured.point.shape[0], 2))
    count = stance_points(p, g, 0.0, stance)
    c, s = np.cos(p.path[2]), np.sin(p.path[2])
    if count == 0:
        return m.centre[0], m.centre[1]
    at = nearest_in_hull(stance, count, p.pressure[0], p.pressure[1])
    there, speed, duration = np.empty(2), np.empty(2), real_duration(p)
    if p.soles:
        left = max(left - (p.step_duration - duration), 0.0) + 0.5 * p.double_support * p.step_duration
    _predict_centre(p, stance, count, at[0], at[1], left, there, speed)
    growth = np.exp(p.omega * duration)
    following = (g + 1) % p.groups
    jump_ahead, jump_aside = p.middle[following, 0] - p.middle[g, 0], p.middle[following, 1] - p.middle[g, 1]
    jump = c * jump_ahead - s * jump_aside, s * jump_ahead + c * jump_aside
    middle = c * p.middle[g, 0] - s * p.middle[g, 1], s * p.middle[g, 0] + c * p.middle[g, 1]
    desired = desired_after(p, left + 0.5 * duration if p.soles else 0.0)
    for i in range(2):
        if p.groups == 2:
            offset = cyclic_offset(desired[i] * duration, jump[i], growth)
            there[i] += speed[i] / p.omega - offset
        else:
            standing = (p.groups - 1 + p.double_support) * p.step_duration
            there[i] += middle[i] + 0.5 * standing * p.desired[i] + (speed[i] - p.desired[i]) / p.omega
    return there[0], there[1]


@kernel
def _predict_centre(
    p: WalkingRecord, stance: Vector, count: int, x: float, y: float, left: float, there: Vector, speed: Vector
) -> None:
    """Place and velocity of the centre of mass at touchdown, after the time ``left``.

    It is a pendulum about the centre of pressure (x, y), but goes on with its velocity along a line between two point
    feet, and everywhere on more of them. The first ``count`` rows of ``stance`` are the stance feet's contact points.
    """
    m = p.measured
    there[0], speed[0] = predict(m.centre[0], m.drift[0], x, p.omega, left)
    there[1], speed[1] = predict(m.centre[1], m.drift[1], y, p.omega, left)
    if p.soles or count < 2:
        return
    if count > 2:
        for i in range(2):
            there[i], speed[i] = m.centre[i] + left * m.drift[i], m.drift[i]
        return
    ex, ey = stance[1, 0] - stance[0, 0], stance[1, 1] - stance[0, 1]
    length = np.hypot(ex, ey)
    ex, ey = ex / length, ey / length
    steady = ex * m.drift[0] + ey * m.drift[1]
    change = steady - ex * speed[0] - ey * speed[1]
    way = ex * m.centre[0] + ey * m.centre[1] + left * steady - ex * there[0] - ey * there[1]
    there[0], there[1] = there[0] + way * ex, there[1] + way * ey
    speed[0], speed[1] = speed[0] + change * ex, speed[1] + change * ey


@kernel
def widen_stance(p: WalkingRecord) -> None:
    """Distance of two soles in the present step: as when standing, or what steps to the side and turns need.

    Every second step to the side brings the feet together by its way, and every second one of a turn turns heels or
    toes towards each other.
    """
    duration = real_duration(p)
    aside = max(abs(p.velocity[1]), abs(p.goal[1])) * duration
    turn = 0.5 * max(abs(p.velocity[2]), abs(p.goal[2])) * duration
    needed = p.sole[0] * np.sin(turn) + p.sole[1] * np.cos(turn) + aside + CLEAR
    apart = np.hypot(p.nominal[0, 0] - p.nominal[1, 0], p.nominal[0, 1] - p.nominal[1, 1])
    share = max(needed / apart, 1.0)
    for k in range(2):
        for i in range(2):
            p.middle[p.group[k], i] = share * p.nominal[k, i]


@kernel
def _extent(p: WalkingRecord, turned: float) -> float:
    """How far a sole reaches from its middle in a direction from which it is turned by an angle, m."""
    return float(0.5 * (p.sole[0] * abs(np.cos(turned)) + p.sole[1] * abs(np.sin(turned))))


@kernel
def _keep_apart(p: WalkingRecord, k: int, c: float, s: float, soles: bool) -> None:
    """Move a foothold away from the stance feet, or from their soles, along the direction in which they stand apart."""
    for j in range(p.group.shape[0]):
        if j != k and p.in_air[j] == 0.0:
            ahead, aside = p.nominal[k, 0] - p.nominal[j, 0], p.nominal[k, 1] - p.nominal[j, 1]
            apart = np.hypot(ahead, aside)
            nx, ny = (c * ahead - s * aside) / apart, (s * ahead + c * aside) / apart
            x, y = p.foothold[k, 0] - p.measured.place[j, 0], p.foothold[k, 1] - p.measured.place[j, 1]
            gap = x * nx + y * ny
            least = APART * apart
            if soles:
                away = np.arctan2(ny, nx)
                own, other = _extent(p, p.foothold[k, 2] - away), _extent(p, p.measured.turned[j] - away)
                least = max(least, own + other + CLEAR)
            if gap < least:
                p.foothold[k, 0] += (least - gap) * nx
                p.foothold[k, 1] += (least - gap) * ny


@kernel
def _keep_in_reach(p: WalkingRecord, k: int, left: float) -> None:
    """Draw a foothold towards the place below the hip, as far as the leg reaches when the foot gets there.

    A leg beside its hip's axis reaches less far outwards: as far from that axis as its own length and that offset say.
    A body that is higher than it should be leaves less, too.
    """
    m = p.measured
    c, s = np.cos(m.heading), np.sin(m.heading)
    time = max(left - p.arrives * (1.0 - p.double_support) * p.step_duration, 0.0)
    hip = hip_place(p, k, time)
    x, y = p.foothold[k, 0] - hip[0], p.foothold[k, 1] - hip[1]
    square, beside = x * x + y * y, (c * y - s * x) * p.beside[k]
    room = max(p.reach * p.reach - 2.0 * p.hip * (m.body[2] - p.height - p.felt[k]), 0.0)
    if square + 2.0 * beside > room:
        share = (np.sqrt(beside * beside + square * room) - beside) / square
        p.foothold[k, 0] = hip[0] + share * x
        p.foothold[k, 1] = hip[1] + share * y


@kernel
def keep_off_edges(p: WalkingRecord, k: int, before_x: float, before_y: float, moving: bool) -> None:
    """Move the foothold of foot k off edges, to a place near to it and to that of the tick before.

    A foot that is moving does not change sides of an edge.
    """
    x, y = p.foothold[k, 0], p.foothold[k, 1]
    p.foothold[k, 0], p.foothold[k, 1] = nearest_steppable(p.terrain, x, y, before_x, before_y)
    jump = max(abs(p.foothold[k, 0] - before_x), abs(p.foothold[k, 1] - before_y))
    if moving and jump > 2.0 * MARGIN:
        p.foothold[k, 0], p.foothold[k, 1] = before_x, before_y


@kernel
def keep_line(p: WalkingRecord, x: float, y: float) -> None:
    """Move both footholds of a group along y so that the line between them goes through its middle (x, y) again.

    A foothold that is moved away from an edge turns that line, across which the robot is a pendulum.
    """
    first = second = -1
    for k in range(p.group.shape[0]):
        if p.group[k] == p.swings:
            first, second = second, k
    if first < 0:
        return
    along = p.foothold[second, 0] - p.foothold[first, 0]
    if abs(along) < 0.1 * p.height:
        return
    share = (x - p.foothold[first, 0]) / along
    aside = y - p.foothold[first, 1] - share * (p.foothold[second, 1] - p.foothold[first, 1])
    p.foothold[first, 1] += aside
    p.foothold[second, 1] += aside
