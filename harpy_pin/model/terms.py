"""Rigid-body terms in one compiled pass over the tree: kinematics, bias forces (RNEA), mass matrix (CRBA) and points.

The recursions are Featherstone's (Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6), with every motion and force
expressed in the axes of the base and at its origin. So composite inertias add without being transformed, the columns of
the base need no arithmetic, and nothing loses digits far from the world's origin. Pinocchio has the same algorithms; at
this size they cost less than the calls from Python to them do, which is why they stand here too. Tests compare the two.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import SLIDING, UNBOUNDED, TreeRecord

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord

GOOD, BAD, MISFIT = 0, 1, 2
"""What a kernel says of its arguments: fine, a bad sample, of the wrong size."""
MAX_SAMPLE = 1e6
"""Largest number of a good sample, in m, rad, m/s, rad/s, N or N·m: far beyond what any robot can be or do."""
SMALL_ANGLE = 1e-4
"""Below it the series of sine and cosine are exact to rounding after the terms used, rad."""


@kernel
def place_bodies(t: TreeRecord, q: Vector, v: Vector) -> None:
    """Placement, velocity and drift of every body."""
    _base(t, q, v)
    for i in range(1, t.parent.shape[0]):
        _place(t, q, i)
        _move(t, v[t.column[i]], i)


@kernel
def _base(t: TreeRecord, q: Vector, v: Vector) -> None:
    """Rotation, velocity and drift of the base."""
    r, g = t.rotation, t.gravity
    body_rotation(q, r)
    for c in range(3):
        t.drift[0, c] = -(r[0, c] * g[0] + r[1, c] * g[1] + r[2, c] * g[2])
    t.twist[0] = v[:6]


@kernel
def _place(t: TreeRecord, q: Vector, i: int) -> None:
    """Placement of a body from its parent's, and the screw of the joint between them."""
    parent, placement, a = t.axes[t.parent[i]], t.placement[i], t.axis[i]
    place, kind = t.place[i], t.kind[i]
    cosine, sine = 1.0, 0.0
    if kind == UNBOUNDED:
        cosine, sine = q[place], q[place + 1]
    elif kind != SLIDING:
        cosine, sine = np.cos(q[place]), np.sin(q[place])
    out, o, s = t.axes[i], t.position[i], t.screw[i]
    for c in range(3):
        x = parent[c, 0] * placement[0, 0] + parent[c, 1] * placement[1, 0] + parent[c, 2] * placement[2, 0]
        y = parent[c, 0] * placement[0, 1] + parent[c, 1] * placement[1, 1] + parent[c, 2] * placement[2, 1]
        z = parent[c, 0] * placement[0, 2] + parent[c, 1] * placement[1, 2] + parent[c, 2] * placement[2, 2]
        along = x * a[0] + y * a[1] + z * a[2]
        rest = (1.0 - cosine) * along
        out[c, 0] = cosine * x + sine * (y * a[2] - z * a[1]) + rest * a[0]
        out[c, 1] = cosine * y + sine * (z * a[0] - x * a[2]) + rest * a[1]
        out[c, 2] = cosine * z + sine * (x * a[1] - y * a[0]) + rest * a[2]
        s[3 + c] = along
        o[c] = t.position[t.parent[i], c]
        o[c] += parent[c, 0] * t.origin[i, 0] + parent[c, 1] * t.origin[i, 1] + parent[c, 2] * t.origin[i, 2]
    if kind == SLIDING:
        for c in range(3):
            s[c], s[3 + c] = s[3 + c], 0.0
            o[c] += s[c] * q[place]
    else:
        s[0] = o[1] * s[5] - o[2] * s[4]
        s[1] = o[2] * s[3] - o[0] * s[5]
        s[2] = o[0] * s[4] - o[1] * s[3]


@kernel
def _move(t: TreeRecord, speed: float, i: int) -> None:
    """Velocity and drift of a body from its parent's."""
    s, u, b = t.screw[i], t.twist[t.parent[i]], t.drift[t.parent[i]]
    w, a = t.twist[i], t.drift[i]
    for c in range(6):
        w[c] = u[c] + speed * s[c]
    a[0] = b[0] + speed * (u[4] * s[2] - u[5] * s[1] + u[1] * s[5] - u[2] * s[4])
    a[1] = b[1] + speed * (u[5] * s[0] - u[3] * s[2] + u[2] * s[3] - u[0] * s[5])
    a[2] = b[2] + speed * (u[3] * s[1] - u[4] * s[0] + u[0] * s[4] - u[1] * s[3])
    a[3] = b[3] + speed * (u[4] * s[5] - u[5] * s[4])
    a[4] = b[4] + speed * (u[5] * s[3] - u[3] * s[5])
    a[5] = b[5] + speed * (u[3] * s[4] - u[4] * s[3])


