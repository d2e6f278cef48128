"""When feet are lifted and when they have landed: by the clock of the schedule, and by the measured
forces.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.gaits.velocity import foot_speed, is_still
from harpy_pin.gaits.walking.footholds import is_frozen, out_of_reach, stay_at, widen_stance
from harpy_pin.gaits.walking.measuring import forget_load
from harpy_pin.gaits.walking.pendulum import nearest_in_hull, predict, stance_points
from harpy_pin.gaits.walking.record import MeasuredRecord, WalkingRecord
from harpy_pin.gaits.walking.rolling import plan_roll, roll_on, rolls
from harpy_pin.gaits.walking.swinging import PEAK, begin_swing
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane

LONG_AGO = 1e3
"""Time since the last touchdown of a foot that has not yet swung, s."""
HALVINGS = 6
"""Of the range of the time that is left in a step."""


@kernel
def begin_on_all_feet(p: WalkingRecord) -> None:
    """Every foot is on the ground, and has been for long."""
    s = p.steps
    s.phase = 0.0
    s.walking = s.made = s.swings = 0
    s.in_air[:] = 0.0
    s.felt[:] = 0.0
    s.touched[:] = 0.0
    s.settled[:] = 1.0
    s.since[:] = LONG_AGO


@kernel
def go_on(p: WalkingRecord, span: float) -> None:
    """Steps, touchdowns and lifted feet after a time, s."""
    s, pace, w = p.steps, p.pace, p.tuned
    for k in range(pace.group.shape[0]):
        s.since[k] += span
        if s.in_air[k] == 0.0 and s.settled[k] == 0.0 and not rolls(p, k):
            _feel_ground(p, k, span)
    if not s.walking:
        pushed = _beside_feet(p) > w.outside * p.build.height
        commanded = np.sum(abs(p.planned.goal[:3])) != 0.0
        if pace.groups == 1 or not (pushed or pace.always or commanded):
            return
        s.walking, s.made = 1, 0
        plan_step(p)
        s.phase = s.double_support - (0.0 if pushed else pace.start_time / s.duration)
        s.swings = _first_group(p)
        plan_roll(p)
    s.haste = _haste(p)
    s.phase += s.haste * span / s.duration
    roll_on(p)
    done = (s.phase - s.double_support) / (1.0 - s.double_support)
    in_air = _notice_touchdowns(p, done)
    wait = w.longest_wait if p.terrain.level else w.longest_terrain_wait
    if done > w.earliest and (in_air == 0 or s.phase > 1.0 + wait):
        _begin_step(p)
    elif done >= 0.0 and done <= w.earliest:
        for k in range(pace.group.shape[0]):
            if pace.group[k] == s.swings and s.in_air[k] == 0.0:
                _lift_foot(p, k)


@kernel
def _lift_foot(p: WalkingRecord, k: int) -> None:
    """The swing of a foot begins where it is."""
    p.steps.in_air[k] = 1.0
    forget_load(p.measured, k)
    begin_swing(p, k)
    stay_at(p, k, p.swing.motion[k, 0])


@kernel
def time_left(p: WalkingRecord) -> float:
    """Time until the next touchdown by the clock, s."""
    return float(max(1.0 - p.steps.phase, 0.0) * p.steps.duration / p.steps.haste)


@kernel
def _haste(p: WalkingRecord) -> float:
    """How much faster than its clock a step goes on.

    On points so that the body does not lean too far from a stance foot alone: beyond, the ground
    would have to hold more than it can. On soles so that the foot lands while the place where it
    must land is in reach.
    """
    s, soles = p.steps, p.build.soles
    left = max(1.0 - s.phase, 0.0) * s.duration
    if soles:
        if s.phase < 0.0 or p.pace.steps_over:
            return 1.0
        if is_frozen(p, left / s.haste):
            return s.haste
    elif p.pace.lean == np.inf or left == 0.0:
        return 1.0
    if not _too_late(p, left):
        return 1.0
    low, high = left / (p.tuned.max_sole_haste if soles else p.tuned.max_haste), left
    if soles:
        low = min(max(low, _quickest(p)), left)
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
    if p.build.soles:
        missed = out_of_reach(p, time)
        return missed > p.tuned.missed * p.build.height
    stance = np.empty((p.measured.point.shape[0], 2))
    count = stance_points(p, p.steps.swings, 0.0, stance)
    return count == 1 and _lean_after(p.measured, stance[0], p.pace.omega, time) > p.pace.lean


@kernel
def _quickest(p: WalkingRecord) -> float:
    """Time in which the motors bring the swing foot to its foothold, s."""
    away = p.footholds.place[:, :2] - p.measured.place[:, :2]
    way = np.max(np.where(p.pace.group == p.steps.swings, np.hypot(away[:, 0], away[:, 1]), 0.0))
    return float(np.sqrt(PEAK * way / p.build.swing_acceleration))


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
    m, s, pace, in_air = p.measured, p.steps, p.pace, 0
    for k in range(pace.group.shape[0]):
        if s.in_air[k] != 0.0:
            late = pace.group[k] != s.swings or done > 1.0
            loaded = m.load[k] > pace.touch_force and (done > p.tuned.earliest or late)
            if loaded or (late and _rests(p, k)):
                s.in_air[k], s.since[k] = 0.0, 0.0
                s.settled[k], s.pressed[k], s.rest[k] = 0.0, 0.0, m.place[k, 2]
            elif pace.group[k] == s.swings:
                in_air += 1
    return in_air


@kernel
def _rests(p: WalkingRecord, k: int) -> bool:
    """Whether a swing foot is held up by the ground, though it hardly pushes."""
    if p.build.soles or p.pace.steps_over or not p.terrain.level:
        return False
    m, w = p.measured, p.tuned
    rests: bool = m.place[k, 2] - p.swing.lift[k, 0] > w.blocked * p.build.height
    return rests and m.load[k] > w.resting_force * p.pace.touch_force


@kernel
def _feel_ground(p: WalkingRecord, k: int, span: float) -> None:
    """Height of the ground below a foot that has landed, once it rests there under load.

    Until then it goes on down: noise and a foot that rebounds look like a touchdown for a moment.
    """
    m, s, w, b, pace = p.measured, p.steps, p.tuned, p.build, p.pace
    share = min(span / (w.averaged * pace.usual_step), 1.0)
    s.pressed[k] += share * (m.load[k] - s.pressed[k])
    s.rest[k] += share * (m.place[k, 2] - s.rest[k])
    if s.since[k] < w.settling * pace.usual_step or s.pressed[k] < w.pressed * pace.touch_force:
        return
    s.settled[k] = 1.0
    if abs(s.rest[k] - s.felt[k]) > (w.sole_uneven if b.soles else w.uneven) * b.height:
        s.felt[k] = s.rest[k]
    s.touched[k] = s.felt[k]
    if s.felt[k] != 0.0 or (s.rest[k] > 0.0 and not b.soles):
        s.touched[k] = max(s.felt[k], s.rest[k]) + w.rebound * b.height


@kernel
def _begin_step(p: WalkingRecord) -> None:
    """The next step, or the end of the walk."""
    s = p.steps
    s.phase = 0.0
    s.made += 1
    plan_step(p)
    s.swings = (s.swings + 1) % p.pace.groups
    plan_roll(p)
    if not p.pace.always and _still(p) and _feet_in_place(p) and _beside_feet(p) == 0.0:
        s.walking = 0


@kernel
def plan_step(p: WalkingRecord) -> None:
    """Duration of the step that begins, and how far apart soles are in it.

    No foot goes farther than the stride. The share of it in which the load goes from feet to feet
    is long while the robot walks slowly and undisturbed.
    """
    s, pace, u = p.steps, p.pace, p.planned
    speed = foot_speed(u, u.velocity)
    way = speed * pace.usual_step
    s.duration = pace.usual_step * (pace.stride / way if way > pace.stride else 1.0)
    speed += p.tuned.upset * np.hypot(*(p.measured.drift - u.desired))
    fast, slow = min(speed / u.max_speed, 1.0), pace.slow_double_support
    s.double_support = slow + fast * (pace.fast_double_support - slow)
    s.load_ramp = pace.slow_load_ramp + fast**4 * (pace.fast_load_ramp - pace.slow_load_ramp)
    if p.build.soles and pace.sways and pace.group.shape[0] == 2:
        widen_stance(p)


@kernel
def _still(p: WalkingRecord) -> bool:
    """Whether nothing is commanded and, but for its sway, nothing moves."""
    slow = np.hypot(*p.measured.drift) < p.tuned.at_rest * p.pace.omega * p.build.height
    return is_still(p.planned) and (p.pace.sways != 0 or slow)


@kernel
def _feet_in_place(p: WalkingRecord) -> bool:
    """Whether every foot is on the ground, where it is when the robot stands."""
    m, axes = p.measured, rotation_in_plane(p.planned.path[2])
    away = m.place[:, :2] - m.centre[:2] - p.pace.nominal @ axes.T
    off = np.hypot(away[:, 0], away[:, 1]) >= p.tuned.in_place * p.build.height
    return not np.any((p.steps.in_air != 0.0) | off)


@kernel
def _beside_feet(p: WalkingRecord) -> float:
    """How far the capture point is outside of the stance feet, m."""
    m, points = p.measured, np.empty((p.measured.point.shape[0], 2))
    count = stance_points(p, -1, 0.0, points)
    if count == 0:
        return 0.0
    xi = m.centre[:2] + m.drift / p.pace.omega
    x, y = nearest_in_hull(points, count, *xi)
    return float(np.hypot(x - xi[0], y - xi[1]))


@kernel
def _first_group(p: WalkingRecord) -> int:
    """The group whose feet are farthest from the capture point: the others stay on the ground."""
    m, best, first = p.measured, -1e9, 0
    glide = rotation_in_plane(m.heading).T @ m.centre[3:5] / p.pace.omega
    for g in range(p.pace.groups):
        away = -(p.footholds.middle[g] @ glide)
        if away > best + 1e-6:
            best, first = away, g
    return first
