"""Rigid-body terms in one compiled pass over the tree: kinematics, bias forces (RNEA), mass matrix
(CRBA) and points.

The recursions are Featherstone's (Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6), with
every motion and force expressed in the axes of the base and at its origin. So composite inertias
add without being transformed, the columns of the base need no arithmetic, and nothing loses digits
far from the world's origin. Pinocchio has the same algorithms; at this size they cost less than the
calls from Python to them do, which is why they stand here too. Tests compare the two.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import diagonal, kernel
from harpy_pin.model.closure import (
    accelerate_loops,
    close_loops,
    follow_loops,
    reduce_force,
    reduce_mass,
)
from harpy_pin.model.placing import accelerated, place_body
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import UNBOUNDED, TreeRecord
from harpy_pin.model.vectors import (
    SMALL_ANGLE,
    force_cross,
    quaternion_product,
    rotate,
    rotation_matrix,
    skew,
)

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord

GOOD, BAD, MISFIT = 0, 1, 2
"""What a kernel says of its arguments: fine, a bad sample, of the wrong size."""
MAX_SAMPLE = 1e6
"""Largest number of a good sample, in m, rad, m/s, rad/s, N or N·m: far beyond what any robot can
be or do.
"""
SAME_FORCE = 1e-6
"""Largest difference between the force that is commanded of a rotor and the one it has that counts
as none, relative to 1 N + the command.
"""


@kernel
def place_bodies(t: TreeRecord, q: Vector, v: Vector) -> None:
    """Placement and velocity of every body."""
    body_rotation(q, t.rotation)
    t.twist[0] = v[:6]
    if t.loops.start.shape[0] > 0:  # known when compiling: a robot without loops pays nothing
        close_loops(t, q, v)
        return
    for i in range(1, t.parent.shape[0]):
        place_body(t, q, i)
        t.twist[i] = t.twist[t.parent[i]] + v[t.column[i]] * t.screw[i]


@kernel
def joint_space_terms(t: TreeRecord, v: Vector, mass_matrix: Vector, bias: Vector) -> None:
    """Mass matrix and bias forces, after :func:`place_bodies`.

    Entries of the mass matrix of joints on different branches are left as they are, zero.
    """
    t.drift[0, :3], t.drift[0, 3:] = -(t.rotation.T @ t.gravity), 0.0
    c = t.loops
    if c.start.shape[0] > 0:
        _tree_terms(t, c.v, c.mass_matrix, c.bias)
        follow_loops(t)
        reduce_mass(t, mass_matrix)
        reduce_force(t, bias)
    else:
        _tree_terms(t, v, mass_matrix, bias)


@kernel
def _tree_terms(t: TreeRecord, v: Vector, mass_matrix: Vector, bias: Vector) -> None:
    """Mass matrix and bias forces of the tree."""
    bodies = t.parent.shape[0]
    for i in range(bodies):
        if i > 0:
            t.drift[i] = accelerated(t, i, v[t.column[i]])
        _weigh(t, i)
    for i in range(bodies - 1, 0, -1):
        _joint_terms(t, i, mass_matrix, bias)
        p = t.parent[i]
        t.force[p] += t.force[i]
        t.moment[p] += t.moment[i]
        t.composite[p] += t.composite[i]
    _base_terms(t, mass_matrix, bias)


@kernel
def inverse_dynamics(t: TreeRecord, v: Vector, acceleration: Vector, out: Vector) -> None:
    """Forces M a + n (nv,) of an acceleration (nv,), by one pass out and one back, without M.

    After :func:`place_bodies`; ``t.drift`` becomes the acceleration of every body, less gravity.
    """
    c = t.loops
    if c.start.shape[0] > 0:
        accelerate_loops(t, acceleration)
        _tree_forces(t, c.v, c.acceleration, c.bias)
        reduce_force(t, out)
    else:
        _tree_forces(t, v, acceleration, out)


@kernel
def _tree_forces(t: TreeRecord, v: Vector, acceleration: Vector, out: Vector) -> None:
    """Forces (nv,) of an acceleration (nv,) of the tree."""
    bodies = t.parent.shape[0]
    t.drift[0, :3] = acceleration[:3] - t.rotation.T @ t.gravity
    t.drift[0, 3:] = acceleration[3:6]
    for i in range(bodies):
        if i > 0:
            n = t.column[i]
            t.drift[i] = accelerated(t, i, v[n]) + acceleration[n] * t.screw[i]
        _weigh(t, i)
    for i in range(bodies - 1, 0, -1):
        out[t.column[i]] = t.screw[i] @ t.force[i]
        t.force[t.parent[i]] += t.force[i]
    out[:6] = t.force[0]
    out += t.armature * acceleration


@kernel
def _force_of(t: TreeRecord, i: int, s: Vector) -> Vector:
    """Inertia of the subtree of a body times a motion s (6,)."""
    mass, h = t.moment[i, 0], t.moment[i, 1:]
    turning = t.composite[i] @ s[3:] + np.cross(h, s[:3])
    return np.array([*(mass * s[:3] - np.cross(h, s[3:])), *turning])


@kernel
def _weigh(t: TreeRecord, i: int) -> None:
    """Inertia of a body about the base's origin, and the force that its drift needs."""
    r, mass, u = t.axes[i], t.mass[i], t.twist[i]
    c = t.position[i] + r @ t.centre[i]
    h = mass * c
    t.moment[i, 0], t.moment[i, 1:] = mass, h
    t.composite[i] = r @ t.inertia[i] @ r.T + (h @ c) * np.eye(3) - np.outer(h, c)
    t.force[i] = _force_of(t, i, t.drift[i]) + force_cross(u, _force_of(t, i, u))


