"""The acceleration of the centre of mass that the stance feet can give, and the targets of body and feet."""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.gaits.walking.pendulum import (
    cyclic_offset,
    desired_after,
    hip_place,
    nearest_in_hull,
    real_duration,
    stance_points,
)
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.rolling import is_lifted, lift_corner, share_of_edge, tip
from harpy_pin.gaits.walking.swinging import DESCENT

VELOCITY_GAIN = 1.1
"""Gain of the velocity of the centre of mass, as a share of ω."""
PLACE_GAIN = 0.7
"""Gain of its place while the robot stands, as a share of ω²."""
HEIGHT_GAINS = (60.0, 15.0)
"""Gains of the body's height, 1/s² and 1/s."""
CYCLE_GAIN = 1.0
"""Gain of the divergent component on its way back to that of an endless walk, as a share of ω."""
MAX_DEMAND = 3.0
"""Largest acceleration that velocity and place ask for, m/s²."""
FIRST_LOAD, LAST_LOAD, LEAST_LOAD = 0.07, 0.01, 0.05
"""Share of its largest normal force up to which a foot may be loaded that has just landed, and that is about to be
lifted, in trots and paces; and both in other walks."""
SOLE_MARGIN, LEAST_MARGIN, MARGIN_GAIN = 0.3, 0.05, 2.0
"""Share of a sole, from its edge to its middle, where the centre of pressure does not go; of a robot that has been
pushed; and how fast it falls from one to the other with the distance from where it should be, over the height."""
BEYOND, MOST_BEYOND = 0.5, 0.5
"""Share of what a centre of pressure beyond the soles would push more that is demanded too, and the farthest such
point, in heights of the body: the turning of body, torso and arms pays for it."""
AHEAD, LOW_RATE = 0.1, 20.0
"""How far ahead legs on soles must not be stretched, s, and the rate at which the body goes down where one would be,
1/s."""


@kernel
def demand_acceleration(p: WalkingRecord) -> None:
    """Centre of pressure and acceleration: what velocity and place ask for, as far as the feet can give it.

    On two points the centre of pressure is on the line between them: across it the robot is a pendulum.
    """
    m = p.measured
    gain, c, s = VELOCITY_GAIN * p.omega, np.cos(p.path[2]), np.sin(p.path[2])
    ax = gain * (p.desired[0] - m.drift[0]) + c * p.rate[0] - s * p.rate[1]
    ay = gain * (p.desired[1] - m.drift[1]) + s * p.rate[0] + c * p.rate[1]
    if not p.walking:
        feet = m.place.shape[0]
        gain = PLACE_GAIN * p.omega * p.omega
        for k in range(feet):
            ax += gain * (m.place[k, 0] - m.centre[0]) / feet
            ay += gain * (m.place[k, 1] - m.centre[1]) / feet
    size = np.hypot(ax, ay)
    if size > MAX_DEMAND:
        ax, ay = MAX_DEMAND / size * ax, MAX_DEMAND / size * ay
    square = p.omega * p.omega
    x, y = m.centre[0] - ax / square, m.centre[1] - ay / square
    if p.walking and p.sways:
        x, y = _along_cycle(p, x, y)
    stance = np.empty((p.measured.point.shape[0], 2))
    count = stance_points(p, -1, SOLE_MARGIN, stance)
    if count == 0:
        p.pressure[0], p.pressure[1] = m.centre[0], m.centre[1]
    else:
        p.pressure[0], p.pressure[1] = nearest_in_hull(stance, count, x, y)
        beyond = np.hypot(p.pressure[0] - x, p.pressure[1] - y) / p.height
        if p.soles and beyond > 0.0:
            count = stance_points(p, -1, max(SOLE_MARGIN - MARGIN_GAIN * beyond, LEAST_MARGIN), stance)
            p.pressure[0], p.pressure[1] = nearest_in_hull(stance, count, x, y)
    share, beyond = 0.0, np.hypot(p.pressure[0] - x, p.pressure[1] - y)
    if p.soles and p.walking and beyond > 0.0:
        share = min(BEYOND, MOST_BEYOND * p.height / beyond)
    p.demand[0] = square * (m.centre[0] - p.pressure[0] - share * (x - p.pressure[0]))
    p.demand[1] = square * (m.centre[1] - p.pressure[1] - share * (y - p.pressure[1]))


