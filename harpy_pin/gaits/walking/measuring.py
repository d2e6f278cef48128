"""From a measured state: centre of mass, heading, and places and loads of the feet."""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.gaits.terrain_targets import fit_plane
from harpy_pin.gaits.walking.pendulum import wrapped
from harpy_pin.gaits.walking.record import MeasuredRecord, WalkingRecord
from harpy_pin.ground.surface import surface_height
from harpy_pin.model.entry import all_possible, all_possible_rows, is_unit
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import place_bodies
from harpy_pin.model.tree import TreeRecord

LOAD_SHARE = 0.5
"""Share of the last sample in the load of a foot: noise must not look like a touchdown."""


@kernel
def measure(p: WalkingRecord, q: Vector, v: Vector, foot_force: Vector) -> bool:
    """Take up a configuration, a velocity and the forces (points, 3) on the feet; returns whether they were good."""
    m = p.measured
    if not (all_possible(q) and all_possible(v) and is_unit(q) and all_possible_rows(foot_force)):
        return False
    place_bodies(p.tree, q, v)
    x, y, z, w = q[3], q[4], q[5], q[6]
    m.heading = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    if p.facing != 0.0:
        m.heading = wrapped(m.heading + p.facing)
    for i in range(3):
        m.body[i] = q[i]
        m.body[3 + i] = p.tree.rotation[i, 0] * v[0] + p.tree.rotation[i, 1] * v[1] + p.tree.rotation[i, 2] * v[2]
    _measure_centre(p.tree, m)
    if not p.terrain.level:
        above_ground(p)
    _measure_feet(p, m, foot_force)
    _find_line(p, m)
    held = _held_turning(p, m)
    m.drift[0] = m.centre[3] + m.spin[1] / m.centre[2] - held * m.line[0]
    m.drift[1] = m.centre[4] - m.spin[0] / m.centre[2] - held * m.line[1]
    m.seen = 1
    return True


@kernel
def _find_line(p: WalkingRecord, m: MeasuredRecord) -> None:
    """Direction of the line of two stance feet of four or more."""
    number = x = y = 0.0
    for k in range(p.group.shape[0]):
        if p.in_air[k] == 0.0:
            sign = 1.0 if number == 0.0 else -1.0
            x, y, number = x + sign * m.place[k, 0], y + sign * m.place[k, 1], number + 1.0
    length = np.hypot(x, y)
    m.line[:] = 0.0
    if number == 2.0 and p.group.shape[0] > 2 and length > 0.0:
        m.line[0], m.line[1] = x / length, y / length


@kernel
def _held_turning(p: WalkingRecord, m: MeasuredRecord) -> float:
    """Velocity of the pendulum along the line of the stance feet that is of the turning of the swing legs, m/s."""
    c, s, total = np.cos(m.heading), np.sin(m.heading), 0.0
    along, across = c * m.line[0] + s * m.line[1], c * m.line[1] - s * m.line[0]
    for k in range(p.group.shape[0]):
        if p.in_air[k] != 0.0:
            x, y, z = p.swing[k, 1, 0] - m.body[3], p.swing[k, 1, 1] - m.body[4], p.lift[k, 1] - m.body[5]
            x, y = c * x + s * y, c * y - s * x
            for i in range(2):
                r = p.turning[k, i]
                total += (along if i == 0 else across) * (r[0] * x + r[1] * y + r[2] * z)
    return total


@kernel
def above_ground(p: WalkingRecord) -> None:
    """Heights of body and centre of mass above the plane that fits the ground around the body, and how they change."""
    m = p.measured
    m.ground, along, across = fit_plane(p.terrain, m.body[0], m.body[1], p.ground_reach)
    m.body[2] -= m.ground
    m.centre[2] -= m.ground
    m.body[5] -= along * m.body[3] + across * m.body[4]
    m.centre[5] -= along * m.centre[3] + across * m.centre[4]


@kernel
def _measure_centre(t: TreeRecord, m: MeasuredRecord) -> None:
    """Place of the centre of mass, and momentum, after the bodies are placed."""
    place, velocity, spin = np.zeros(3), np.zeros(3), np.zeros(3)
    total = 0.0
    for i in range(t.mass.shape[0]):
        total += t.mass[i]
        _add_body(t, i, place, velocity, spin)
    for a in range(3):
        place[a], velocity[a] = place[a] / total, velocity[a] / total
    for a in range(3):  # from the origin of the base to the centre of mass
        b, c = (a + 1) % 3, (a + 2) % 3
        spin[a] -= total * (place[b] * velocity[c] - place[c] * velocity[b])
    for a in range(3):
        m.centre[a], m.centre[3 + a], m.spin[a] = m.body[a], 0.0, 0.0
        for b in range(3):
            m.centre[a] += t.rotation[a, b] * place[b]
            m.centre[3 + a] += t.rotation[a, b] * velocity[b]
            m.spin[a] += t.rotation[a, b] * spin[b] / total


@kernel
def _add_body(t: TreeRecord, i: int, place: Vector, velocity: Vector, spin: Vector) -> None:
    """Add a body's mass times place, its momentum, and its angular momentum about the base's origin, base axes."""
    r, own, s, mass = t.axes[i], t.inertia[i], t.twist[i], t.mass[i]
    u, w, turn = np.empty(3), np.empty(3), np.empty(3)
    for a in range(3):
        u[a] = t.position[i, a]
        turn[a] = 0.0
        for b in range(3):
            u[a] += r[a, b] * t.centre[i, b]
            turn[a] += r[b, a] * s[3 + b]
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        w[a] = s[a] + s[3 + b] * u[c] - s[3 + c] * u[b]
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        place[a] += mass * u[a]
        velocity[a] += mass * w[a]
        spin[a] += mass * (u[b] * w[c] - u[c] * w[b])
        for d in range(3):
            for e in range(3):
                spin[a] += r[a, d] * own[d, e] * turn[e]


@kernel
def _measure_feet(p: WalkingRecord, m: MeasuredRecord, foot_force: Vector) -> None:
    """Contact points, and of each foot its middle, heading and load."""
    t = p.tree
    inside = np.empty(3)
    feet = m.place.shape[0]
    share = feet / m.point.shape[0]
    m.place[:] = 0.0
    for k in range(feet):
        m.load[k] *= 1.0 - LOAD_SHARE
    for n in range(m.point.shape[0]):
        i, k = p.point_body[n], p.foot[n]
        for a in range(3):
            inside[a] = t.position[i, a]
            for b in range(3):
                inside[a] += t.axes[i, a, b] * p.point_offset[n, b]
        for a in range(3):
            m.point[n, a] = m.body[a]
            for b in range(3):
                m.point[n, a] += t.rotation[a, b] * inside[b]
            if a == 2 and not p.terrain.level:
                m.point[n, 2] += m.ground - surface_height(p.terrain, m.point[n, 0], m.point[n, 1])
            m.place[k, a] += share * m.point[n, a]
        m.load[k] += LOAD_SHARE * foot_force[n, 2]
    for k in range(feet):
        along = across = 0.0
        for n in range(m.point.shape[0]):
            if p.foot[n] == k:
                x, y = m.point[n, 0] - m.place[k, 0], m.point[n, 1] - m.place[k, 1]
                along += p.corner[n, 0] * x + p.corner[n, 1] * y
                across += p.corner[n, 0] * y - p.corner[n, 1] * x
        m.turned[k] = np.arctan2(across, along) if p.soles else m.heading
