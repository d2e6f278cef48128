"""When feet are lifted and when they have landed: by the clock of the schedule, and by the measured
forces.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.gaits.velocity import foot_speed, is_still
from harpy_pin.gaits.walking.footholds import is_frozen, out_of_reach, widen_stance
from harpy_pin.gaits.walking.pendulum import nearest_in_hull, predict, stance_points
from harpy_pin.gaits.walking.record import MeasuredRecord, WalkingRecord
from harpy_pin.gaits.walking.rolling import plan_roll, roll_on, rolls
from harpy_pin.gaits.walking.swinging import PEAK, lift_foot
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane

EARLIEST = 0.6
"""Share of its swing from which on a foot that is loaded has landed."""
BLOCKED, RESTS = 0.005, 0.3
"""How far above where it should be a late foot is, as a share of the body's height, and its load,
as a share of that from which on a foot touches, that together say that it rests on the ground. A
foot that comes down slowly pushes hardly more than that.
"""
LONGEST_WAIT, ON_TERRAIN = 0.5, 1.0
"""How long the next step waits for a foot that has not landed, as a share of a step, and on ground
that is not flat.
"""
MOST_HASTE, SOLE_HASTE, HALVINGS = 2.0, 1.6, 6
"""How much faster than its clock a step goes on at most, on points and on soles, and halvings of
the range of the time that is left.
"""
MISSED = 0.01
"""How far from where it must land a foot on a sole may land in time, as a share of the body's
height.
"""
UNEVEN, SOLE_UNEVEN = 0.03, 0.01
"""How far from the expected height a point and a sole meet ground that is uneven there, as a share
of the body's height: a sole that lands late spoils the sway.
"""
AVERAGED, SETTLING, PRESSED = 0.05, 0.1, 0.7
"""Time over which height and load of a foot that has landed are averaged, and after which they say
where the ground is, in steps; and the load from which on they do, as a share of that from which on
it touches.
"""
REBOUND = 0.005
"""How far above the place where it touched a foot still touches, as a share of the body's
height.
"""
AT_REST = 0.03
"""Velocity of the centre of mass below which the walk may end, as a share of ω times the body's
height.
"""
IN_PLACE = 0.06
"""How far a foot may be from where it stands for the walk to end, as a share of the body's
height.
"""
UPSET = 2.0
"""How much an undesired velocity counts, beside a commanded one, in how fast the load is taken
over.
"""
OUTSIDE = 0.02
"""How far the capture point is outside of the feet for a robot that stands to step, as a share of
the height.
"""


@kernel
def go_on(p: WalkingRecord, span: float) -> None:
    """Steps, touchdowns and lifted feet after a time, s."""
    for k in range(p.group.shape[0]):
        p.since[k] += span
        if p.in_air[k] == 0.0 and p.settled[k] == 0.0 and not rolls(p, k):
            _feel_ground(p, k, span)
    if not p.walking:
        pushed = _beside_feet(p) > OUTSIDE * p.height
        if p.groups == 1 or not (pushed or p.always or _commanded(p)):
            return
        p.walking, p.steps = 1, 0
        plan_step(p)
        p.phase = p.double_support - (0.0 if pushed else p.start_time / p.step_duration)
        p.swings = _first_group(p)
        plan_roll(p)
    p.haste = _haste(p)
    p.phase += p.haste * span / p.step_duration
    roll_on(p)
    done = (p.phase - p.double_support) / (1.0 - p.double_support)
    in_air = _notice_touchdowns(p, done)
    wait = LONGEST_WAIT if p.terrain.level else ON_TERRAIN
    if done > EARLIEST and (in_air == 0 or p.phase > 1.0 + wait):
        _begin_step(p)
    elif done >= 0.0 and done <= EARLIEST:
        for k in range(p.group.shape[0]):
            if p.group[k] == p.swings and p.in_air[k] == 0.0:
                lift_foot(p, k)


@kernel
def time_left(p: WalkingRecord) -> float:
    """Time until the next touchdown by the clock, s."""
    return float(max(1.0 - p.phase, 0.0) * p.step_duration / p.haste)


@kernel
def _haste(p: WalkingRecord) -> float:
    """How much faster than its clock a step goes on.

    On points so that the body does not lean too far from a stance foot alone: beyond, the ground
    would have to hold more than it can. On soles so that the foot lands while the place where it
    must land is in reach.
    """
    left = max(1.0 - p.phase, 0.0) * p.step_duration
    if p.soles:
        if p.phase < 0.0 or p.steps_over:
            return 1.0
        if is_frozen(p, left / p.haste):
            return p.haste
    elif p.lean == np.inf or left == 0.0:
        return 1.0
    if not _too_late(p, left):
        return 1.0
    low, high = (
        min(max(left / SOLE_HASTE, _quickest(p)), left) if p.soles else left / MOST_HASTE,
        left,
    )
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if _too_late(p, middle):
            high = middle
        else:
            low = middle
    return float(left / low)


@kernel
def _too_late(p: WalkingRecord, time: float) -> bool:
    """Whether a step that ends after this time no longer helps."""
    if p.soles:
        missed = out_of_reach(p, time)
        return missed > MISSED * p.height
    stance = np.empty((p.measured.point.shape[0], 2))
    count = stance_points(p, p.swings, 0.0, stance)
    return count == 1 and _lean_after(p.measured, stance[0], p.omega, time) > p.lean


@kernel
def _quickest(p: WalkingRecord) -> float:
    """Time in which the motors bring the swing foot to its foothold, s."""
    away = p.foothold[:, :2] - p.measured.place[:, :2]
    way = np.max(np.where(p.group == p.swings, np.hypot(away[:, 0], away[:, 1]), 0.0))
    return float(np.sqrt(PEAK * way / p.swing_acceleration))


@kernel
def _lean_after(m: MeasuredRecord, foot: Vector, omega: float, time: float) -> float:
    """How far the centre of mass is from the stance foot after a time, m."""
    x, _ = predict(m.centre[0], m.drift[0], foot[0], omega, time)
    y, _ = predict(m.centre[1], m.drift[1], foot[1], omega, time)
    return float(np.hypot(x - foot[0], y - foot[1]))


@kernel
def _notice_touchdowns(p: WalkingRecord, done: float) -> int:
    """Feet that are loaded late enough in their swing have landed; returns how many of the group
    still swing.
    """
    in_air = 0
    for k in range(p.group.shape[0]):
        if p.in_air[k] != 0.0:
            late = p.group[k] != p.swings or done > 1.0
            if (p.measured.load[k] > p.touch_force and (done > EARLIEST or late)) or (
                late and _rests(p, k)
            ):
                p.in_air[k], p.since[k] = 0.0, 0.0
                p.settled[k], p.pressed[k], p.rest[k] = 0.0, 0.0, p.measured.place[k, 2]
            elif p.group[k] == p.swings:
                in_air += 1
    return in_air


@kernel
def _rests(p: WalkingRecord, k: int) -> bool:
    """Whether a swing foot is held up by the ground, though it hardly pushes."""
    if p.soles or p.steps_over or not p.terrain.level:
        return False
    rests: bool = p.measured.place[k, 2] - p.lift[k, 0] > BLOCKED * p.height
    return rests and p.measured.load[k] > RESTS * p.touch_force


@kernel
def _feel_ground(p: WalkingRecord, k: int, span: float) -> None:
    """Height of the ground below a foot that has landed, once it rests there under load.

    Until then it goes on down: noise and a foot that rebounds look like a touchdown for a moment.
    """
    share = min(span / (AVERAGED * p.usual_step), 1.0)
    p.pressed[k] += share * (p.measured.load[k] - p.pressed[k])
    p.rest[k] += share * (p.measured.place[k, 2] - p.rest[k])
    if p.since[k] < SETTLING * p.usual_step or p.pressed[k] < PRESSED * p.touch_force:
        return
    p.settled[k] = 1.0
    if abs(p.rest[k] - p.felt[k]) > (SOLE_UNEVEN if p.soles else UNEVEN) * p.height:
        p.felt[k] = p.rest[k]
    p.touched[k] = p.felt[k]
    if p.felt[k] != 0.0 or (p.rest[k] > 0.0 and not p.soles):
        p.touched[k] = max(p.felt[k], p.rest[k]) + REBOUND * p.height


@kernel
def _begin_step(p: WalkingRecord) -> None:
    """The next step, or the end of the walk."""
    p.phase = 0.0
    p.steps += 1
    plan_step(p)
    p.swings = (p.swings + 1) % p.groups
    plan_roll(p)
    if not p.always and _still(p) and _feet_in_place(p) and _beside_feet(p) == 0.0:
        p.walking = 0


@kernel
def plan_step(p: WalkingRecord) -> None:
    """Duration of the step that begins, and how far apart soles are in it.

    No foot goes farther than the stride. The share of it in which the load goes from feet to feet
    is long while the robot walks slowly and undisturbed.
    """
    speed = foot_speed(p, p.velocity)
    way = speed * p.usual_step
    p.step_duration = p.usual_step * (p.stride / way if way > p.stride else 1.0)
    speed += UPSET * np.hypot(*(p.measured.drift - p.desired))
    fast = min(speed / p.max_speed, 1.0)
    p.double_support = p.slow_double_support + fast * (
        p.fast_double_support - p.slow_double_support
    )
    p.load_ramp = p.slow_load_ramp + fast**4 * (p.fast_load_ramp - p.slow_load_ramp)
    if p.soles and p.sways and p.group.shape[0] == 2:
        widen_stance(p)


@kernel
def _still(p: WalkingRecord) -> bool:
    """Whether nothing is commanded and, but for its sway, nothing moves."""
    m = p.measured
    return is_still(p) and (p.sways != 0 or np.hypot(*m.drift) < AT_REST * p.omega * p.height)


@kernel
def _feet_in_place(p: WalkingRecord) -> bool:
    """Whether every foot is on the ground, where it is when the robot stands."""
    m, axes = p.measured, rotation_in_plane(p.path[2])
    away = m.place[:, :2] - m.centre[:2] - p.nominal @ axes.T
    off = np.hypot(away[:, 0], away[:, 1]) >= IN_PLACE * p.height
    return not np.any((p.in_air != 0.0) | off)


@kernel
def _commanded(p: WalkingRecord) -> bool:
    """Whether a velocity is commanded."""
    size: float = np.sum(abs(p.goal[:3]))
    return size != 0.0


@kernel
def _beside_feet(p: WalkingRecord) -> float:
    """How far the capture point is outside of the stance feet, m."""
    m = p.measured
    points = np.empty((p.measured.point.shape[0], 2))
    count = stance_points(p, -1, 0.0, points)
    if count == 0:
        return 0.0
    xi = m.centre[:2] + m.drift / p.omega
    x, y = nearest_in_hull(points, count, *xi)
    return float(np.hypot(x - xi[0], y - xi[1]))


@kernel
def _first_group(p: WalkingRecord) -> int:
    """The group whose feet are farthest from the capture point: the others stay on the ground."""
    m, best, first = p.measured, -1e9, 0
    glide = rotation_in_plane(m.heading).T @ m.centre[3:5] / p.omega
    for g in range(p.groups):
        away = -(p.middle[g] @ glide)
        if away > best + 1e-6:
            best, first = away, g
    return first
