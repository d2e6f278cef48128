"""The swing feet: horizontally to a foothold that may change at any tick, vertically up, down and
on down.

Over ground that is not even they go first up, then across what is higher, then down, in world
heights: a foot that moved across while it is still rising would meet the riser of a step that it
stands before.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.gaits.swing import toward
from harpy_pin.gaits.velocity import foot_speed
from harpy_pin.gaits.walking.pendulum import hip_place, upright_share, wrapped
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.rolling import flat_place
from harpy_pin.ground.surface import surface_height
from harpy_pin.kernels import kernel

PLACES = 8
"""On the way of a foot whose heights are looked at."""
LONG = 1.5e-3
"""Time between two updates from which on a foot's acceleration changes too much to be taken as
constant, s.
"""
PEAK = 5.7735
"""Largest acceleration of a motion from rest to rest, in its way over its squared duration."""


@kernel
def begin_swing(p: WalkingRecord, k: int) -> None:
    """Begin the swing of a foot where it is."""
    m, swing, place = p.measured, p.swing, flat_place(p, k)
    swing.lifted_at[k] = place[2]
    swing.motion[k] = 0.0
    swing.motion[k, 0] = *place[:2], m.turned[k]
    swing.lift[k] = place[2], 0.0, 0.0
    if p.pace.steps_over:
        swing.lift[k, 0] += surface_height(p.terrain, m.place[k, 0], m.place[k, 1])
        swing.risen[k] = swing.lift[k, 0]


@kernel
def swing_foot(p: WalkingRecord, k: int, left: float, span: float) -> None:
    """Bring swing foot k to the present time, ``span`` after the last update and ``left`` before it
    should land.

    Its acceleration is held until the next update. Where that takes :data:`LONG`, it is the one
    that brings the foot to its velocity then: in 20 ms that of a fast leg changes by as much as it
    is.
    """
    _swing(p, k, left, span)
    motion, height, held = p.swing.motion[k], p.swing.lift[k], p.swing.held[k]
    held[:] = *motion[2], height[2]
    if span < LONG:
        return
    motion_now, height_now = np.empty((3, 3)), np.empty(3)
    motion_now[:], height_now[:] = motion, height
    _swing(p, k, max(left - span, 0.0), span)
    held[:3] = (motion[1] - motion_now[1]) / span
    held[3] = (height[1] - height_now[1]) / span
    motion[:], height[:] = motion_now, height_now


@kernel
def _swing(p: WalkingRecord, k: int, left: float, span: float) -> None:
    """Place, velocity and acceleration of a swing foot after a time ``span``, ``left`` before it
    should land.
    """
    if p.pace.steps_over:
        _swing_over(p, k, left, span)
        return
    s, w, u = p.steps, p.tuned, p.planned
    duration = (1.0 - s.double_support) * s.duration
    speed, creep = foot_speed(u, u.velocity), w.creep * (p.pace.omega * p.build.height)
    near = w.near if p.pace.low > 0.0 else w.straight_near
    upright = upright_share(speed, creep, near, w.upright_end)
    begin = upright_share(speed, creep, w.out, w.stuck)
    if not _sticks(p, k, left * s.haste / duration, begin):
        _move_across(p, k, max(left - upright * duration / s.haste, 0.0) + span, span)
    _lift(p, k, 1.0 - s.haste * left / duration, duration, span)


@kernel
def _sticks(p: WalkingRecord, k: int, left: float, upright: float) -> bool:
    """Whether a swing foot with this share of its swing left is in the ground, and has not begun to
    move across it.

    It begins after the share ``upright`` of its swing at the latest.
    """
    begun, inside = np.any(p.swing.motion[k, 2] != 0.0), p.measured.place[k, 2] < p.steps.felt[k]
    return p.pace.low > 0.0 and not begun and left > 1.0 - upright and inside


@kernel
def _lift(p: WalkingRecord, k: int, u: float, duration: float, span: float) -> None:
    """Height of a foot that has done the share u of its swing."""
    z, rate, settle = p.swing.lift[k], p.steps.haste / duration, p.tuned.settle
    felt, low, deeper, begin = p.steps.felt[k], p.pace.low, p.pace.deeper, p.swing.lifted_at[k]
    if u >= 1.0:
        _let_down(p, k, felt - p.tuned.deepest * p.build.height, span)
        return
    if u >= settle:
        last, rate = (u - settle) / (1.0 - settle), rate / (1.0 - settle)
        z[0] = felt + low * (1.0 - last) - deeper * last**2
        z[1] = -(low + 2.0 * deeper * last) * rate
        z[2] = -2.0 * deeper * rate**2
        return
    u, rate = max(u / settle, 0.0), rate / settle
    # Any foot may have met higher ground than the one below this foot.
    up = 64.0 * (p.pace.clearance + (np.max(p.steps.felt) - felt))
    w, down = 1.0 - u, felt + low - begin
    glide = low * settle / (1.0 - settle)
    z[0] = begin + up * (u * w) ** 3 + down * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
    z[0] += glide * u * u * u * (4.0 - 7.0 * u + 3.0 * u * u)
    z[1] = (3.0 * up * (u * w) ** 2 * (w - u) + 30.0 * down * u * u * w * w) * rate
    z[1] += glide * u * u * (12.0 - 28.0 * u + 15.0 * u * u) * rate
    bend = 6.0 * up * u * w * ((w - u) ** 2 - u * w) + 60.0 * down * u * w * (w - u)
    z[2] = (bend + glide * u * (24.0 - 84.0 * u + 60.0 * u * u)) * rate * rate


@kernel
def _move_across(p: WalkingRecord, k: int, left: float, span: float) -> None:
    """Place and heading of a swing foot after a time ``span``, on its way to the foothold in the
    time ``left``.
    """
    motion, place, heading = p.swing.motion[k], p.footholds.place[k], p.swing.motion[k, 0, 2]
    for i in range(3):
        goal = place[i] if i < 2 else heading + wrapped(place[i] - heading)
        motion[:, i] = toward(*motion[:, i], goal, left, span)
    if p.build.soles:
        _stay_in_reach(p, k)


@kernel
def _stay_in_reach(p: WalkingRecord, k: int) -> None:
    """Keep a swing foot as near to its hip as the leg is long now: the hip goes after it."""
    m, b, motion, hip = p.measured, p.build, p.swing.motion[k], hip_place(p, k, 0.0)
    way, z = motion[0, :2] - hip, m.body[2] - b.height + b.hip - p.swing.lift[k, 0]
    square, room = way @ way, max(b.reach**2 + b.hip**2 - z**2, 0.0)
    if square > room:
        motion[0, :2] = hip + np.sqrt(room / square) * way
        motion[1, :2] = m.drift
        motion[2, :2] = 0.0


@kernel
def _let_down(p: WalkingRecord, k: int, lowest: float, span: float) -> None:
    """Height of a foot after a time that has not met the ground in time, down to the lowest one."""
    z, descent = p.swing.lift[k], p.tuned.descent
    z[:] = max(z[0] - descent * span, lowest), -descent, 0.0


@kernel
def _swing_over(p: WalkingRecord, k: int, left: float, span: float) -> None:
    """Bring swing foot k to the present time, ``span`` after the last update and ``left`` before it
    should land.
    """
    s, w, swing = p.steps, p.tuned, p.swing
    duration = (1.0 - s.double_support) * s.duration
    u = 1.0 - left / duration
    if u >= w.start_across:
        _move_across(p, k, max(w.end_across - u, 0.0) * duration + span, span)
    z, ground = swing.lift[k], surface_height(p.terrain, *p.footholds.place[k, :2])
    if u >= 1.0:
        _let_down(p, k, ground - w.deepest * p.build.height, span)
        return
    goal, end = ground - w.penetration_offset, 1.0
    if u < w.sink:
        swing.risen[k] = max(swing.risen[k], _highest_on_way(p, k) + p.pace.clearance)
        goal, end = swing.risen[k], w.apex
    elif u < w.landed:
        goal, end = ground, w.landed
    z[:] = toward(*z, goal, max(end - u, w.least_phase) * duration + span, span)


@kernel
def _highest_on_way(p: WalkingRecord, k: int) -> float:
    """Greatest height of the ground between a foot and its foothold, m."""
    place = p.swing.motion[k, 0, :2]
    way = p.footholds.place[k, :2] - place
    highest = surface_height(p.terrain, *place)
    for i in range(1, PLACES + 1):
        highest = max(highest, surface_height(p.terrain, *(place + i / PLACES * way)))
    return float(highest)