@kernel
def _along_cycle(p: WalkingRecord, x: float, y: float) -> tuple[float, float]:
    """Centre of pressure that brings the divergent component ξ to its way in an endless walk.

    Over a step ξ runs away from the middle s of the stance feet, ξ(t) = s + b exp(ω t), with b as in
    :mod:`harpy_pin.gaits.walking.pendulum`. The centre of pressure that holds it there is s + (1 + k) (ξ − ξ(t)).
    Between soles s goes from one to the other while both are down.
    Along the line between two point feet the one that the velocity asks for, (x, y), has the say.
    """
    m, g = p.measured, (p.swings + 1) % 2
    c, s = np.cos(p.path[2]), np.sin(p.path[2])
    jump_ahead, jump_aside = p.middle[p.swings, 0] - p.middle[g, 0], p.middle[p.swings, 1] - p.middle[g, 1]
    jump = c * jump_ahead - s * jump_aside, s * jump_ahead + c * jump_aside
    duration, passed, share = real_duration(p), p.phase * p.step_duration, 1.0
    growth, now = np.exp(p.omega * duration), np.exp(p.omega * p.step_duration * min(p.phase, 1.0))
    if p.soles:
        passed = min(passed, duration)
        if p.steps > 0:  # the load goes over steadily, as if all at once half-way
            passed -= 0.5 * p.double_support * p.step_duration
            share = min(max(p.phase / p.double_support, 0.0), 1.0)
        now = np.exp(p.omega * passed)
    at = np.empty(2)
    line = np.zeros(2)
    wanted = desired_after(p, max(1.0 - p.phase, 0.0) * p.step_duration if p.soles else 0.0)
    for i in range(2):
        middle = number = before = others = 0.0
        for k in range(p.group.shape[0]):
            if p.group[k] == g:
                line[i] += m.place[k, i] if number == 0.0 else -m.place[k, i]
                middle, number = middle + m.place[k, i], number + 1.0
            else:
                before, others = before + m.place[k, i], others + 1.0
        middle, before = middle / number, before / others
        about = before if passed < 0.0 and share < 1.0 else middle
        desired = about + now * (middle - about + cyclic_offset(wanted[i] * duration, jump[i], growth))
        at[i] = (
            middle
            + (1.0 - share) * (before - middle)
            + (1.0 + CYCLE_GAIN) * (m.centre[i] + m.drift[i] / p.omega - desired)
        )
        if number == 1.0:
            line[i] = 0.0
    length = np.hypot(line[0], line[1])
    if length > 0.0:
        ex, ey = line[0] / length, line[1] / length
        along = ex * (x - at[0]) + ey * (y - at[1])
        at[0], at[1] = at[0] + along * ex, at[1] + along * ey
    return at[0], at[1]


@kernel
def write_targets(p: WalkingRecord, o: GaitTargetRecord) -> None:
    """The targets: the body where it is, with the demanded acceleration; its heading; the feet."""
    m = p.measured
    for i in range(3):
        o.body[i], o.body[3 + i] = m.body[i], m.body[3 + i]
    height = p.height + p.raised + mean_felt(p)
    o.body[8] = HEIGHT_GAINS[0] * (height - m.body[2]) + HEIGHT_GAINS[1] * (p.velocity[3] - m.body[5])
    if p.soles:
        stretched = _stretched_height(p)
        if stretched < height:
            o.body[8] = min(o.body[8], LOW_RATE * (LOW_RATE * (stretched - m.body[2]) - 2.0 * m.body[5]))
    o.heading[0] = p.path[2] - p.facing
    o.heading[1] = p.velocity[2] if p.holds_heading else 0.0
    o.heading[2] = p.rate[2] if p.holds_heading else 0.0
    o.centre_of_mass[0] = 1.0 if p.soles and p.terrain.level else 0.0
    if o.centre_of_mass[0] != 0.0:
        o.body[6], o.body[7] = p.demand[0], p.demand[1]
    else:
        o.body[6], o.body[7] = _body_acceleration(p)
    for n in range(p.foot.shape[0]):
        if p.in_air[p.foot[n]] != 0.0:
            _write_swing(p, o, n)
        else:
            _write_stance(p, o, n)


@kernel
def _stretched_height(p: WalkingRecord) -> float:
    """Height of the body at which the first of the stance legs will be stretched, m."""
    m, least = p.measured, np.inf
    for k in range(p.group.shape[0]):
        if p.in_air[k] == 0.0:
            x, y = hip_place(p, k, AHEAD)
            x, y = x - m.place[k, 0], y - m.place[k, 1]
            square = max(p.reach * p.reach + p.hip * p.hip - x * x - y * y, 0.25 * p.hip * p.hip)
            least = min(least, p.height - p.hip + m.place[k, 2] + np.sqrt(square))
    return float(least)


@kernel
def mean_felt(p: WalkingRecord) -> float:
    """Height of the ground that the feet have met, m."""
    total = 0.0
    for k in range(p.felt.shape[0]):
        total += p.felt[k]
    return float(total / p.felt.shape[0])


