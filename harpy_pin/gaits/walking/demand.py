"""The acceleration of the centre of mass that the stance feet can give."""

from __future__ import annotations

import numpy as np

from harpy_pin.gaits.walking.pendulum import (
    cyclic_offset,
    desired_after,
    nearest_in_hull,
    real_duration,
    stance_points,
)
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane


@kernel
def demand_acceleration(p: WalkingRecord) -> None:
    """Centre of pressure and acceleration: what velocity and place ask for, as far as the feet can
    give it.

    On two points the centre of pressure is on the line between them: across it the robot is a
    pendulum.
    """
    m, w, u, omega, height = p.measured, p.tuned, p.planned, p.pace.omega, p.build.height
    feet, square = m.place.shape[0], omega * omega
    a = w.velocity_gain * omega * (u.desired - m.drift) + rotation_in_plane(u.path[2]) @ u.rate[:2]
    if not p.steps.walking:
        a += w.place_gain * square * (np.sum(m.place[:, :2], axis=0) / feet - m.centre[:2])
    size = np.hypot(*a)
    if size > w.max_demand:
        a *= w.max_demand / size
    wanted = m.centre[:2] - a / square
    if p.steps.walking and p.pace.sways:
        wanted[:] = _along_cycle(p, wanted)
    stance, reached = np.empty((p.measured.point.shape[0], 2)), p.demand.pressure
    count = stance_points(p, -1, w.sole_margin, stance)
    if count == 0:
        reached[:] = m.centre[:2]
    else:
        reached[:] = nearest_in_hull(stance, count, *wanted)
        beyond = np.hypot(*(reached - wanted)) / height
        if p.build.soles and beyond > 0.0:
            margin = max(w.sole_margin - w.margin_gain * beyond, w.least_sole_margin)
            count = stance_points(p, -1, margin, stance)
            reached[:] = nearest_in_hull(stance, count, *wanted)
    share, beyond = 0.0, np.hypot(*(reached - wanted))
    if p.build.soles and p.steps.walking and beyond > 0.0:
        share = min(w.beyond, w.max_beyond * height / beyond)
    p.demand.acceleration[:] = square * (m.centre[:2] - reached - share * (wanted - reached))


@kernel
def _along_cycle(p: WalkingRecord, pressure: Vector) -> Vector:
    """Centre of pressure that brings the divergent component ξ to its way in an endless walk.

    Over a step ξ runs away from the middle s of the stance feet, ξ(t) = s + b exp(ω t), with b as
    in :mod:`harpy_pin.gaits.walking.pendulum`. The centre of pressure that holds it there is s + (1
    + k) (ξ − ξ(t)). Between soles s goes from one to the other while both are down.
    Along the line between two point feet the one that the velocity asks for, ``pressure``, has the
    say.
    """
    m, s, soles, omega = p.measured, p.steps, p.build.soles, p.pace.omega
    landing, g = p.footholds.middle, (s.swings + 1) % 2
    jump = rotation_in_plane(p.planned.path[2]) @ (landing[s.swings] - landing[g])
    duration, passed, share = real_duration(p), s.phase * s.duration, 1.0
    growth, now = np.exp(omega * duration), np.exp(omega * s.duration * min(s.phase, 1.0))
    if soles:
        passed = min(passed, duration)
        if s.made > 0:  # the load goes over steadily, as if all at once half-way
            passed -= 0.5 * s.double_support * s.duration
            share = min(max(s.phase / s.double_support, 0.0), 1.0)
        now = np.exp(omega * passed)
    wanted = desired_after(p, max(1.0 - s.phase, 0.0) * s.duration if soles else 0.0)
    holds, place = np.where(p.pace.group == g, 1.0, 0.0), m.place[:, :2]
    number = np.sum(holds)
    middle = holds @ place / number
    before = (1.0 - holds) @ place / np.sum(1.0 - holds)
    first = np.argmax(holds)
    line = 2.0 * (place[first] - 0.5 * number * middle)
    about = before if passed < 0.0 and share < 1.0 else middle
    desired = about + now * (middle - about + cyclic_offset(wanted * duration, jump, growth))
    xi, gain = m.centre[:2] + m.drift / omega, 1.0 + p.tuned.cycle_gain
    at: Vector = middle + (1.0 - share) * (before - middle) + gain * (xi - desired)
    length = np.hypot(*line)
    if number > 1.0 and length > 0.0:
        line /= length
        at += (line @ (pressure - at)) * line
    return at