@kernel
def _joint_terms(t: TreeRecord, i: int, mass_matrix: Vector, bias: Vector) -> None:
    """One joint's bias force, and its row and column of the mass matrix."""
    s, column = t.screw[i], t.column[i]
    force = _force_of(t, i, s)  # for unit acceleration of the joint
    bias[column] = s @ t.force[i]
    k = i
    while k > 0:
        entry = t.screw[k] @ force
        mass_matrix[column, t.column[k]] = entry
        mass_matrix[t.column[k], column] = entry
        k = t.parent[k]
    mass_matrix[column, column] += t.armature[column]
    mass_matrix[:6, column] = force
    mass_matrix[column, :6] = force


@kernel
def _base_terms(t: TreeRecord, mass_matrix: Vector, bias: Vector) -> None:
    """The base's bias force and block of the mass matrix: the inertia of all bodies together."""
    m, h, inertia = mass_matrix, skew(t.moment[0, 1:]), t.composite[0]
    bias[:6] = t.force[0]
    m[:3, :3], m[:3, 3:6] = t.moment[0, 0] * np.eye(3), h.T
    m[3:6, :3], m[3:6, 3:6] = h, 0.5 * (inertia + inertia.T)  # symmetric to the last bit
    diagonal(m)[:6] += t.armature[:6]


@kernel
def point_terms(d: DynamicsRecord, q: Vector) -> None:
    """Positions, velocities, drifts and Jacobians of feet, thruster mounts and rotors, after
    :func:`place_bodies`.
    """
    t, feet = d.tree, d.foot_position.shape[0]
    free = d.body.shape[0] - feet - d.rotor_axis.shape[0]
    for k in range(d.body.shape[0]):
        i = d.body[k]
        p = t.position[i] + t.axes[i] @ d.offset[k]
        if feet > 0 and k < feet:  # of no feet there is no kernel
            _motion(d, q, k, i, p)
            _jacobian(t, i, p, d.foot_jacobian[3 * k : 3 * k + 3])
        elif k < feet + free:
            _jacobian(t, i, p, d.thruster_jacobian[3 * (k - feet) : 3 * (k - feet) + 3])
        else:
            n = k - feet - free
            _rotor(d, n, i, p, d.thruster_jacobian[3 * free + n])


@kernel
def _motion(d: DynamicsRecord, q: Vector, k: int, i: int, p: Vector) -> None:
    """Position, velocity and drift of a foot at p of the base axes."""
    r, u, a = d.tree.rotation, d.tree.twist[i], d.tree.drift[i]
    velocity = u[:3] + np.cross(u[3:], p)
    drift = a[:3] + np.cross(a[3:], p) + np.cross(u[3:], velocity)
    d.foot_position[k] = q[:3] + r @ p
    d.foot_velocity[k] = r @ velocity
    d.foot_drift[3 * k : 3 * k + 3] = r @ drift + d.tree.gravity


@kernel
def _jacobian(t: TreeRecord, i: int, p: Vector, out: Vector) -> None:
    """Linear Jacobian, world axes, of a point of body i; columns of joints beyond it stay as they
    are.
    """
    r = t.rotation
    if t.loops.start.shape[0] > 0:
        out[:, 6:] = 0.0
    while t.parent.shape[0] > 1 and i > 0:  # a compiler sees that a single body has none above it
        s = t.screw[i]
        column = r @ (s[:3] + np.cross(s[3:], p))
        if t.loops.start.shape[0] == 0:
            out[:, t.column[i]] = column
        elif t.column[i] < out.shape[1]:
            out[:, t.column[i]] += column
        else:
            out[:, 6:] += np.outer(column, t.loops.spread[t.column[i] - 6])
        i = t.parent[i]
    out[:, :3], out[:, 3:6] = r, r @ skew(p).T


