"""From a measured state: centre of mass, heading, and places and loads of the feet."""

from __future__ import annotations

import numpy as np

from harpy_pin.gaits.terrain_targets import fit_plane
from harpy_pin.gaits.walking.pendulum import wrapped
from harpy_pin.gaits.walking.record import MeasuredRecord, WalkingRecord
from harpy_pin.ground.surface import surface_height
from harpy_pin.kernels import kernel
from harpy_pin.model.entry import all_possible, all_possible_rows, is_unit
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import place_bodies
from harpy_pin.model.tree import TreeRecord
from harpy_pin.model.vectors import rotation_in_plane


@kernel
def measure(p: WalkingRecord, q: Vector, v: Vector, foot_force: Vector) -> bool:
    """Take up a configuration, a velocity and the forces (points, 3) on the feet; returns whether
    they were good.
    """
    m = p.measured
    if not (all_possible(q) and all_possible(v) and is_unit(q) and all_possible_rows(foot_force)):
        return False
    place_bodies(m.tree, q, v)
    if m.tree.loops.start.shape[0] > 0 and m.tree.loops.closed == 0:
        return False
    x, y, z, w = q[3], q[4], q[5], q[6]
    m.heading = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    if p.build.facing != 0.0:
        m.heading = wrapped(m.heading + p.build.facing)
    m.body[:3], m.body[3:] = q[:3], m.tree.rotation @ v[:3]
    _measure_centre(m.tree, m)
    if not p.terrain.level:
        above_ground(p)
    _measure_feet(p, m, foot_force)
    measure_drift(p)
    m.seen = 1
    return True


@kernel
def measure_drift(p: WalkingRecord) -> None:
    """The pendulum's velocity on the feet that are down, after everything else is measured."""
    m = p.measured
    _find_line(p, m)
    m.drift[:] = (
        m.centre[3:5]
        + np.array((m.spin[1], -m.spin[0])) / m.centre[2]
        - _held_turning(p, m) * m.line
    )


@kernel
def _find_line(p: WalkingRecord, m: MeasuredRecord) -> None:
    """Direction of the line of two stance feet of four or more."""
    held = np.where(p.steps.in_air == 0.0, 1.0, 0.0)
    first = np.argmax(held)
    line = 2.0 * m.place[first, :2] - held @ m.place[:, :2]
    length = np.hypot(*line)
    m.line[:] = 0.0
    if np.sum(held) == 2.0 and p.pace.group.shape[0] > 2 and length > 0.0:
        m.line[:] = line / length


@kernel
def _held_turning(p: WalkingRecord, m: MeasuredRecord) -> float:
    """Velocity of the pendulum along the line of the stance feet that is of the turning of the
    swing legs, m/s.
    """
    axes, total = rotation_in_plane(m.heading), 0.0
    line = axes.T @ m.line
    for k in range(p.pace.group.shape[0]):
        if p.steps.in_air[k] != 0.0:
            motion = np.array((*p.swing.motion[k, 1, :2], p.swing.lift[k, 1])) - m.body[3:6]
            velocity = np.array((*(axes.T @ motion[:2]), motion[2]))
            total += line @ (p.build.turning[k, :2] @ velocity)
    return float(total)


@kernel
def above_ground(p: WalkingRecord) -> None:
    """Heights of body and centre of mass above the plane that fits the ground around the body, and
    how they change.
    """
    m = p.measured
    m.ground, along, across = fit_plane(p.terrain, m.body[0], m.body[1], p.pace.ground_reach)
    m.body[2] -= m.ground
    m.centre[2] -= m.ground
    m.body[5] -= along * m.body[3] + across * m.body[4]
    m.centre[5] -= along * m.centre[3] + across * m.centre[4]


@kernel
def _measure_centre(t: TreeRecord, m: MeasuredRecord) -> None:
    """Place of the centre of mass, and momentum, after the bodies are placed."""
    place, velocity, spin = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(t.mass.shape[0]):
        _add_body(t, i, place, velocity, spin)
    total = np.sum(t.mass)
    spin -= np.cross(place, velocity) / total  # from the origin of the base to the centre of mass
    m.centre[:3] = m.body[:3] + t.rotation @ place / total
    m.centre[3:] = t.rotation @ velocity / total
    m.spin[:] = t.rotation @ spin / total


@kernel
def _add_body(t: TreeRecord, i: int, place: Vector, velocity: Vector, spin: Vector) -> None:
    """Add a body's mass times place, its momentum, and its angular momentum about the base's
    origin, base axes.
    """
    r, linear, angular = t.axes[i], t.twist[i, :3], t.twist[i, 3:]
    c = t.position[i] + r @ t.centre[i]
    w = linear + np.cross(angular, c)
    place += t.mass[i] * c
    velocity += t.mass[i] * w
    spin += t.mass[i] * np.cross(c, w) + r @ (t.inertia[i] @ (r.T @ angular))


@kernel
def _measure_feet(p: WalkingRecord, m: MeasuredRecord, foot_force: Vector) -> None:
    """Contact points, and of each foot its middle, heading and load."""
    t, b = m.tree, p.build
    feet = m.place.shape[0]
    share = feet / m.point.shape[0]
    m.place[:] = 0.0
    m.load *= 1.0 - p.tuned.load_filter
    for n in range(m.point.shape[0]):
        i, k = b.point_body[n], b.foot[n]
        m.point[n] = m.body[:3] + t.rotation @ (t.position[i] + t.axes[i] @ b.point_offset[n])
        if not p.terrain.level:
            m.point[n, 2] += m.ground - surface_height(p.terrain, m.point[n, 0], m.point[n, 1])
        m.place[k] += share * m.point[n]
        m.load[k] += p.tuned.load_filter * foot_force[n, 2]
    along, across = np.zeros(feet), np.zeros(feet)
    for n in range(m.point.shape[0]):
        k = b.foot[n]
        x, y = m.point[n, :2] - m.place[k, :2]
        along[k] += b.corner[n, 0] * x + b.corner[n, 1] * y
        across[k] += b.corner[n, 0] * y - b.corner[n, 1] * x
    m.turned[:] = np.where(feet < m.point.shape[0], np.arctan2(across, along), m.heading)


@kernel
def forget_load(m: MeasuredRecord, k: int) -> None:
    """The load of a foot that is lifted is of its stance: at few ticks a step it would look like a
    touchdown.
    """
    m.load[k] = 0.0
