"""The velocity command within its limits, and the path that follows it."""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.model.state import Vector

__all__: list[str] = []

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
def take_command(p: WalkingRecord) -> None:
    """The command as a goal, scaled down as a whole to what the legs can do."""
    c = p.command
    if np.isfinite(c[0] + c[1] + c[2] + c[3]):
        p.last_command[:] = p.command
    else:
        p.refused += 1.0
    c = p.last_command
    share, need = 1.0, foot_speed(p, c)
    if need > p.max_speed:
        share = p.max_speed / need
    if share * abs(c[1]) > p.most_aside:
        share = p.most_aside / abs(c[1])
    if share * abs(c[2]) > p.max_turn:
        share = p.max_turn / abs(c[2])
    bend = np.hypot(c[0], c[1]) * abs(c[2])
    if share * share * bend > p.acceleration:
        share = np.sqrt(p.acceleration / bend)
    for i in range(3):
        p.goal[i] = share * c[i]
    p.goal[3] = min(max(c[3], p.height_range[0]), p.height_range[1])


@kernel
def foot_speed(p: WalkingRecord, c: Vector) -> float:
    """Speed of the fastest place of a foot under a command, m/s."""
    radius = 0.0
    for k in range(p.nominal.shape[0]):
        radius = max(radius, np.hypot(p.nominal[k, 0], p.nominal[k, 1]))
    return float(np.hypot(c[0], c[1]) + abs(c[2]) * radius)


@kernel
def steer(p: WalkingRecord, span: float) -> None:
    """Applied velocity and path after the time ``span``: the velocity follows the goal at bounded acceleration."""
    u = p.velocity
    share = 1.0 if p.walking and p.phase >= 0.0 else 0.0  # it stands until it has shifted its weight
    dx, dy, dw = share * p.goal[0] - u[0], share * p.goal[1] - u[1], share * p.goal[2] - u[2]
    size, most = np.hypot(dx, dy), p.acceleration * span
    share = most / size if size > most else 1.0
    most = p.turn_acceleration * span
    dx, dy, dw = share * dx, share * dy, min(max(dw, -most), most)
    if span > 0.0:
        p.rate[0], p.rate[1], p.rate[2] = dx / span, dy / span, dw / span
        most = HEIGHT_SPEED * p.height
        u[3] = min(max((p.goal[3] - p.raised) / span, -most), most)
    p.raised += u[3] * span
    middle = p.path[2] + 0.5 * span * (u[2] + 0.5 * dw)
    c, s = np.cos(middle), np.sin(middle)
    forward, left = u[0] + 0.5 * dx, u[1] + 0.5 * dy
    p.path[0] += span * (c * forward - s * left)
    p.path[1] += span * (s * forward + c * left)
    p.path[2] += span * (u[2] + 0.5 * dw)
    u[0], u[1], u[2] = u[0] + dx, u[1] + dy, u[2] + dw
    _keep_near(p)


@kernel
def wrapped(angle: float) -> float:
    """The angle between −π and π, rad."""
    return float(angle - 2.0 * np.pi * np.floor(angle / (2.0 * np.pi) + 0.5))


@kernel
def _keep_near(p: WalkingRecord) -> None:
    """Keep the path near the robot: what a push has moved for good is not walked back."""
    m = p.measured
    x, y = p.path[0] - m.centre[0], p.path[1] - m.centre[1]
    size, most = np.hypot(x, y), PATH_RANGE * p.height
    if size > most:
        p.path[0] = m.centre[0] + most / size * x
        p.path[1] = m.centre[1] + most / size * y
    ahead = wrapped(p.path[2] - m.heading)
    if not p.holds_heading:
        p.path[2] = m.heading
    elif abs(ahead) > HEADING_RANGE:
        p.path[2] = m.heading + np.copysign(HEADING_RANGE, ahead)


@kernel
def choose_velocity(p: WalkingRecord) -> None:
    """Velocity of the centre of mass that is asked for: the applied one, and some of the way back to the path."""
    u, m = p.velocity, p.measured
    c, s = np.cos(p.path[2]), np.sin(p.path[2])
    x, y = RETURN * (p.path[0] - m.centre[0]), RETURN * (p.path[1] - m.centre[1])
    size, most = np.hypot(x, y), MAX_RETURN * p.omega * p.height
    share = most / size if size > most else 1.0
    p.desired[0] = c * u[0] - s * u[1] + share * x
    p.desired[1] = s * u[0] + c * u[1] + share * y
