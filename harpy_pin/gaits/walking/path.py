"""The velocity that is applied, the path, and the velocity that brings the centre of mass to it."""

from __future__ import annotations

import numpy as np

from harpy_pin.gaits.velocity import move_path, take_command
from harpy_pin.gaits.walking.pendulum import change_after, desired_after, wrapped
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.kernels import kernel


@kernel
def begin_path(p: WalkingRecord) -> None:
    """The path begins at rest, at the centre of mass."""
    u, m = p.planned, p.measured
    u.path[:] = *m.centre[:2], m.heading
    u.last_command[:] = 0.0
    u.velocity[:] = 0.0
    u.rate[:] = 0.0
    u.raised = u.refused = 0.0


@kernel
def follow_command(p: WalkingRecord, span: float) -> None:
    """The command, and velocity and path after the time ``span``."""
    u = p.planned
    take_command(u)
    u.goal[3] = min(max(u.last_command[3], u.height_range[0]), u.height_range[1])
    _steer(p, span)
    _keep_near(p)
    _choose_velocity(p)


@kernel
def _steer(p: WalkingRecord, span: float) -> None:
    """Applied velocity and path after the time ``span``: the velocity follows the goal at bounded
    acceleration.
    """
    u, velocity, most = p.planned, p.planned.velocity, p.planned.turn_acceleration * span
    # It stands until it has shifted its weight.
    share = 1.0 if p.steps.walking and p.steps.phase >= 0.0 else 0.0
    turn = min(max(share * u.goal[2] - velocity[2], -most), most)
    change = np.array([*change_after(p, share, span), turn])
    if span > 0.0:
        u.rate[:] = change / span
        most = p.tuned.height_speed * p.build.height
        velocity[3] = min(max((u.goal[3] - u.raised) / span, -most), most)
    u.raised += velocity[3] * span
    move_path(u.path, velocity[:3] + 0.5 * change, span)
    velocity[:3] += change


@kernel
def _keep_near(p: WalkingRecord) -> None:
    """Keep the path near the robot: what a push has moved for good is not walked back."""
    m, path = p.measured, p.planned.path
    way = path[:2] - m.centre[:2]
    size, most = np.hypot(*way), p.tuned.path_range * p.build.height
    if size > most:
        path[:2] = m.centre[:2] + most / size * way
    ahead = wrapped(path[2] - m.heading)
    if not p.pace.holds_heading:
        path[2] = m.heading
    elif abs(ahead) > p.tuned.heading_range:
        path[2] = m.heading + np.copysign(p.tuned.heading_range, ahead)


@kernel
def _choose_velocity(p: WalkingRecord) -> None:
    """Velocity of the centre of mass that is asked for: the applied one, and some of the way back
    to the path.
    """
    way = p.tuned.path_return * (p.planned.path[:2] - p.measured.centre[:2])
    size, most = np.hypot(*way), p.tuned.max_path_return * p.pace.omega * p.build.height
    p.planned.back[:] = (most / size if size > most else 1.0) * way
    p.planned.desired[:] = desired_after(p, 0.0)
