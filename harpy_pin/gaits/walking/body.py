"""The acceleration of the centre of mass that the stance feet can give, and the targets of body and
feet.
"""

from __future__ import annotations

import numpy as np

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
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane

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
"""Share of its largest normal force up to which a foot may be loaded that has just landed, and that
is about to be lifted, in trots and paces; and both in other walks.
"""
SOLE_MARGIN, LEAST_MARGIN, MARGIN_GAIN = 0.3, 0.05, 2.0
"""Share of a sole, from its edge to its middle, where the centre of pressure does not go; of a
robot that has been pushed; and how fast it falls from one to the other with the distance from where
it should be, over the height.
"""
BEYOND, MOST_BEYOND = 0.5, 0.5
"""Share of what a centre of pressure beyond the soles would push more that is demanded too, and the
farthest such point, in heights of the body: the turning of body, torso and arms pays for it.
"""
AHEAD, LOW_RATE = 0.1, 20.0
"""How far ahead legs on soles must not be stretched, s, and the rate at which the body goes down
where one would be, 1/s.
"""


@kernel
def demand_acceleration(p: WalkingRecord) -> None:
    """Centre of pressure and acceleration: what velocity and place ask for, as far as the feet can
    give it.

    On two points the centre of pressure is on the line between them: across it the robot is a
    pendulum.
    """
    m, feet, square = p.measured, p.measured.place.shape[0], p.omega * p.omega
    a = VELOCITY_GAIN * p.omega * (p.desired - m.drift) + rotation_in_plane(p.path[2]) @ p.rate[:2]
    if not p.walking:
        a += PLACE_GAIN * square * (np.sum(m.place[:, :2], axis=0) / feet - m.centre[:2])
    size = np.hypot(*a)
    if size > MAX_DEMAND:
        a *= MAX_DEMAND / size
    wanted = m.centre[:2] - a / square
    if p.walking and p.sways:
        wanted[:] = _along_cycle(p, wanted)
    stance, reached = np.empty((p.measured.point.shape[0], 2)), p.pressure
    count = stance_points(p, -1, SOLE_MARGIN, stance)
    if count == 0:
        reached[:] = m.centre[:2]
    else:
        reached[:] = nearest_in_hull(stance, count, *wanted)
        beyond = np.hypot(*(reached - wanted)) / p.height
        if p.soles and beyond > 0.0:
            count = stance_points(
                p, -1, max(SOLE_MARGIN - MARGIN_GAIN * beyond, LEAST_MARGIN), stance
            )
            reached[:] = nearest_in_hull(stance, count, *wanted)
    share, beyond = 0.0, np.hypot(*(reached - wanted))
    if p.soles and p.walking and beyond > 0.0:
        share = min(BEYOND, MOST_BEYOND * p.height / beyond)
    p.demand[:] = square * (m.centre[:2] - reached - share * (wanted - reached))


@kernel
def _along_cycle(p: WalkingRecord, pressure: Vector) -> Vector:
    """Centre of pressure that brings the divergent component ξ to its way in an endless walk.

    Over a step ξ runs away from the middle s of the stance feet, ξ(t) = s + b exp(ω t), with b as
    in :mod:`harpy_pin.gaits.walking.pendulum`. The centre of pressure that holds it there is s + (1
    + k) (ξ − ξ(t)). Between soles s goes from one to the other while both are down.
    Along the line between two point feet the one that the velocity asks for, ``pressure``, has the
    say.
    """
    m, g = p.measured, (p.swings + 1) % 2
    jump = rotation_in_plane(p.path[2]) @ (p.middle[p.swings] - p.middle[g])
    duration, passed, share = real_duration(p), p.phase * p.step_duration, 1.0
    growth, now = np.exp(p.omega * duration), np.exp(p.omega * p.step_duration * min(p.phase, 1.0))
    if p.soles:
        passed = min(passed, duration)
        if p.steps > 0:  # the load goes over steadily, as if all at once half-way
            passed -= 0.5 * p.double_support * p.step_duration
            share = min(max(p.phase / p.double_support, 0.0), 1.0)
        now = np.exp(p.omega * passed)
    wanted = desired_after(p, max(1.0 - p.phase, 0.0) * p.step_duration if p.soles else 0.0)
    holds, place = np.where(p.group == g, 1.0, 0.0), m.place[:, :2]
    number = np.sum(holds)
    middle = holds @ place / number
    before = (1.0 - holds) @ place / np.sum(1.0 - holds)
    first = np.argmax(holds)
    line = 2.0 * (place[first] - 0.5 * number * middle)
    about = before if passed < 0.0 and share < 1.0 else middle
    desired = about + now * (middle - about + cyclic_offset(wanted * duration, jump, growth))
    xi = m.centre[:2] + m.drift / p.omega
    at: Vector = middle + (1.0 - share) * (before - middle) + (1.0 + CYCLE_GAIN) * (xi - desired)
    length = np.hypot(*line)
    if number > 1.0 and length > 0.0:
        line /= length
        at += (line @ (pressure - at)) * line
    return at