@kernel
def joint_space_terms(t: TreeRecord, mass_matrix: Vector, bias: Vector) -> None:
    """Mass matrix and bias forces, after :func:`place_bodies`.

    Entries of the mass matrix of joints on different branches are left as they are, zero.
    """
    bodies = t.parent.shape[0]
    for i in range(bodies):
        _weigh(t, i)
    for i in range(bodies - 1, 0, -1):
        _joint_terms(t, i, mass_matrix, bias)
        p = t.parent[i]
        for c in range(6):
            t.force[p, c] += t.force[i, c]
        for c in range(4):
            t.moment[p, c] += t.moment[i, c]
        for c in range(3):
            for k in range(3):
                t.composite[p, c, k] += t.composite[i, c, k]
    _base_terms(t, mass_matrix, bias)


@kernel
def _force_of(h: Vector, m: Vector, s: Vector) -> tuple[float, float, float, float, float, float]:
    """Inertia times a motion s, both linear and angular (6,): mass and first moment in h (4,), second moments in m."""
    return (
        h[0] * s[0] - (h[2] * s[5] - h[3] * s[4]),
        h[0] * s[1] - (h[3] * s[3] - h[1] * s[5]),
        h[0] * s[2] - (h[1] * s[4] - h[2] * s[3]),
        m[0, 0] * s[3] + m[0, 1] * s[4] + m[0, 2] * s[5] + h[2] * s[2] - h[3] * s[1],
        m[1, 0] * s[3] + m[1, 1] * s[4] + m[1, 2] * s[5] + h[3] * s[0] - h[1] * s[2],
        m[2, 0] * s[3] + m[2, 1] * s[4] + m[2, 2] * s[5] + h[1] * s[1] - h[2] * s[0],
    )


@kernel
def _weigh(t: TreeRecord, i: int) -> None:
    """Inertia of a body about the base's origin, and the force that its drift needs."""
    r, mass = t.axes[i], t.mass[i]
    cx = t.position[i, 0] + r[0, 0] * t.centre[i, 0] + r[0, 1] * t.centre[i, 1] + r[0, 2] * t.centre[i, 2]
    cy = t.position[i, 1] + r[1, 0] * t.centre[i, 0] + r[1, 1] * t.centre[i, 1] + r[1, 2] * t.centre[i, 2]
    cz = t.position[i, 2] + r[2, 0] * t.centre[i, 0] + r[2, 1] * t.centre[i, 1] + r[2, 2] * t.centre[i, 2]
    m, own = t.composite[i], t.inertia[i]
    for a in range(3):
        x = r[a, 0] * own[0, 0] + r[a, 1] * own[1, 0] + r[a, 2] * own[2, 0]
        y = r[a, 0] * own[0, 1] + r[a, 1] * own[1, 1] + r[a, 2] * own[2, 1]
        z = r[a, 0] * own[0, 2] + r[a, 1] * own[1, 2] + r[a, 2] * own[2, 2]
        for b in range(a + 1):
            m[a, b] = x * r[b, 0] + y * r[b, 1] + z * r[b, 2]
    hx, hy, hz = mass * cx, mass * cy, mass * cz
    m[0, 0] += hy * cy + hz * cz
    m[1, 1] += hx * cx + hz * cz
    m[2, 2] += hx * cx + hy * cy
    m[1, 0] -= hx * cy
    m[2, 0] -= hx * cz
    m[2, 1] -= hy * cz
    m[0, 1], m[0, 2], m[1, 2] = m[1, 0], m[2, 0], m[2, 1]
    t.moment[i, 0], t.moment[i, 1], t.moment[i, 2], t.moment[i, 3] = mass, hx, hy, hz
    # Force = inertia × drift + twist × momentum.
    u, f = t.twist[i], t.force[i]
    px, py, pz, lx, ly, lz = _force_of(t.moment[i], m, u)
    fx, fy, fz, mx, my, mz = _force_of(t.moment[i], m, t.drift[i])
    f[0] = fx + u[4] * pz - u[5] * py
    f[1] = fy + u[5] * px - u[3] * pz
    f[2] = fz + u[3] * py - u[4] * px
    f[3] = mx + (u[4] * lz - u[5] * ly + u[1] * pz - u[2] * py)
    f[4] = my + (u[5] * lx - u[3] * lz + u[2] * px - u[0] * pz)
    f[5] = mz + (u[3] * ly - u[4] * lx + u[0] * py - u[1] * px)


