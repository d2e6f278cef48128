"""The targets of body and feet, for the controller."""

from __future__ import annotations

import numpy as np

from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.gaits.walking.pendulum import hip_place
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.rolling import is_lifted, lift_corner, share_of_edge, tip
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane


@kernel
def write_targets(p: WalkingRecord, o: GaitTargetRecord) -> None:
    """The targets: the body where it is, with the demanded acceleration; its heading; the feet."""
    m, b, w, u = p.measured, p.build, p.tuned, p.planned
    o.body[:6] = m.body
    height, z, speed = b.height + u.raised + mean_felt(p), m.body[2], m.body[5]
    o.body[8] = w.height_gain * (height - z) + w.height_damping * (u.velocity[3] - speed)
    if b.soles:
        stretched, rate = _stretched_height(p), w.lowering_rate
        if stretched < height:
            o.body[8] = min(o.body[8], rate * (rate * (stretched - z) - 2.0 * speed))
    o.heading[:] = u.path[2] - b.facing, u.velocity[2], u.rate[2]
    if not p.pace.holds_heading:
        o.heading[1:] = 0.0
    o.centre_of_mass[0] = 1.0 if b.soles and p.terrain.level else 0.0
    o.body[6:8] = p.demand.acceleration
    if o.centre_of_mass[0] == 0.0 and p.pace.group.shape[0] != 2:
        o.body[6:8] = _body_acceleration(p)
    for n in range(b.foot.shape[0]):
        if p.steps.in_air[b.foot[n]] != 0.0:
            _write_swing(p, o, n)
        else:
            _write_stance(p, o, n)


@kernel
def _stretched_height(p: WalkingRecord) -> float:
    """Height of the body at which the first of the stance legs will be stretched, m."""
    m, b, least = p.measured, p.build, np.inf
    for k in range(p.pace.group.shape[0]):
        if p.steps.in_air[k] == 0.0:
            way = hip_place(p, k, p.tuned.stretch_ahead) - m.place[k, :2]
            square = max(float(b.reach**2 + b.hip**2 - way @ way), 0.25 * b.hip * b.hip)
            least = min(least, b.height - b.hip + m.place[k, 2] + np.sqrt(square))
    return float(least)


@kernel
def mean_felt(p: WalkingRecord) -> float:
    """Height of the ground that the feet have met, m."""
    return float(np.sum(p.steps.felt) / p.steps.felt.shape[0])


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
    b, held, axes = p.build, p.swing.held, rotation_in_plane(p.planned.path[2])
    rest, whole, line = axes.T @ p.demand.acceleration, np.eye(2), axes.T @ p.measured.line
    for k in range(p.pace.group.shape[0]):
        if p.steps.in_air[k] != 0.0:
            reaction = b.reaction[k, :2] - np.outer(line, line @ b.turning[k, :2])
            rest -= reaction @ np.array([*(axes.T @ held[k, :2]), held[k, 3]])
            whole -= reaction[:, :2]
    (xx, xy), (yx, yy) = whole[0], whole[1]
    minors = np.array([yy * rest[0] - xy * rest[1], xx * rest[1] - yx * rest[0]])
    body: Vector = axes @ minors / (xx * yy - xy * yx)  # by Cramer's rule
    return body


@kernel
def _write_swing(p: WalkingRecord, o: GaitTargetRecord, n: int) -> None:
    """A contact point of a swing foot."""
    k, s = p.build.foot[n], p.steps
    place, velocity = p.swing.motion[k, 0], p.swing.motion[k, 1]
    lift, held = p.swing.lift[k], p.swing.held[k]
    (x, y), turn, bend = rotation_in_plane(place[2]) @ p.build.corner[n], velocity[2], held[2]
    arm, across = np.array([x, y, 0.0]), np.array([-y, x, 0.0])
    o.foot_position[n] = np.array([*place[:2], lift[0]]) + arm
    o.foot_velocity[n] = np.array([*velocity[:2], lift[1]]) + turn * across
    o.foot_acceleration[n] = np.array([*held[:2], held[3]]) + bend * across - turn * turn * arm
    tip(p, o, n, place[2])
    o.foot_position[n] -= o.body[:3]
    o.foot_velocity[n] -= o.body[3:6]
    o.foot_acceleration[n] -= o.body[6:]
    done = (s.phase - s.double_support) / (1.0 - s.double_support)
    # From the middle of its swing on, whole-body controllers hold a loaded foot; here the gait says
    # when it has landed.
    o.stance[n], o.phase[n] = 0.0, min(max(done, 0.0), 0.5)


@kernel
def _write_stance(p: WalkingRecord, o: GaitTargetRecord, n: int) -> None:
    """A contact point of a stance foot: where it is; one that does not touch the ground is let
    down.
    """
    m, k = p.measured, p.build.foot[n]
    o.foot_position[n] = m.point[n] - o.body[:3]
    o.foot_velocity[n] = -o.body[3:6]
    o.foot_acceleration[n] = -o.body[6:]
    o.foot_velocity[n, 2] -= p.tuned.descent
    o.ground_height[n] = p.steps.touched[k]
    o.stance[n], o.phase[n], o.load[n] = 1.0, 0.5, _share_of_load(p, k) * share_of_edge(p, n)
    if is_lifted(p, n):
        lift_corner(p, o, n)


@kernel
def _share_of_load(p: WalkingRecord, k: int) -> float:
    """Share of its largest normal force up to which a foot may be loaded.

    It rises from its touchdown on, and falls before it is lifted, each over the time in which every
    foot is down.
    """
    s, w, gentle = p.steps, p.tuned, p.pace.gentle
    if not s.walking:
        return 1.0
    both = s.double_support * s.duration
    first, last = (w.first_load, w.last_load) if gentle else (w.least_load, w.least_load)
    share = max(s.load_ramp * s.since[k] / both, first) if s.since[k] < both else 1.0
    if p.pace.group[k] == s.swings and s.phase <= s.double_support:
        fall = max(s.phase / s.double_support, 0.0)
        if fall > 0.0:
            share = min(share, max(s.load_ramp * (1.0 - fall), last))
    return float(share)
