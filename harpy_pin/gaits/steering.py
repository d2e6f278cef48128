"""Kernels of the commanded gait: the command's limits, the path of the body, footholds, and the
targets.

The path is where the body would be without its sway: a place and a heading ψ. The applied velocity
u = (forward, sideways, turning) follows the command at bounded accelerations, and the path follows
u. The phase φ counts steps, as in :mod:`harpy_pin.gaits.straight`; it stands still while the robot
stands.

A swing foot follows, along each horizontal axis, the cubic that leads from its present place and
velocity to its foothold, at rest there, in the remaining time. Where the foothold moves, place and
velocity go on without a jump.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.gaits.gait import LONGEST, GaitTargetRecord
from harpy_pin.gaits.straight import support, world_frame_blend
from harpy_pin.gaits.terrain_targets import nearest_steppable
from harpy_pin.gaits.velocity import LONGEST_GAP, is_still, move_path, take_command
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane

if TYPE_CHECKING:
    from harpy_pin.gaits.commanded import CommandedRecord

FINEST = 5e-3
"""Longest time that is stepped at once, s: longer ones are divided."""
AHEAD = 8
"""Parts in which the path to the next stance is predicted."""


@kernel
def restart(p: CommandedRecord) -> None:
    """Stand at the origin, facing x, at time zero."""
    p.time = p.goal[:] = p.velocity[:] = p.rate[:] = p.path[:] = 0.0
    p.phase = 0.5 * p.double_support
    p.walking = p.begun = p.refused = p.last_command[:] = p.leftover[:] = p.in_air[:] = 0.0
    p.foot_velocity[:] = 0.0
    p.foot[:] = np.array([[0.0, p.width], [0.0, -p.width]])
    p.foothold[:] = p.foot


@kernel
def advance(t: float, p: CommandedRecord, target: GaitTargetRecord) -> bool:
    """Go on to time t, before the next row of the script begins, and write the targets. A time that
    is less than a step before the last counts as the last.

    Returns:
        Whether t is such a time; nothing is done otherwise.
    """
    span = max(t - p.time, 0.0)
    anew = t < p.time and (t <= 0.0 or t < p.time - p.step_duration)
    if anew or not (abs(t) < LONGEST and span <= LONGEST_GAP and t < p.switch):
        return False
    take_command(p)
    parts = int(np.ceil(span / FINEST - 1e-6))
    for _ in range(parts):
        _step(p, span / parts)
    p.time = max(t, p.time)
    _write(p, target)
    return True


@kernel
def _steer(p: CommandedRecord, velocity: Vector, step: float) -> Vector:
    """The velocity after a time, on its way to the goal at bounded acceleration."""
    change = p.goal[:3] - velocity
    size, most, most_turn = np.hypot(*change[:2]), p.acceleration * step, p.turn_acceleration * step
    if size > most:
        change[:2] *= most / size
    change[2] = min(max(change[2], -most_turn), most_turn)
    return velocity + change


@kernel
def _toward(
    place: float, velocity: float, goal: float, left: float, step: float
) -> tuple[float, float]:
    """Place and velocity after a time on the cubic that ends at rest at the goal when the time left
    is over.
    """
    if step >= left:
        return goal, 0.0
    s, way, glide = step / left, goal - place, velocity * left
    square, cube = 3.0 * way - 2.0 * glide, glide - 2.0 * way
    place += s * (glide + s * (square + s * cube))
    return place, velocity + s * (2.0 * square + 3.0 * s * cube) / left


@kernel
def _step(p: CommandedRecord, step: float) -> None:
    """One short time step of the whole state."""
    u, rest = p.velocity, p.leftover
    new = _steer(p, u, step)
    move_path(p.path, 0.5 * (u + new), step)
    p.rate[:] = (new - u) / step
    u[:] = new
    rest[:2] = _toward(rest[0], rest[1], 0.0, rest[2], step)
    rest[2] = max(rest[2] - step, 0.0)
    if p.walking == 0.0:
        if is_still(p):
            return
        p.walking, p.begun = 1.0, 0.0
    p.begun = min(p.begun + step / p.step_duration, 1.0)
    before = p.phase
    p.phase += step / p.step_duration
    stop = np.floor(before) + 0.5 * p.double_support
    if before < stop <= p.phase and is_still(p) and _feet_settled(p):
        p.phase = stop
        place, speed, _ = _sway(p)
        rest[:] = place, speed, p.step_duration
        p.walking = p.begun = 0.0
    if p.phase >= 2.0:
        p.phase -= 2.0
    for k in range(2):
        _follow(p, k)


@kernel
def _feet_settled(p: CommandedRecord) -> bool:
    """Whether both feet are to the sides of the body, where they stand."""
    left = rotation_in_plane(p.path[2])[:, 1]
    for k in range(2):
        place = p.path[:2] + p.width * (1.0 - 2.0 * k) * left
        if not p.terrain.level:
            place[:] = nearest_steppable(p.terrain, *place, *p.foot[k])
        if np.hypot(*(p.foot[k] - place)) > p.settled:
            return False
    return True


@kernel
def _support(p: CommandedRecord, k: int) -> tuple[bool, float]:
    """Whether foot k is on the ground, and the share of its stance or swing that it has done."""
    step = np.floor(p.phase)
    return support(step % 2.0 == k, p.phase - step, p.double_support)


@kernel
def _follow(p: CommandedRecord, k: int) -> None:
    """Bring foot k to where it is at the present phase."""
    on_ground, done = _support(p, k)
    foot, velocity, hold = p.foot[k], p.foot_velocity[k], p.foothold[k]
    if on_ground:
        if p.in_air[k] != 0.0:
            p.in_air[k] = 0.0
            foot[:], velocity[:] = hold, 0.0
        return
    swing = p.step_duration * (1.0 - p.double_support)
    if p.in_air[k] == 0.0:
        p.in_air[k] = 1.0
        p.left[k] = swing
    now = swing * (1.0 - done)
    if done < p.frozen:
        _plan(p, k, now)
    for i in range(2):
        foot[i], velocity[i] = _toward(foot[i], velocity[i], hold[i], p.left[k], p.left[k] - now)
    p.left[k] = now


@kernel
def _plan(p: CommandedRecord, k: int, left: float) -> None:
    """Foothold of foot k, which lands after the time left: beside the path at the middle of its
    next stance.
    """
    step = (left + 0.5 * p.step_duration * (1.0 + p.double_support)) / AHEAD
    path, velocity = np.array(p.path), np.array(p.velocity)
    for _ in range(AHEAD):
        new = _steer(p, velocity, step)
        move_path(path, 0.5 * (velocity + new), step)
        velocity[:] = new
    away = (1.0 - 2.0 * k) * rotation_in_plane(path[2])[:, 1]  # from the path, on this foot's side
    place = path[:2] + p.width * away
    gap = (place - p.foot[1 - k]) @ away
    if gap < p.feet_apart:
        place += (p.feet_apart - gap) * away
    if not p.terrain.level:
        place[:] = nearest_steppable(p.terrain, *place, *p.foothold[k])
    p.foothold[k] = place


@kernel
def _sway(p: CommandedRecord) -> tuple[float, float, float]:
    """The body's place beside the path, towards its left, with velocity and acceleration.

    A walk begins with no sway, which grows over one step. What is left of it when the walk ends
    goes in one step, too.
    """
    duration, b = p.step_duration, p.begun
    rate = np.pi / duration
    sine, cosine = p.sway * np.sin(np.pi * p.phase), p.sway * np.cos(np.pi * p.phase)
    grown = b * b * (3.0 - 2.0 * b)
    growth, change = 6.0 * b * (1.0 - b) / duration, (6.0 - 12.0 * b) / (duration * duration)
    if p.walking == 0.0 or b >= 1.0:
        growth = change = 0.0
    place, velocity = grown * sine, growth * sine + grown * rate * cosine
    acceleration = change * sine + 2.0 * growth * rate * cosine - grown * rate * rate * sine
    rest = p.leftover
    if rest[2] > 0.0:
        place += rest[0]
        velocity += rest[1]
        acceleration -= (6.0 * rest[0] / rest[2] + 4.0 * rest[1]) / rest[2]
    return place, velocity, acceleration


@kernel
def _write(p: CommandedRecord, o: GaitTargetRecord) -> None:
    """The targets at the present state."""
    u, du, turn, axes = p.velocity, p.rate, p.velocity[2], rotation_in_plane(p.path[2])
    place, speed, change = _sway(p)
    # Along the heading and to its left; the frame turns.
    velocity = np.array([u[0] - turn * place, u[1] + speed])
    ahead = du[0] - turn * (u[1] + 2.0 * speed) - du[2] * place
    aside = du[1] + turn * u[0] + change - turn * turn * place
    o.body[:3] = *(p.path[:2] + place * axes[:, 1]), p.height
    o.body[3:6] = *(axes @ velocity), 0.0
    o.body[6:] = *(axes @ np.array([ahead, aside])), 0.0
    o.heading[:] = p.path[2], turn, du[2]
    for k in range(2):
        _write_foot(p, k, o)


@kernel
def _write_foot(p: CommandedRecord, k: int, o: GaitTargetRecord) -> None:
    """Targets of foot k, relative to the body's."""
    on_ground, done = _support(p, k)
    position, velocity, acceleration = (
        o.foot_position[k],
        o.foot_velocity[k],
        o.foot_acceleration[k],
    )
    position[:2] = p.foot[k] - o.body[:2]
    velocity[:2] = p.foot_velocity[k] - o.body[3:5]
    acceleration[:2] = -o.body[6:8]
    left = 1.0 - done
    o.stance[k], o.phase[k] = (1.0 if on_ground else 0.0), done
    o.world_frame_blend[k] = world_frame_blend(on_ground, done, p.settle, p.release)
    if on_ground:
        duration = p.step_duration * (1.0 + p.double_support)
        height = -p.penetration_offset * (1.0 - left**4 - done**4)
        rise = -4.0 * p.penetration_offset * (left**3 - done**3) / duration * p.walking
        bend = (
            12.0
            * p.penetration_offset
            * (left * left + done * done)
            / (duration * duration)
            * p.walking
        )
    else:
        duration = p.step_duration * (1.0 - p.double_support)
        height = 16.0 * p.clearance * (done * left) ** 2
        rise = 32.0 * p.clearance * done * left * (left - done) / duration
        bend = 32.0 * p.clearance * (1.0 - 6.0 * done * left) / (duration * duration)
        if p.left[k] > 1e-6:
            way = p.foothold[k] - p.foot[k]
            acceleration[:2] += (6.0 * way / p.left[k] - 4.0 * p.foot_velocity[k]) / p.left[k]
    position[2], velocity[2], acceleration[2] = height - p.height, rise, bend