@kernel
def unit_motion(t: TreeRecord, i: int, column: int) -> Vector:
    """Motion (6,) of body i for unit velocity of a joint of this column, which may move it, linear
    at the base's origin and angular, base axes.
    """
    motion = np.zeros(6)
    if t.loops.start.shape[0] > 0:
        while i > 0:
            motion += t.loops.spread[t.column[i] - 6, column - 6] * t.screw[i]
            i = t.parent[i]
    else:
        motion[:] = t.screw[column - 5]
    return motion


@kernel
def _rotor(d: DynamicsRecord, n: int, i: int, p: Vector, out: Vector) -> None:
    """Axis in the world of rotor n of body i, and its row of the Jacobian; columns as in
    :func:`_jacobian`.
    """
    t = d.tree
    axis = t.axes[i] @ d.body_axis[n]
    d.rotor_axis[n] = t.rotation @ axis
    # The wrench of a unit thrust at the base's origin, base axes: what a joint does of it follows
    # from its screw.
    moment = np.cross(p, axis) + d.drag[n] * axis
    if t.loops.start.shape[0] > 0:
        out[6:] = 0.0
    while t.parent.shape[0] > 1 and i > 0:  # a compiler sees that a single body has none above it
        s = t.screw[i]
        share = axis @ s[:3] + moment @ s[3:]
        if t.loops.start.shape[0] > 0:
            out[6:] += share * t.loops.spread[t.column[i] - 6]
        else:
            out[t.column[i]] = share
        i = t.parent[i]
    out[:3], out[3:6] = axis, moment


@kernel
def integrate(t: TreeRecord, q: Vector, displacement: Vector) -> None:
    """Move q by velocity times time, in place, as Pinocchio's ``integrate``: the base along a
    screw.
    """
    _move_base(q, displacement)
    if t.loops.start.shape[0] > 0:  # then joints do not turn without bounds
        q[7:] += displacement[6:]
        return
    for i in range(1, t.parent.shape[0]):
        place, step = t.place[i], displacement[t.column[i]]
        if t.kind[i] == UNBOUNDED:
            c, s = np.cos(step), np.sin(step)
            turned = np.array([[c, -s], [s, c]]) @ q[place : place + 2]
            q[place : place + 2] = turned / np.sqrt(turned @ turned)
        else:
            q[place] += step


@kernel
def joint_angles(q: Vector, place: NDArray[np.int64], unbounded: NDArray[np.int64]) -> Vector:
    """Angles of joints, rad, by where each begins in q; an unbounded one has cosine and sine."""
    first = q[place]
    return np.where(unbounded != 0, np.arctan2(q[place + unbounded], first), first)


@kernel
def set_joint_angles(
    q: Vector, place: NDArray[np.int64], unbounded: NDArray[np.int64], angle: Vector
) -> None:
    """The other way round than :func:`joint_angles`."""
    q[place] = np.where(unbounded != 0, np.cos(angle), angle)
    q[place + unbounded] = np.where(unbounded != 0, np.sin(angle), angle)


@kernel
def _move_base(q: Vector, d: Vector) -> None:
    """Placement of the base after a screw of linear part d[:3] and angular part d[3:6]."""
    w = d[3:6]
    square = w @ w
    angle = np.sqrt(square)
    if angle < SMALL_ANGLE:
        half, cosine = 0.5 - square / 48.0, 1.0 - square / 8.0  # sin(φ/2)/φ and cos(φ/2)
        b, c = 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0  # (1 − cos φ)/φ² and (φ − sin φ)/φ³
    else:
        half, cosine = np.sin(0.5 * angle) / angle, np.cos(0.5 * angle)
        b = 2.0 * half * half
        c = (angle - np.sin(angle)) / (square * angle)
    u = np.cross(w, d[:3])
    q[:3] += rotate(
        q[3:7], d[:3] + b * u + c * np.cross(w, u)
    )  # p ← p + R V d, V = 1 + b [w] + c [w]²
    if cosine < 0.0:  # of the two quaternions of one rotation, the one nearer to the last
        half, cosine = -half, -cosine
    turned = quaternion_product(q[3:7], np.array([*(half * w), cosine]))
    q[3:7] = turned / np.sqrt(turned @ turned)


@kernel
def update_terms(d: DynamicsRecord, q: Vector, v: Vector) -> int:
    """Every term at a state, on an element of the record.

    Returns:
        ``GOOD``; ``BAD`` for a state that no robot can have, see
        :attr:`harpy_pin.model.dynamics.Dynamics.finite`; ``MISFIT``, with nothing done, for arrays
        of wrong sizes.
    """
    t = d.tree
    if q.shape[0] != v.shape[0] + t.unbounded + 1 or v.shape[0] != d.bias.shape[0]:
        return MISFIT
    place_bodies(t, q, v)
    joint_space_terms(t, v, d.mass_matrix, d.bias)
    point_terms(d, q)
    good = all_possible(q) and all_possible(v) and is_unit(q) and all_finite(d.bias)
    if t.loops.start.shape[0] > 0:
        good = good and t.loops.closed != 0
    return GOOD if good else BAD


