"""The linear inverted pendulum about a centre of pressure, c̈ = ω² (c − p), in closed form, one
coordinate at a time.

Its *divergent component of motion* ξ = c + ċ/ω (the capture point) runs away from p: ξ(t) = p +
(ξ(0) − p) exp(ω t). In a walk that goes on for ever with steps of duration T, ξ has at each
touchdown the same offset from the foot that lands (Englsberger, Ott and Albu-Schäffer 2015): for a
way L per step b = L / (exp(ω T) − 1), and for a support that jumps by D, forth and back, b = D /
(exp(ω T) + 1). The centre of pressure is in the hull of the points of the stance feet.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from harpy_pin.gaits.walking.rolling import is_lifted, rolls
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane

if TYPE_CHECKING:
    from harpy_pin.gaits.walking.record import WalkingRecord

SAME = 1e-6
"""Distance below which two points are one, m."""
TINY = 1e-12
"""Area below which three points are on one line, m²."""
RACE = 95.0
"""Horizontal velocity of a foot at a share s of its swing after it starts, and before it stops,
over s² and the velocity of the walk.
"""


@kernel
def predict(
    place: float, velocity: float, pressure: float, omega: float, time: float
) -> tuple[float, float]:
    """Place c (m) and velocity ċ (m/s) after a time, s, about a centre of pressure p that stays, m,
    with ω, 1/s.
    """
    grow, fall = np.exp(omega * time), np.exp(-omega * time)
    cosh, sinh = 0.5 * (grow + fall), 0.5 * (grow - fall)
    x = place - pressure
    return pressure + cosh * x + sinh / omega * velocity, omega * sinh * x + cosh * velocity


@kernel
def cyclic_offset(way: Any, jump: Any, growth: float) -> Any:
    """Offset of ξ from a foot that lands, in a walk that goes on for ever, m: a number, or both
    coordinates.

    The way L per step and the jump D from this support to the next, in the frame that moves with
    the walk, are in m; ``growth`` is exp(ω T).
    """
    return way / (growth - 1.0) + jump / (growth + 1.0)


@kernel
def upright_share(speed: float, creep: float, near: float, least: float) -> float:
    """Share of its swing, at one of its ends, in which a foot moves vertically, at a speed of the
    walk, m/s.

    It is ``least`` or more. In the share ``near`` the foot is near the ground, and moves across it
    at ``creep``, m/s, at most.
    A foot that meets the ground while it moves across it is thrown up by contacts that are convex,
    such as MuJoCo's, at μ times that velocity. Ground that gives way follows a foot that rises, and
    holds on to one that moves across it faster than it rises.
    """
    if speed <= 0.0:
        return least
    return float(max(near - np.sqrt(creep / (RACE * speed)), least))


@kernel(points=("n", 2))
def nearest_in_hull(points: Vector, count: int, x: float, y: float) -> tuple[float, float]:
    """The point nearest to (x, y) of the convex hull, polygon, segment or point, of the first
    ``count`` points.
    """
    outside = count < 3
    best = np.hypot(points[0, 0] - x, points[0, 1] - y)
    at_x, at_y = points[0]
    area = 0.0
    for i in range(count):
        for j in range(count):
            ex, ey = points[j] - points[i]
            length = ex * ex + ey * ey
            if length < SAME * SAME:
                continue
            left = True  # whether all points are left of the edge, or on it
            for n in range(count):
                side = ex * (points[n, 1] - points[i, 1]) - ey * (points[n, 0] - points[i, 0])
                area = max(area, abs(side))
                left = left and side >= -TINY
            dx, dy = x - points[i, 0], y - points[i, 1]
            if left and ex * dy - ey * dx < 0.0:
                outside = True
            share = min(max((ex * dx + ey * dy) / length, 0.0), 1.0)
            px, py = points[i, 0] + share * ex, points[i, 1] + share * ey
            distance = np.hypot(px - x, py - y)
            if distance < best:
                best, at_x, at_y = distance, px, py
    if not outside and area > TINY:
        return x, y
    return at_x, at_y


@kernel
def stance_points(p: WalkingRecord, without: int, margin: float, out: Vector) -> int:
    """Contact points (points, 2) of the stance feet, without those of one group (−1 for none);
    returns how many.

    Each is drawn by the share ``margin`` of the way to the middle of its foot. A foot that rolls
    has those of its edge.
    """
    m, count = p.measured, 0
    for n in range(m.point.shape[0]):
        k = p.build.foot[n]
        if p.steps.in_air[k] == 0.0 and p.pace.group[k] != without and not is_lifted(p, n):
            middle = p.roll.pivot if rolls(p, k) else m.place[k]
            out[count] = m.point[n, :2] + margin * (middle[:2] - m.point[n, :2])
            count += 1
    return count


@kernel
def change_after(p: WalkingRecord, share: float, time: float) -> Vector:
    """Change of the applied velocity after a time, forward and to the left, towards a share of the
    goal, m/s.
    """
    u = p.planned
    change = share * u.goal[:2] - u.velocity[:2]
    needed = np.hypot(change[0] / u.acceleration[0], change[1] / u.acceleration[1])
    return (time / needed if needed > time else 1.0) * change


@kernel
def desired_after(p: WalkingRecord, time: float) -> Vector:
    """Velocity of the centre of mass that is asked for after a time, m/s: it goes on towards the
    goal, and turns.
    """
    u = p.planned
    velocity = u.velocity[:2] + change_after(p, 1.0, time)
    return rotation_in_plane(u.path[2] + time * u.velocity[2]) @ velocity + u.back


@kernel
def hip_place(p: WalkingRecord, k: int, time: float) -> Vector:
    """Where the hip of foot k is after a time, if the centre of mass goes on as it does, m."""
    m = p.measured
    place: Vector = m.centre[:2] + time * m.drift + rotation_in_plane(m.heading) @ p.pace.nominal[k]
    return place


@kernel
def real_duration(p: WalkingRecord) -> float:
    """Duration of the present step, s: a sole meets the ground when it has come down, a little
    before its time.
    """
    early = (1.0 - p.tuned.settle) * (1.0 - p.steps.double_support) if p.build.soles else 0.0
    return float((1.0 - early) * p.steps.duration)


@kernel
def wrapped(angle: float) -> float:
    """The angle between −π and π, rad."""
    return float(angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi) + 0.5))