@kernel
def write_targets(p: WalkingRecord, o: GaitTargetRecord) -> None:
    """The targets: the body where it is, with the demanded acceleration; its heading; the feet."""
    m = p.measured
    o.body[:6] = m.body
    height = p.height + p.raised + mean_felt(p)
    o.body[8] = HEIGHT_GAINS[0] * (height - m.body[2]) + HEIGHT_GAINS[1] * (
        p.velocity[3] - m.body[5]
    )
    if p.soles:
        stretched = _stretched_height(p)
        if stretched < height:
            o.body[8] = min(
                o.body[8], LOW_RATE * (LOW_RATE * (stretched - m.body[2]) - 2.0 * m.body[5])
            )
    o.heading[:] = p.path[2] - p.facing, p.velocity[2], p.rate[2]
    if not p.holds_heading:
        o.heading[1:] = 0.0
    o.centre_of_mass[0] = 1.0 if p.soles and p.terrain.level else 0.0
    o.body[6:8] = p.demand
    if o.centre_of_mass[0] == 0.0 and p.group.shape[0] != 2:
        o.body[6:8] = _body_acceleration(p)
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
            way = hip_place(p, k, AHEAD) - m.place[k, :2]
            square = max(float(p.reach**2 + p.hip**2 - way @ way), 0.25 * p.hip * p.hip)
            least = min(least, p.height - p.hip + m.place[k, 2] + np.sqrt(square))
    return float(least)


@kernel
def mean_felt(p: WalkingRecord) -> float:
    """Height of the ground that the feet have met, m."""
    return float(np.sum(p.felt) / p.felt.shape[0])


@kernel
def _body_acceleration(p: WalkingRecord) -> Vector:
    """Horizontal acceleration of the body with which the pendulum's is the one that is demanded,
    m/s².

    Feet that are swung forward push the body back. A body that gives way needs little friction: by
    as much as keeps the momentum along the line of two stance feet, which hold the body upright
    there by how they share the load; elsewhere the angular momentum about the ground. With the
    reactions R_k of the feet in the air, of accelerations f_k, it is a = (1 − Σ R_k)⁻¹ (demand − Σ
    R_k f_k), in the axes of the heading. A robot with two feet does not give way.
    """
    axes = rotation_in_plane(p.path[2])
    rest, whole, line = axes.T @ p.demand, np.eye(2), axes.T @ p.measured.line
    for k in range(p.group.shape[0]):
        if p.in_air[k] != 0.0:
            reaction = p.reaction[k, :2] - np.outer(line, line @ p.turning[k, :2])
            rest -= reaction @ np.array([*(axes.T @ p.held[k, :2]), p.held[k, 3]])
            whole -= reaction[:, :2]
    (a, b), (c, d) = whole[0], whole[1]
    body: Vector = (
        axes @ np.array([d * rest[0] - b * rest[1], a * rest[1] - c * rest[0]]) / (a * d - b * c)
    )
    return body


@kernel
def _write_swing(p: WalkingRecord, o: GaitTargetRecord, n: int) -> None:
    """A contact point of a swing foot."""
    k = p.foot[n]
    (x, y), turn, bend = (
        rotation_in_plane(p.swing[k, 0, 2]) @ p.corner[n],
        p.swing[k, 1, 2],
        p.held[k, 2],
    )
    arm, across = np.array([x, y, 0.0]), np.array([-y, x, 0.0])
    o.foot_position[n] = np.array([*p.swing[k, 0, :2], p.lift[k, 0]]) + arm
    o.foot_velocity[n] = np.array([*p.swing[k, 1, :2], p.lift[k, 1]]) + turn * across
    o.foot_acceleration[n] = (
        np.array([*p.held[k, :2], p.held[k, 3]]) + bend * across - turn * turn * arm
    )
    tip(p, o, n, p.swing[k, 0, 2])
    o.foot_position[n] -= o.body[:3]
    o.foot_velocity[n] -= o.body[3:6]
    o.foot_acceleration[n] -= o.body[6:]
    done = (p.phase - p.double_support) / (1.0 - p.double_support)
    # From the middle of its swing on, whole-body controllers hold a loaded foot; here the gait says
    # when it has landed.
    o.stance[n], o.phase[n] = 0.0, min(max(done, 0.0), 0.5)


@kernel
def _write_stance(p: WalkingRecord, o: GaitTargetRecord, n: int) -> None:
    """A contact point of a stance foot: where it is; one that does not touch the ground is let
    down.
    """
    m, k = p.measured, p.foot[n]
    o.foot_position[n] = m.point[n] - o.body[:3]
    o.foot_velocity[n] = -o.body[3:6]
    o.foot_acceleration[n] = -o.body[6:]
    o.foot_velocity[n, 2] -= DESCENT
    o.ground_height[n] = p.touched[k]
    o.stance[n], o.phase[n], o.load[n] = 1.0, 0.5, _share_of_load(p, k) * share_of_edge(p, n)
    if is_lifted(p, n):
        lift_corner(p, o, n)


@kernel
def _share_of_load(p: WalkingRecord, k: int) -> float:
    """Share of its largest normal force up to which a foot may be loaded.

    It rises from its touchdown on, and falls before it is lifted, each over the time in which every
    foot is down.
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