@kernel(
    position=("n", 3),
    desired=("n", 3),
    jacobian=("3n", "m"),
    drift=("3n",),
    rows=("6+", "m"),
    value=("6+",),
)
def flat_foot_rows(
    jacobian: Vector, drift: Vector, desired: Vector, position: Vector, rows: Vector, value: Vector
) -> None:
    """Six rows that hold a flat foot as a rigid body: ``rows`` (6, nv) a = ``value`` (6,), both
    out.

    Of the accelerations α (n, 3) desired of its corners they are the rigid motion nearest to them:
    mean and first moment about the middle of the corners, Σ (J_i a + J̇_i v − α_i) = 0 and Σ ρ_i ×
    (J_i a + J̇_i v − α_i) / s = 0. Jacobian, drift J̇ v and positions are those of the corners, in
    world axes.
    """
    n, size = position.shape[0], 0.0
    middle = np.sum(position, axis=0) / n
    rows[:6] = value[:6] = 0.0
    for i in range(n):
        arm, part = position[i] - middle, jacobian[3 * i : 3 * i + 3]
        rest = desired[i] - drift[3 * i : 3 * i + 3]
        size += arm @ arm
        rows[:3] += part
        rows[3:6] += skew(arm) @ part
        value[:3] += rest
        value[3:6] += np.cross(arm, rest)
    rows[:3] /= np.sqrt(n)
    value[:3] /= np.sqrt(n)
    rows[3:6] /= np.sqrt(size)
    value[3:6] /= np.sqrt(size)


@kernel
def read_thrusts(d: DynamicsRecord, force: Vector, out: Vector) -> int:
    """The thrust variables of commanded forces (thrusters, 3), world axes, N, into ``out``.

    That of a rotor is its force's part along the axis, within the limits. Returns how many rotors
    do not have the force that was commanded: it was not along their axis, or beyond their limits.
    """
    rotors = d.rotor_axis.shape[0]
    free = force.shape[0] - rotors
    out[: 3 * free].reshape((free, 3))[:] = force[:free]
    f, axis = force[free : free + rotors, :3], d.rotor_axis
    u = np.clip(np.sum(f * axis, axis=1), d.rotor_lower, d.rotor_upper)
    out[3 * free : 3 * free + rotors] = u
    error, size = np.max(abs(f - u[:, None] * axis), axis=1), np.max(abs(f), axis=1)
    return int(np.sum(error > SAME_FORCE * (1.0 + size)))


@kernel
def write_thrusts(d: DynamicsRecord, variables: Vector, out: Vector) -> None:
    """The forces (thrusters, 3) of thrust variables; the other way round than
    :func:`read_thrusts`.
    """
    rotors = d.rotor_axis.shape[0]
    free = out.shape[0] - rotors
    out[:free] = variables[: 3 * free].reshape((free, 3))
    out[free:] = variables[3 * free : 3 * free + rotors, None] * d.rotor_axis


@kernel(array=("n",))
def all_finite(array: Vector) -> bool:
    """Whether all entries of a vector are finite numbers."""
    return bool(np.all(abs(array) < np.inf))


@kernel(array=("n",))
def all_possible(array: Vector) -> bool:
    """Whether all entries of a vector are numbers within ``MAX_SAMPLE``; a count, with which ticks
    take less time than with ``np.all``.
    """
    bad = 0
    for i in range(array.shape[0]):
        bad += not abs(array[i]) <= MAX_SAMPLE
    return bad == 0


@kernel(array=("n", 3))
def all_possible_rows(array: Vector) -> bool:
    """Whether all entries of a matrix of three columns are numbers within ``MAX_SAMPLE``."""
    return all_possible(array.reshape((array.size,)))


@kernel(q=("7+",))
def is_unit(q: Vector) -> bool:
    """Whether the quaternion of a configuration, entries 3 to 6, is one: of length 0.7 to 1.4."""
    return 0.5 <= float(q[3:7] @ q[3:7]) <= 2.0


@kernel(q=("7+",), rotation=(3, 3))
def body_rotation(q: Vector, rotation: Vector) -> None:
    """Rotation matrix, body to world, of a configuration whose entries 3 to 6 are the unit
    quaternion (x, y, z, w).
    """
    rotation[:] = rotation_matrix(q[3:7])