@kernel
def _body_acceleration(p: WalkingRecord) -> tuple[float, float]:
    """Horizontal acceleration of the body with which the pendulum's is the one that is demanded, m/s².

    Feet that are swung forward push the body back. A body that gives way needs little friction: by as much as keeps the
    momentum along the line of two stance feet, which hold the body upright there by how they share the load; elsewhere
    the angular momentum about the ground. A robot with two feet does not give way.
    """
    if p.group.shape[0] == 2:
        return p.demand[0], p.demand[1]
    c, s = np.cos(p.path[2]), np.sin(p.path[2])
    ahead, aside = c * p.demand[0] + s * p.demand[1], c * p.demand[1] - s * p.demand[0]
    a, b, d, e = 1.0, 0.0, 0.0, 1.0
    line, r = p.measured.line, np.empty((2, 3))
    along, across = c * line[0] + s * line[1], c * line[1] - s * line[0]
    for k in range(p.group.shape[0]):
        if p.in_air[k] != 0.0:
            x, y = p.held[k, 0], p.held[k, 1]
            x, y, z = c * x + s * y, c * y - s * x, p.held[k, 3]
            for j in range(3):
                turning = along * p.turning[k, 0, j] + across * p.turning[k, 1, j]
                r[0, j], r[1, j] = p.reaction[k, 0, j] - along * turning, p.reaction[k, 1, j] - across * turning
            ahead -= r[0, 0] * x + r[0, 1] * y + r[0, 2] * z
            aside -= r[1, 0] * x + r[1, 1] * y + r[1, 2] * z
            a, b, d, e = a - r[0, 0], b - r[0, 1], d - r[1, 0], e - r[1, 1]
    whole = a * e - b * d
    ahead, aside = (e * ahead - b * aside) / whole, (a * aside - d * ahead) / whole
    return c * ahead - s * aside, s * ahead + c * aside


@kernel
def _write_swing(p: WalkingRecord, o: GaitTargetRecord, n: int) -> None:
    """A contact point of a swing foot."""
    k = p.foot[n]
    swing, z = p.swing[k], p.lift[k]
    c, s = np.cos(swing[0, 2]), np.sin(swing[0, 2])
    x, y = c * p.corner[n, 0] - s * p.corner[n, 1], s * p.corner[n, 0] + c * p.corner[n, 1]
    turn, bend = swing[1, 2], p.held[k, 2]
    place, velocity, acceleration = o.foot_position[n], o.foot_velocity[n], o.foot_acceleration[n]
    place[0], place[1], place[2] = swing[0, 0] + x, swing[0, 1] + y, z[0]
    velocity[0], velocity[1], velocity[2] = swing[1, 0] - turn * y, swing[1, 1] + turn * x, z[1]
    acceleration[0] = p.held[k, 0] - bend * y - turn * turn * x
    acceleration[1] = p.held[k, 1] + bend * x - turn * turn * y
    acceleration[2] = p.held[k, 3]
    tip(p, o, n, swing[0, 2])
    for i in range(3):
        place[i] -= o.body[i]
        velocity[i] -= o.body[3 + i]
        acceleration[i] -= o.body[6 + i]
    done = (p.phase - p.double_support) / (1.0 - p.double_support)
    # From the middle of its swing on, whole-body controllers hold a loaded foot; here the gait says when it has landed.
    o.stance[n], o.phase[n] = 0.0, min(max(done, 0.0), 0.5)


@kernel
def _write_stance(p: WalkingRecord, o: GaitTargetRecord, n: int) -> None:
    """A contact point of a stance foot: where it is; one that does not touch the ground is let down."""
    m, k = p.measured, p.foot[n]
    for i in range(3):
        o.foot_position[n, i] = m.point[n, i] - o.body[i]
        o.foot_velocity[n, i] = -o.body[3 + i]
        o.foot_acceleration[n, i] = -o.body[6 + i]
    o.foot_velocity[n, 2] -= DESCENT
    o.ground_height[n] = p.touched[k]
    o.stance[n], o.phase[n], o.load[n] = 1.0, 0.5, _share_of_load(p, k) * share_of_edge(p, n)
    if is_lifted(p, n):
        lift_corner(p, o, n)


@kernel
def _share_of_load(p: WalkingRecord, k: int) -> float:
    """Share of its largest normal force up to which a foot may be loaded.

    It rises from its touchdown on, and falls before it is lifted, each over the time in which every foot is down.
    """
    if not p.walking:
        return 1.0
    both = p.double_support * p.step_duration
    first, last = (FIRST_LOAD, LAST_LOAD) if p.gentle else (LEAST_LOAD, LEAST_LOAD)
    share = max(p.load_ramp * p.since[k] / both, first) if p.since[k] < both else 1.0
    if p.group[k] == p.swings and p.phase <= p.double_support:
        fall = max(p.phase / p.double_support, 0.0)
        if fall > 0.0:
            share = min(share, max(p.load_ramp * (1.0 - fall), last))
    return float(share)
