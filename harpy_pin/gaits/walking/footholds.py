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
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane


@kernel
def is_frozen(p: WalkingRecord, left: float) -> bool:
    """Whether footholds stay where they are, at the time ``left`` before touchdown."""
    share = p.tuned.early_frozen if p.pace.steps_over else p.tuned.frozen
    frozen: bool = left < share * p.steps.duration
    return frozen


@kernel
def stay_at(p: WalkingRecord, k: int, place: Vector) -> None:
    """A foot that is lifted lands where it is, x and y, m, and heading, rad, until its foothold is
    chosen.
    """
    p.footholds.place[k] = place


@kernel
def out_of_reach(p: WalkingRecord, left: float) -> float:
    """How far the foothold of a step that ends after the time ``left`` would be from where the foot
    may land, m.

    A robot on soles that has been pushed is balanced by a step at a place that it reaches, or by an
    earlier one. That soles must not touch does not count here: steps of an ordinary walk would end
    early.
    """
    middle, axes = _landing_middle(p, left), rotation_in_plane(p.planned.path[2])
    worst, before = 0.0, np.empty(2)
    for k in range(p.pace.group.shape[0]):
        if p.pace.group[k] == p.steps.swings:
            place = p.footholds.place[k, :2]
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
    s, pace, u = p.steps, p.pace, p.planned
    middle, before = _landing_middle(p, left), np.empty(2)
    heading = u.path[2] + u.velocity[2] * (left + 0.5 * s.duration * (pace.groups - 1))
    axes = rotation_in_plane(heading)
    moving = left < (1.0 - p.tuned.start_across) * (1.0 - s.double_support) * s.duration
    for k in range(pace.group.shape[0]):
        if pace.group[k] == s.swings:
            before[:] = p.footholds.place[k, :2]
            p.footholds.place[k] = *(middle + axes @ pace.spread[k]), heading
            _keep_apart(p, k, axes, p.build.soles != 0)
            _keep_in_reach(p, k, left)
            if pace.steps_over:
                keep_off_edges(p, k, before, moving)
    if pace.steps_over:
        keep_line(p, middle)


@kernel
def _landing_middle(p: WalkingRecord, left: float) -> Vector:
    """Where the middle of the group's feet lands, m."""
    m, s, pace, middle, u = p.measured, p.steps, p.pace, p.footholds.middle, p.planned
    g, omega, axes = s.swings, pace.omega, rotation_in_plane(u.path[2])
    stance = np.empty((p.measured.point.shape[0], 2))
    count = stance_points(p, g, 0.0, stance)
    if count == 0:
        return m.centre[:2]
    there, speed, duration = np.empty(2), np.empty(2), real_duration(p)
    if p.build.soles:
        left = max(left - (s.duration - duration), 0.0) + 0.5 * s.double_support * s.duration
    pressure = np.array(nearest_in_hull(stance, count, *p.demand.pressure))
    _predict_centre(p, stance, count, pressure, left, there, speed)
    if pace.groups != 2:
        standing = (pace.groups - 1 + s.double_support) * s.duration
        there += axes @ middle[g] + 0.5 * standing * u.desired + (speed - u.desired) / omega
        return there
    jump = axes @ (middle[(g + 1) % pace.groups] - middle[g])
    desired = desired_after(p, left + 0.5 * duration if p.build.soles else 0.0)
    there += speed / omega - cyclic_offset(desired * duration, jump, np.exp(omega * duration))
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
        there[i], speed[i] = predict(m.centre[i], m.drift[i], pressure[i], p.pace.omega, left)
    if p.build.soles or count < 2:
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
    u, sole, nominal, duration = p.planned, p.build.sole, p.pace.nominal, real_duration(p)
    aside = max(abs(u.velocity[1]), abs(u.goal[1])) * duration
    turn = 0.5 * max(abs(u.velocity[2]), abs(u.goal[2])) * duration
    needed = sole[0] * np.sin(turn) + sole[1] * np.cos(turn) + aside + p.tuned.clear
    apart = np.hypot(*(nominal[0] - nominal[1]))
    share = max(needed / apart, 1.0)
    p.footholds.middle[p.pace.group] = share * nominal


@kernel
def _extent(p: WalkingRecord, turned: float) -> float:
    """How far a sole reaches from its middle in a direction from which it is turned by an angle,
    m.
    """
    length, width = p.build.sole
    return float(0.5 * (length * abs(np.cos(turned)) + width * abs(np.sin(turned))))


@kernel
def _keep_apart(p: WalkingRecord, k: int, axes: Vector, soles: bool) -> None:
    """Move a foothold away from the stance feet, or from their soles, along the direction in which
    they stand apart.
    """
    m, place, nominal = p.measured, p.footholds.place[k], p.pace.nominal
    for j in range(nominal.shape[0]):
        if j != k and p.steps.in_air[j] == 0.0:
            n = axes @ (nominal[k] - nominal[j])
            apart = np.hypot(*n)
            n /= apart
            gap, least = (place[:2] - m.place[j, :2]) @ n, p.tuned.apart * apart
            if soles:
                away = np.arctan2(n[1], n[0])
                own, other = _extent(p, place[2] - away), _extent(p, m.turned[j] - away)
                least = max(least, own + other + p.tuned.clear)
            if gap < least:
                place[:2] += (least - gap) * n


@kernel
def _keep_in_reach(p: WalkingRecord, k: int, left: float) -> None:
    """Draw a foothold towards the place below the hip, as far as the leg reaches when the foot gets
    there.

    A leg beside its hip's axis reaches less far outwards: as far from that axis as its own length
    and that offset say. A body that is higher than it should be leaves less, too.
    """
    m, s, b, place = p.measured, p.steps, p.build, p.footholds.place[k, :2]
    hip = hip_place(p, k, max(left - p.pace.arrives * (1.0 - s.double_support) * s.duration, 0.0))
    way = place - hip
    square, beside = way @ way, (rotation_in_plane(m.heading).T @ way)[1] * b.beside[k]
    room = max(b.reach**2 - 2.0 * b.hip * (m.body[2] - b.height - s.felt[k]), 0.0)
    if square + 2.0 * beside > room:
        place[:] = hip + (np.sqrt(beside**2 + square * room) - beside) / square * way


@kernel
def keep_off_edges(p: WalkingRecord, k: int, before: Vector, moving: bool) -> None:
    """Move the foothold of foot k off edges, to a place near to it and to that of the tick before.

    A foot that is moving does not change sides of an edge.
    """
    place = p.footholds.place[k, :2]
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
    place, first, second = p.footholds.place, -1, -1
    for k in range(p.pace.group.shape[0]):
        if p.pace.group[k] == p.steps.swings:
            first, second = second, k
    if first < 0:
        return
    way, off = place[second] - place[first], middle - place[first, :2]
    if abs(way[0]) < 0.1 * p.build.height:
        return
    aside = off[1] - off[0] / way[0] * way[1]
    place[first, 1] += aside
    place[second, 1] += aside
