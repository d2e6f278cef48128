"""Where the feet of the group that swings land: from the pendulum at touchdown, in reach and apart
from the others.
"""

from __future__ import annotations

import numpy as np

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
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane

APART = 0.4
"""Least distance between two feet in the direction in which they stand apart, as a share of that
when standing.
"""
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
    """How far the foothold of a step that ends after the time ``left`` would be from where the foot
    may land, m.

    A robot on soles that has been pushed is balanced by a step at a place that it reaches, or by an
    earlier one. That soles must not touch does not count here: steps of an ordinary walk would end
    early.
    """
    middle, axes, worst, before = (
        _landing_middle(p, left),
        rotation_in_plane(p.path[2]),
        0.0,
        np.empty(2),
    )
    for k in range(p.group.shape[0]):
        if p.group[k] == p.swings:
            place = p.foothold[k, :2]
            before[:], place[:] = place, middle
            _keep_apart(p, k, axes, False)
            _keep_in_reach(p, k, left)
            worst = max(worst, np.hypot(*(place - middle)))
            place[:] = before
    return float(worst)


@kernel
def choose_footholds(p: WalkingRecord, left: float) -> None:
    """Footholds of the group that swings, at the time ``left`` before its touchdown."""
    if is_frozen(p, left):
        return
    middle, before = _landing_middle(p, left), np.empty(2)
    heading = p.path[2] + p.velocity[2] * (left + 0.5 * p.step_duration * (p.groups - 1))
    axes, moving = (
        rotation_in_plane(heading),
        left < (1.0 - ACROSS) * (1.0 - p.double_support) * p.step_duration,
    )
    for k in range(p.group.shape[0]):
        if p.group[k] == p.swings:
            before[:] = p.foothold[k, :2]
            p.foothold[k] = *(middle + axes @ p.spread[k]), heading
            _keep_apart(p, k, axes, p.soles != 0)
            _keep_in_reach(p, k, left)
            if p.steps_over:
                keep_off_edges(p, k, before, moving)
    if p.steps_over:
        keep_line(p, middle)


@kernel
def _landing_middle(p: WalkingRecord, left: float) -> Vector:
    """Where the middle of the group's feet lands, m."""
    m, g, axes = p.measured, p.swings, rotation_in_plane(p.path[2])
    stance = np.empty((p.measured.point.shape[0], 2))
    count = stance_points(p, g, 0.0, stance)
    if count == 0:
        return m.centre[:2]
    there, speed, duration = np.empty(2), np.empty(2), real_duration(p)
    if p.soles:
        left = (
            max(left - (p.step_duration - duration), 0.0) + 0.5 * p.double_support * p.step_duration
        )
    pressure = np.array(nearest_in_hull(stance, count, *p.pressure))
    _predict_centre(p, stance, count, pressure, left, there, speed)
    if p.groups != 2:
        standing = (p.groups - 1 + p.double_support) * p.step_duration
        there += axes @ p.middle[g] + 0.5 * standing * p.desired + (speed - p.desired) / p.omega
        return there
    jump = axes @ (p.middle[(g + 1) % p.groups] - p.middle[g])
    desired = desired_after(p, left + 0.5 * duration if p.soles else 0.0)
    there += speed / p.omega - cyclic_offset(desired * duration, jump, np.exp(p.omega * duration))
    return there


@kernel
def _predict_centre(
    p: WalkingRecord,
    stance: Vector,
    count: int,
    pressure: Vector,
    left: float,
    there: Vector,
    speed: Vector,
) -> None:
    """Place and velocity of the centre of mass at touchdown, after the time ``left``.

    It is a pendulum about the centre of pressure, but goes on with its velocity along a line
    between two point feet, and everywhere on more of them. The first ``count`` rows of ``stance``
    are the stance feet's contact points.
    """
    m = p.measured
    for i in range(2):
        there[i], speed[i] = predict(m.centre[i], m.drift[i], pressure[i], p.omega, left)
    if p.soles or count < 2:
        return
    straight = m.centre[:2] + left * m.drift
    if count > 2:
        there[:], speed[:] = straight, m.drift
        return
    line = stance[1] - stance[0]
    line /= np.hypot(*line)
    there += line @ (straight - there) * line
    speed += line @ (m.drift - speed) * line


