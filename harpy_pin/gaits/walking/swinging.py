"""The swing feet: horizontally to a foothold that may change at any tick, vertically up, down and
on down.

Over ground that is not even they go first up, then across what is higher, then down, in world
heights: a foot that moved across while it is still rising would meet the riser of a step that it
stands before.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.gaits.velocity import foot_speed
from harpy_pin.gaits.walking.pendulum import (
    NEAR,
    SETTLE,
    STRAIGHT_NEAR,
    hip_place,
    toward,
    upright_begin,
    upright_end,
    wrapped,
)
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.rolling import flat_place
from harpy_pin.ground.surface import TerrainRecord, greatest_rise, surface_height
from harpy_pin.kernels import kernel
from harpy_pin.model.record import Records
from harpy_pin.model.state import Vector

UP, ACROSS, THERE, DOWN, LANDED = 0.4, 0.2, 0.7, 0.5, 0.9
"""Shares of its swing at which a foot is at its highest, begins to move across and ends to, begins
to sink, and is at the ground.
"""
LEAST = 0.1
"""Share of its swing that a foot has at least for what is left of a phase."""
DESCENT = 0.3
"""Velocity at which a foot goes on down that has not met the ground in time, m/s."""
DEEPEST = 0.25
"""How far below the ground it is searched for, as a share of the body's height."""
FARTHEST = 0.68
"""Way of a foot in a step, on which it steps over what is higher, in heights of the body."""
PLACES = 8
"""On the way of a foot whose heights are looked at."""
LIFT = 80.0
"""Largest acceleration of a foot on its way up, m/s²."""
LONG = 1.5e-3
"""Time between two updates from which on a foot's acceleration changes too much to be taken as
constant, s.
"""
PEAK = 5.7735
"""Largest acceleration of a motion from rest to rest, in its way over its squared duration."""


@kernel
def lift_foot(p: WalkingRecord, k: int) -> None:
    """Begin the swing of a foot where it is."""
    m = p.measured
    place = flat_place(p, k)
    p.in_air[k] = 1.0
    m.load[k] = 0.0  # of its stance: at few ticks a step that would look like a touchdown
    p.lifted_at[k] = place[2]
    p.swing[k] = 0.0
    p.swing[k, 0] = *place[:2], m.turned[k]
    p.lift[k] = place[2], 0.0, 0.0
    if p.steps_over:
        p.lift[k, 0] += surface_height(p.terrain, m.place[k, 0], m.place[k, 1])
        p.risen[k] = p.lift[k, 0]
    p.foothold[k] = p.swing[k, 0]


@kernel
def swing_foot(p: WalkingRecord, k: int, left: float, span: float) -> None:
    """Bring swing foot k to the present time, ``span`` after the last update and ``left`` before it
    should land.

    Its acceleration is held until the next update. Where that takes :data:`LONG`, it is the one
    that brings the foot to its velocity then: in 20 ms that of a fast leg changes by as much as it
    is.
    """
    _swing(p, k, left, span)
    swing, height = p.swing[k], p.lift[k]
    p.held[k] = *swing[2], height[2]
    if span < LONG:
        return
    swing_now, height_now = np.empty((3, 3)), np.empty(3)
    swing_now[:], height_now[:] = swing, height
    _swing(p, k, max(left - span, 0.0), span)
    p.held[k, :3] = (swing[1] - swing_now[1]) / span
    p.held[k, 3] = (height[1] - height_now[1]) / span
    swing[:], height[:] = swing_now, height_now


@kernel
def _swing(p: WalkingRecord, k: int, left: float, span: float) -> None:
    """Place, velocity and acceleration of a swing foot after a time ``span``, ``left`` before it
    should land.
    """
    if p.steps_over:
        _swing_over(p, k, left, span)
        return
    duration = (1.0 - p.double_support) * p.step_duration
    speed, natural = foot_speed(p, p.velocity), p.omega * p.height
    upright = upright_end(speed, natural, NEAR if p.low > 0.0 else STRAIGHT_NEAR)
    if not _sticks(p, k, left * p.haste / duration, upright_begin(speed, natural)):
        _move_across(p, k, max(left - upright * duration / p.haste, 0.0) + span, span)
    _lift(p, k, 1.0 - p.haste * left / duration, duration, span)


@kernel
def _sticks(p: WalkingRecord, k: int, left: float, upright: float) -> bool:
    """Whether a swing foot with this share of its swing left is in the ground, and has not begun to
    move across it.

    It begins after the share ``upright`` of its swing at the latest.
    """
    begun: bool = p.swing[k, 2, 0] != 0.0 or p.swing[k, 2, 1] != 0.0 or p.swing[k, 2, 2] != 0.0
    return p.low > 0.0 and not begun and left > 1.0 - upright and p.measured.place[k, 2] < p.felt[k]


@kernel
def _step_up(p: WalkingRecord, k: int) -> float:
    """How much higher than below a foot the ground is that any foot has met, m."""
    return float(np.max(p.felt) - p.felt[k])