@kernel
def _joint_terms(t: TreeRecord, i: int, mass_matrix: Vector, bias: Vector) -> None:
    """One joint's bias force, and its row and column of the mass matrix."""
    s, column, f = t.screw[i], t.column[i], t.force[i]
    px, py, pz, lx, ly, lz = _force_of(t.moment[i], t.composite[i], s)  # for unit acceleration of the joint
    bias[column] = s[0] * f[0] + s[1] * f[1] + s[2] * f[2] + s[3] * f[3] + s[4] * f[4] + s[5] * f[5]
    k = i
    while k > 0:
        s = t.screw[k]
        entry = s[0] * px + s[1] * py + s[2] * pz + s[3] * lx + s[4] * ly + s[5] * lz
        mass_matrix[column, t.column[k]] = entry
        mass_matrix[t.column[k], column] = entry
        k = t.parent[k]
    mass_matrix[column, column] += t.armature[column]
    mass_matrix[0, column], mass_matrix[1, column], mass_matrix[2, column] = px, py, pz
    mass_matrix[3, column], mass_matrix[4, column], mass_matrix[5, column] = lx, ly, lz
    for c in range(6):
        mass_matrix[column, c] = mass_matrix[c, column]


@kernel
def _base_terms(t: TreeRecord, mass_matrix: Vector, bias: Vector) -> None:
    """The base's bias force and block of the mass matrix: the inertia of all bodies together."""
    m, h = mass_matrix, t.moment[0]
    for a in range(3):
        bias[a], bias[3 + a] = t.force[0, a], t.force[0, 3 + a]
        for b in range(3):
            m[a, b] = 0.0
            m[a, 3 + b] = 0.0
            m[3 + a, 3 + b] = t.composite[0, a, b]
        m[a, a] = h[0]
    m[0, 4], m[0, 5], m[1, 5] = h[3], -h[2], h[1]
    m[1, 3], m[2, 3], m[2, 4] = -h[3], h[2], -h[1]
    for a in range(3):
        for b in range(3):
            m[3 + a, b] = m[b, 3 + a]
    for c in range(6):
        m[c, c] += t.armature[c]


@kernel
def point_terms(d: DynamicsRecord, q: Vector) -> None:
    """Positions, velocities, drifts and Jacobians of feet, thruster mounts and rotors, after :func:`place_bodies`."""
    t, feet = d.tree, d.foot_position.shape[0]
    free = d.body.shape[0] - feet - d.rotor_axis.shape[0]
    for k in range(d.body.shape[0]):
        i = d.body[k]
        axes, o = t.axes[i], d.offset[k]
        x = t.position[i, 0] + axes[0, 0] * o[0] + axes[0, 1] * o[1] + axes[0, 2] * o[2]
        y = t.position[i, 1] + axes[1, 0] * o[0] + axes[1, 1] * o[1] + axes[1, 2] * o[2]
        z = t.position[i, 2] + axes[2, 0] * o[0] + axes[2, 1] * o[1] + axes[2, 2] * o[2]
        if k < feet:
            _motion(d, q, k, i, x, y, z)
            _jacobian(t, i, x, y, z, d.foot_jacobian[3 * k : 3 * k + 3])
        elif k < feet + free:
            _jacobian(t, i, x, y, z, d.thruster_jacobian[3 * (k - feet) : 3 * (k - feet) + 3])
        else:
            n = k - feet - free
            _rotor(d, n, i, x, y, z, d.thruster_jacobian[3 * free + n])