@kernel
def widen_stance(p: WalkingRecord) -> None:
    """Distance of two soles in the present step: as when standing, or what steps to the side and
    turns need.

    Every second step to the side brings the feet together by its way, and every second one of a
    turn turns heels or toes towards each other.
    """
    duration = real_duration(p)
    aside = max(abs(p.velocity[1]), abs(p.goal[1])) * duration
    turn = 0.5 * max(abs(p.velocity[2]), abs(p.goal[2])) * duration
    needed = p.sole[0] * np.sin(turn) + p.sole[1] * np.cos(turn) + aside + CLEAR
    apart = np.hypot(*(p.nominal[0] - p.nominal[1]))
    share = max(needed / apart, 1.0)
    p.middle[p.group] = share * p.nominal


@kernel
def _extent(p: WalkingRecord, turned: float) -> float:
    """How far a sole reaches from its middle in a direction from which it is turned by an angle,
    m.
    """
    return float(0.5 * (p.sole[0] * abs(np.cos(turned)) + p.sole[1] * abs(np.sin(turned))))


@kernel
def _keep_apart(p: WalkingRecord, k: int, axes: Vector, soles: bool) -> None:
    """Move a foothold away from the stance feet, or from their soles, along the direction in which
    they stand apart.
    """
    for j in range(p.group.shape[0]):
        if j != k and p.in_air[j] == 0.0:
            n = axes @ (p.nominal[k] - p.nominal[j])
            apart = np.hypot(*n)
            n /= apart
            gap, least = (p.foothold[k, :2] - p.measured.place[j, :2]) @ n, APART * apart
            if soles:
                away = np.arctan2(n[1], n[0])
                own, other = (
                    _extent(p, p.foothold[k, 2] - away),
                    _extent(p, p.measured.turned[j] - away),
                )
                least = max(least, own + other + CLEAR)
            if gap < least:
                p.foothold[k, :2] += (least - gap) * n


@kernel
def _keep_in_reach(p: WalkingRecord, k: int, left: float) -> None:
    """Draw a foothold towards the place below the hip, as far as the leg reaches when the foot gets
    there.

    A leg beside its hip's axis reaches less far outwards: as far from that axis as its own length
    and that offset say. A body that is higher than it should be leaves less, too.
    """
    m = p.measured
    hip = hip_place(p, k, max(left - p.arrives * (1.0 - p.double_support) * p.step_duration, 0.0))
    way = p.foothold[k, :2] - hip
    square, beside = way @ way, (rotation_in_plane(m.heading).T @ way)[1] * p.beside[k]
    room = max(p.reach**2 - 2.0 * p.hip * (m.body[2] - p.height - p.felt[k]), 0.0)
    if square + 2.0 * beside > room:
        p.foothold[k, :2] = hip + (np.sqrt(beside**2 + square * room) - beside) / square * way


@kernel
def keep_off_edges(p: WalkingRecord, k: int, before: Vector, moving: bool) -> None:
    """Move the foothold of foot k off edges, to a place near to it and to that of the tick before.

    A foot that is moving does not change sides of an edge.
    """
    place = p.foothold[k, :2]
    place[:] = nearest_steppable(p.terrain, *place, *before)
    if moving and np.max(abs(place - before)) > 2.0 * MARGIN:
        place[:] = before


@kernel
def keep_line(p: WalkingRecord, middle: Vector) -> None:
    """Move both footholds of a group along y so that the line between them goes through its middle
    again.

    A foothold that is moved away from an edge turns that line, across which the robot is a
    pendulum.
    """
    first = second = -1
    for k in range(p.group.shape[0]):
        if p.group[k] == p.swings:
            first, second = second, k
    if first < 0:
        return
    way, off = p.foothold[second] - p.foothold[first], middle - p.foothold[first, :2]
    if abs(way[0]) < 0.1 * p.height:
        return
    aside = off[1] - off[0] / way[0] * way[1]
    p.foothold[first, 1] += aside
    p.foothold[second, 1] += aside
