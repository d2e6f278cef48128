"""The swing feet: horizontally to a foothold that may change at any tick, vertically up, down and on down."""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.gaits.walking.commanding import foot_speed, wrapped
from harpy_pin.gaits.walking.pendulum import toward
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.stepping_over import DEEPEST, DESCENT, swing_over
from harpy_pin.ground.surface import surface_height

__all__: list[str] = []

SETTLE = 0.9
"""Share of its swing after which a foot is at the ground, or almost; from there on it goes down slowly, so as not to
land hard."""
UPRIGHT_END = 0.1
"""Least share of its swing, at the end, in which a foot moves vertically."""
NEAR, STRAIGHT_NEAR = 0.166, 0.185
"""Share of its swing, at the end, in which a foot is near to the ground: one that goes down slowly, nearer than
5 % of its clearance; others, 4 %."""
STUCK = 0.03
"""Share of its swing in which a foot goes straight up, at most, until it has left the ground."""
CREEP = 0.14
"""Largest horizontal velocity with which a foot comes that near, as a share of ω times the body's height."""
RACE = 95.0
"""Horizontal velocity of a foot at a share s of its swing before it stops, over s² and the velocity of the walk."""


@kernel
def lift_foot(p: WalkingRecord, k: int) -> None:
    """Begin the swing of a foot where it is."""
    m = p.measured
    p.in_air[k] = 1.0
    p.lifted_at[k] = m.place[k, 2]
    p.swing[k] = 0.0
    p.lift[k] = 0.0
    for i in range(2):
        p.swing[k, 0, i] = m.place[k, i]
    p.swing[k, 0, 2] = m.turned[k]
    p.lift[k, 0] = m.place[k, 2]
    if p.steps_over:
        p.lift[k, 0] += surface_height(p.terrain, m.place[k, 0], m.place[k, 1])
        p.risen[k] = p.lift[k, 0]
    p.foothold[k] = p.swing[k, 0]


@kernel
def swing_foot(p: WalkingRecord, k: int, left: float, span: float) -> None:
    """Bring swing foot k to the present time, ``span`` after the last update and ``left`` before it should land."""
    if p.steps_over:
        swing_over(p, k, left, span)
        return
    swing = p.swing[k]
    duration = (1.0 - p.double_support) * p.step_duration
    upright = upright_end(foot_speed(p, p.velocity), p.omega * p.height, NEAR if p.low > 0.0 else STRAIGHT_NEAR)
    rest = max(left - upright * duration / p.haste, 0.0) + span
    sticks = _sticks(p, k, left * p.haste / duration)
    for i in range(3):
        goal = p.foothold[k, i]
        if i == 2:
            goal = swing[0, 2] + wrapped(goal - swing[0, 2])
        if not sticks:
            swing[0, i], swing[1, i], swing[2, i] = toward(swing[0, i], swing[1, i], swing[2, i], goal, rest, span)
    _lift(p, k, 1.0 - p.haste * left / duration, duration, span)


@kernel
def _sticks(p: WalkingRecord, k: int, left: float) -> bool:
    """Whether a swing foot with this share of its swing left is in the ground, and has not begun to move across it."""
    begun: bool = p.swing[k, 2, 0] != 0.0 or p.swing[k, 2, 1] != 0.0 or p.swing[k, 2, 2] != 0.0
    return p.low > 0.0 and not begun and left > 1.0 - STUCK and p.measured.place[k, 2] < p.felt[k]


@kernel
def upright_end(speed: float, natural: float, near: float) -> float:
    """Share of its swing, at the end, in which a foot moves vertically, at a speed of the walk.

    A foot that meets the ground while it moves across it is thrown up by contacts that are convex, such as MuJoCo's, at
    μ times that velocity. So a fast one stops earlier. ``natural`` is ω times the body's height, ``near`` is
    :data:`NEAR`.
    """
    if speed <= 0.0:
        return UPRIGHT_END
    return float(max(near - np.sqrt(CREEP * natural / (RACE * speed)), UPRIGHT_END))


@kernel
def _step_up(p: WalkingRecord, k: int) -> float:
    """How much higher than below a foot the ground is that any foot has met, m."""
    highest = p.felt[k]
    for j in range(p.felt.shape[0]):
        highest = max(highest, p.felt[j])
    return float(highest - p.felt[k])


@kernel
def _lift(p: WalkingRecord, k: int, u: float, duration: float, span: float) -> None:
    """Height of a foot that has done the share u of its swing."""
    z, rate = p.lift[k], p.haste / duration
    if u >= 1.0:
        z[0] = max(z[0] - DESCENT * span, p.felt[k] - DEEPEST * p.height)
        z[1], z[2] = -DESCENT, 0.0
        return
    if u >= SETTLE:
        last, rate = (u - SETTLE) / (1.0 - SETTLE), rate / (1.0 - SETTLE)
        z[0] = p.felt[k] + p.low * (1.0 - last) - p.deeper * last * last
        z[1] = -(p.low + 2.0 * p.deeper * last) * rate
        z[2] = -2.0 * p.deeper * rate * rate
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