@kernel
def _motion(d: DynamicsRecord, q: Vector, k: int, i: int, x: float, y: float, z: float) -> None:
    """Position, velocity and drift of a foot at (x, y, z) of the base axes."""
    t, r = d.tree, d.tree.rotation
    u, a, g = t.twist[i], t.drift[i], t.gravity
    vx = u[0] + u[4] * z - u[5] * y
    vy = u[1] + u[5] * x - u[3] * z
    vz = u[2] + u[3] * y - u[4] * x
    ax = a[0] + a[4] * z - a[5] * y + u[4] * vz - u[5] * vy
    ay = a[1] + a[5] * x - a[3] * z + u[5] * vx - u[3] * vz
    az = a[2] + a[3] * y - a[4] * x + u[3] * vy - u[4] * vx
    for c in range(3):
        d.foot_position[k, c] = q[c] + r[c, 0] * x + r[c, 1] * y + r[c, 2] * z
        d.foot_velocity[k, c] = r[c, 0] * vx + r[c, 1] * vy + r[c, 2] * vz
        d.foot_drift[3 * k + c] = r[c, 0] * ax + r[c, 1] * ay + r[c, 2] * az + g[c]


@kernel
def _jacobian(t: TreeRecord, i: int, x: float, y: float, z: float, out: Vector) -> None:
    """Linear Jacobian, world axes, of a point of body i; columns of joints beyond it stay as they are."""
    r = t.rotation
    while t.parent.shape[0] > 1 and i > 0:  # a compiler sees that a single body has none above it
        s, column = t.screw[i], t.column[i]
        sx = s[0] + s[4] * z - s[5] * y
        sy = s[1] + s[5] * x - s[3] * z
        sz = s[2] + s[3] * y - s[4] * x
        for c in range(3):
            out[c, column] = r[c, 0] * sx + r[c, 1] * sy + r[c, 2] * sz
        i = t.parent[i]
    for c in range(3):
        for b in range(3):
            out[c, b] = r[c, b]
        out[c, 3] = r[c, 2] * y - r[c, 1] * z
        out[c, 4] = r[c, 0] * z - r[c, 2] * x
        out[c, 5] = r[c, 1] * x - r[c, 0] * y


@kernel
def _rotor(d: DynamicsRecord, n: int, i: int, x: float, y: float, z: float, out: Vector) -> None:
    """Axis in the world of rotor n of body i, and its row of the Jacobian; columns as in :func:`_jacobian`."""
    t, own, drag = d.tree, d.body_axis[n], d.drag[n]
    axes, r = t.axes[i], t.rotation
    bx = axes[0, 0] * own[0] + axes[0, 1] * own[1] + axes[0, 2] * own[2]
    by = axes[1, 0] * own[0] + axes[1, 1] * own[1] + axes[1, 2] * own[2]
    bz = axes[2, 0] * own[0] + axes[2, 1] * own[1] + axes[2, 2] * own[2]
    for c in range(3):
        d.rotor_axis[n, c] = r[c, 0] * bx + r[c, 1] * by + r[c, 2] * bz
    # The wrench of a unit thrust at the base's origin, base axes: what a joint does of it follows from its screw.
    mx = y * bz - z * by + drag * bx
    my = z * bx - x * bz + drag * by
    mz = x * by - y * bx + drag * bz
    while t.parent.shape[0] > 1 and i > 0:  # a compiler sees that a single body has none above it
        s, column = t.screw[i], t.column[i]
        out[column] = bx * s[0] + by * s[1] + bz * s[2] + mx * s[3] + my * s[4] + mz * s[5]
        i = t.parent[i]
    out[0], out[1], out[2], out[3], out[4], out[5] = bx, by, bz, mx, my, mz


@kernel
def integrate(t: TreeRecord, q: Vector, displacement: Vector) -> None:
    """Move q by velocity times time, in place, as Pinocchio's ``integrate``: the base along a screw."""
    _move_base(q, displacement)
    for i in range(1, t.parent.shape[0]):
        place, step = t.place[i], displacement[t.column[i]]
        if t.kind[i] == UNBOUNDED:
            c, s = np.cos(step), np.sin(step)
            x, y = c * q[place] - s * q[place + 1], s * q[place] + c * q[place + 1]
            norm = np.sqrt(x * x + y * y)
            q[place], q[place + 1] = x / norm, y / norm
        else:
            q[place] += step


