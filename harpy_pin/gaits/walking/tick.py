"""A tick of the walk: from the measured state to the targets of body and feet."""

from __future__ import annotations

import numpy as np

from harpy_pin.gaits.gait import LONGEST, GaitTargetRecord
from harpy_pin.gaits.velocity import take_command
from harpy_pin.gaits.walking.body import demand_acceleration, write_targets
from harpy_pin.gaits.walking.contacts import go_on, time_left
from harpy_pin.gaits.walking.footholds import choose_footholds
from harpy_pin.gaits.walking.measuring import measure_drift
from harpy_pin.gaits.walking.pendulum import change_after, desired_after, wrapped
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.rolling import stay_flat
from harpy_pin.gaits.walking.swinging import swing_foot
from harpy_pin.kernels import kernel
from harpy_pin.model.vectors import rotation_in_plane

LONGEST_GAP = 0.05
"""Time that counts between two updates, at most, s."""
LONG_AGO = 1e3
"""Time since the last touchdown of a foot that has not yet swung, s."""
PATH_RANGE = 0.25
"""How far the path may be from the centre of mass, as a share of the body's height."""
HEADING_RANGE = 0.3
"""How far the path's heading may be from the body's, rad."""
RETURN = 2.0
"""Share of the distance to the path that is added to the desired velocity, 1/s."""
MAX_RETURN = 0.05
"""Largest velocity that is added, as a share of ω times the body's height."""
HEIGHT_SPEED = 0.5
"""Largest velocity of the height, as a share of the height, 1/s."""


@kernel
def advance(t: float, p: WalkingRecord, target: GaitTargetRecord) -> bool:
    """All targets at the time t, from the state that was measured last.

    Time zero, or one that is more than a step before the last, begins the walk anew; one that is
    less before it counts as the last. Returns False, with nothing done, where t is no time or the
    next row of the script begins before it.
    """
    if not (abs(t) < LONGEST and t < p.switch):
        return False
    if t <= 0.0 or p.time < 0.0 or t < p.time - p.usual_step:
        begin_walk(p)
        p.time = t
    span = t - p.time
    p.time = max(t, p.time)
    walk_on(p, target, span)
    return True


@kernel
def walk_on(p: WalkingRecord, target: GaitTargetRecord, elapsed: float) -> None:
    """All targets, after a time since the last ones, s."""
    span = min(max(elapsed, 0.0), LONGEST_GAP)
    take_command(p)
    p.goal[3] = min(max(p.last_command[3], p.height_range[0]), p.height_range[1])
    _steer(p, span)
    _choose_velocity(p)
    go_on(p, span)
    demand_acceleration(p)
    if p.walking:
        left = time_left(p)
        choose_footholds(p, left)
        for k in range(p.group.shape[0]):
            if p.in_air[k] != 0.0:
                swing_foot(p, k, left if p.group[k] == p.swings else 0.0, span)
    write_targets(p, target)


@kernel
def begin_walk(p: WalkingRecord) -> None:
    """Stand where the robot is, on all feet."""
    m = p.measured
    p.path[:] = *m.centre[:2], m.heading
    p.last_command[:] = 0.0
    p.velocity[:] = 0.0
    p.rate[:] = 0.0
    p.raised = p.refused = p.phase = 0.0
    p.walking = p.steps = p.swings = 0
    p.in_air[:] = 0.0
    measure_drift(p)  # it was measured on the feet that were down in the walk before
    p.felt[:] = 0.0
    stay_flat(p)
    p.touched[:] = 0.0
    p.settled[:] = 1.0
    p.since[:] = LONG_AGO


@kernel
def _steer(p: WalkingRecord, span: float) -> None:
    """Applied velocity and path after the time ``span``: the velocity follows the goal at bounded
    acceleration.
    """
    u, most = p.velocity, p.turn_acceleration * span
    share = (
        1.0 if p.walking and p.phase >= 0.0 else 0.0
    )  # it stands until it has shifted its weight
    change = np.array(
        [*change_after(p, share, span), min(max(share * p.goal[2] - u[2], -most), most)]
    )
    if span > 0.0:
        p.rate[:] = change / span
        most = HEIGHT_SPEED * p.height
        u[3] = min(max((p.goal[3] - p.raised) / span, -most), most)
    p.raised += u[3] * span
    mean = u[:3] + 0.5 * change
    p.path[:2] += span * (rotation_in_plane(p.path[2] + 0.5 * span * mean[2]) @ mean[:2])
    p.path[2] += span * mean[2]
    u[:3] += change
    _keep_near(p)


@kernel
def _keep_near(p: WalkingRecord) -> None:
    """Keep the path near the robot: what a push has moved for good is not walked back."""
    m = p.measured
    way = p.path[:2] - m.centre[:2]
    size, most = np.hypot(*way), PATH_RANGE * p.height
    if size > most:
        p.path[:2] = m.centre[:2] + most / size * way
    ahead = wrapped(p.path[2] - m.heading)
    if not p.holds_heading:
        p.path[2] = m.heading
    elif abs(ahead) > HEADING_RANGE:
        p.path[2] = m.heading + np.copysign(HEADING_RANGE, ahead)


@kernel
def _choose_velocity(p: WalkingRecord) -> None:
    """Velocity of the centre of mass that is asked for: the applied one, and some of the way back
    to the path.
    """
    way = RETURN * (p.path[:2] - p.measured.centre[:2])
    size, most = np.hypot(*way), MAX_RETURN * p.omega * p.height
    p.back[:] = (most / size if size > most else 1.0) * way
    p.desired[:] = desired_after(p, 0.0)