@kernel
def _lift(p: WalkingRecord, k: int, u: float, duration: float, span: float) -> None:
    """Height of a foot that has done the share u of its swing."""
    z, rate = p.lift[k], p.haste / duration
    if u >= 1.0:
        _let_down(z, p.felt[k] - DEEPEST * p.height, span)
        return
    if u >= SETTLE:
        last, rate = (u - SETTLE) / (1.0 - SETTLE), rate / (1.0 - SETTLE)
        z[0] = p.felt[k] + p.low * (1.0 - last) - p.deeper * last**2
        z[1] = -(p.low + 2.0 * p.deeper * last) * rate
        z[2] = -2.0 * p.deeper * rate**2
        return
    u, rate = max(u / SETTLE, 0.0), rate / SETTLE
    w, down, up = 1.0 - u, p.felt[k] + p.low - p.lifted_at[k], 64.0 * (p.clearance + _step_up(p, k))
    glide = p.low * SETTLE / (1.0 - SETTLE)
    z[0] = p.lifted_at[k] + up * (u * w) ** 3 + down * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
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
    swing, heading = p.swing[k], p.swing[k, 0, 2]
    for i in range(3):
        goal = p.foothold[k, i] if i < 2 else heading + wrapped(p.foothold[k, i] - heading)
        swing[:, i] = toward(*swing[:, i], goal, left, span)
    if p.soles:
        _stay_in_reach(p, k)


@kernel
def _stay_in_reach(p: WalkingRecord, k: int) -> None:
    """Keep a swing foot as near to its hip as the leg is long now: the hip goes after it."""
    m, swing, hip = p.measured, p.swing[k], hip_place(p, k, 0.0)
    way, z = swing[0, :2] - hip, m.body[2] - p.height + p.hip - p.lift[k, 0]
    square, room = way @ way, max(p.reach**2 + p.hip**2 - z**2, 0.0)
    if square > room:
        swing[0, :2] = hip + np.sqrt(room / square) * way
        swing[1, :2] = m.drift
        swing[2, :2] = 0.0


@kernel
def _let_down(z: Vector, lowest: float, span: float) -> None:
    """Height of a foot after a time that has not met the ground in time, down to the lowest one."""
    z[:] = max(z[0] - DESCENT * span, lowest), -DESCENT, 0.0


@kernel
def _swing_over(p: WalkingRecord, k: int, left: float, span: float) -> None:
    """Bring swing foot k to the present time, ``span`` after the last update and ``left`` before it
    should land.
    """
    duration = (1.0 - p.double_support) * p.step_duration
    u = 1.0 - left / duration
    if u >= ACROSS:
        _move_across(p, k, max(THERE - u, 0.0) * duration + span, span)
    z, ground = p.lift[k], surface_height(p.terrain, p.foothold[k, 0], p.foothold[k, 1])
    if u >= 1.0:
        _let_down(z, ground - DEEPEST * p.height, span)
        return
    goal, end = ground - p.penetration_offset, 1.0
    if u < DOWN:
        p.risen[k] = max(p.risen[k], _highest_on_way(p, k) + p.clearance)
        goal, end = p.risen[k], UP
    elif u < LANDED:
        goal, end = ground, LANDED
    z[:] = toward(*z, goal, max(end - u, LEAST) * duration + span, span)


@kernel
def _highest_on_way(p: WalkingRecord, k: int) -> float:
    """Greatest height of the ground between a foot and its foothold, m."""
    place = p.swing[k, 0, :2]
    way = p.foothold[k, :2] - place
    highest = surface_height(p.terrain, *place)
    for i in range(1, PLACES + 1):
        highest = max(highest, surface_height(p.terrain, *(place + i / PLACES * way)))
    return float(highest)


def walk_over(walk: Records[WalkingRecord], terrain: Records[TerrainRecord], reach: float) -> bool:
    """Let a walk go over a terrain, whose plane the body follows in a square to ``reach`` on each
    side.

    Where that is no plane, steps last as long as lifting a foot takes. Returns whether the targets
    of swing feet have world heights: those of points, on ground that is no plane.
    """
    walk["terrain"], walk["ground_reach"] = terrain, reach
    uneven = bool(terrain["pieces"][0] or terrain["cells"][0, 2])
    if not uneven or walk["soles"][0]:
        return False
    walk["steps_over"] = 1
    walk["slow_double_support"] = walk["double_support"] = walk["fast_double_support"]
    walk["slow_load_ramp"] = walk["fast_load_ramp"] = 1.0
    height = float(walk["clearance"][0]) + greatest_rise(
        terrain, FARTHEST * float(walk["height"][0])
    )
    least = float(np.sqrt(PEAK * height / LIFT)) / (UP * (1.0 - float(walk["double_support"][0])))
    walk["usual_step"] = max(least, float(walk["usual_step"][0]))
    walk["step_duration"] = walk["usual_step"]
    return True