@kernel
def _move_base(q: Vector, d: Vector) -> None:
    """Placement of the base after a screw of linear part d[:3] and angular part d[3:6]."""
    wx, wy, wz = d[3], d[4], d[5]
    square = wx * wx + wy * wy + wz * wz
    angle = np.sqrt(square)
    if angle < SMALL_ANGLE:
        half, cosine = 0.5 - square / 48.0, 1.0 - square / 8.0  # sin(φ/2)/φ and cos(φ/2)
        b, c = 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0  # (1 − cos φ)/φ² and (φ − sin φ)/φ³
    else:
        half, cosine = np.sin(0.5 * angle) / angle, np.cos(0.5 * angle)
        b = 2.0 * half * half
        c = (angle - np.sin(angle)) / (square * angle)
    # Translation V d: V = 1 + b [w] + c [w]².
    ux, uy, uz = wy * d[2] - wz * d[1], wz * d[0] - wx * d[2], wx * d[1] - wy * d[0]
    tx = d[0] + b * ux + c * (wy * uz - wz * uy)
    ty = d[1] + b * uy + c * (wz * ux - wx * uz)
    tz = d[2] + b * uz + c * (wx * uy - wy * ux)
    x, y, z, w = q[3], q[4], q[5], q[6]
    # p ← p + R t
    sx, sy, sz = 2.0 * (y * tz - z * ty), 2.0 * (z * tx - x * tz), 2.0 * (x * ty - y * tx)
    q[0] += tx + w * sx + y * sz - z * sy
    q[1] += ty + w * sy + z * sx - x * sz
    q[2] += tz + w * sz + x * sy - y * sx
    if cosine < 0.0:  # of the two quaternions of one rotation, the one nearer to the last
        half, cosine = -half, -cosine
    ex, ey, ez = half * wx, half * wy, half * wz
    qx = w * ex + x * cosine + y * ez - z * ey
    qy = w * ey - x * ez + y * cosine + z * ex
    qz = w * ez + x * ey - y * ex + z * cosine
    qw = w * cosine - x * ex - y * ey - z * ez
    norm = np.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    q[3], q[4], q[5], q[6] = qx / norm, qy / norm, qz / norm, qw / norm


@kernel
def update_terms(d: DynamicsRecord, q: Vector, v: Vector) -> int:
    """Every term at a state, on an element of the record.

    Returns:
        ``GOOD``; ``BAD`` for a state that no robot can have, see :attr:`harpy_pin.model.dynamics.Dynamics.finite`;
        ``MISFIT``, with nothing done, for arrays of wrong sizes.
    """
    t = d.tree
    if q.shape[0] != v.shape[0] + t.unbounded + 1 or v.shape[0] != d.bias.shape[0]:
        return MISFIT
    place_bodies(t, q, v)
    joint_space_terms(t, d.mass_matrix, d.bias)
    point_terms(d, q)
    good = all_possible(q) and all_possible(v) and is_unit(q) and all_finite(d.bias)
    return GOOD if good else BAD


@kernel
def write_thrusts(d: DynamicsRecord, variables: Vector, out: Vector) -> None:
    """The forces (thrusters, 3) of thrust variables; the other way round than
    :func:`harpy_pin.model.rotor.read_thrusts`."""
    rotors = d.rotor_axis.shape[0]
    free = out.shape[0] - rotors
    for k in range(free):
        out[k] = variables[3 * k : 3 * k + 3]
    for k in range(rotors):
        for i in range(3):
            out[free + k, i] = variables[3 * free + k] * d.rotor_axis[k, i]


@kernel(array=("n",))
def all_finite(array: Vector) -> bool:
    """Whether all entries of a vector are finite numbers; a count, which compilers turn into vector instructions."""
    bad = 0
    for i in range(array.shape[0]):
        bad += not abs(array[i]) < np.inf
    return bad == 0


@kernel(array=("n",))
def all_possible(array: Vector) -> bool:
    """Whether all entries of a vector are numbers within ``MAX_SAMPLE``."""
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
    squared = float(q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6])
    return 0.5 <= squared <= 2.0


@kernel(q=("7+",), rotation=(3, 3))
def body_rotation(q: Vector, rotation: Vector) -> None:
    """Rotation matrix, body to world, of a configuration whose entries 3 to 6 are the unit quaternion (x, y, z, w)."""
    x, y, z, w = q[3], q[4], q[5], q[6]
    rotation[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    rotation[0, 1] = 2.0 * (x * y - z * w)
    rotation[0, 2] = 2.0 * (x * z + y * w)
    rotation[1, 0] = 2.0 * (x * y + z * w)
    rotation[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    rotation[1, 2] = 2.0 * (y * z - x * w)
    rotation[2, 0] = 2.0 * (x * z - y * w)
    rotation[2, 1] = 2.0 * (y * z + x * w)
    rotation[2, 2] = 1.0 - 2.0 * (x * x + y * y)
