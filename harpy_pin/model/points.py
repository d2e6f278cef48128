"""Feet, thruster mounts and rotors: where they are, how they move, and their Jacobians, from placed bodies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.model.tree import TreeRecord

__all__: list[str] = []


@kernel
def point_terms(d: DynamicsRecord, q: Vector) -> None:
    """Positions, velocities, drifts and Jacobians, after :func:`harpy_pin.model.terms.place_bodies`.

    Args:
        d: element of the record of :class:`harpy_pin.model.dynamics.Dynamics`.
        q: (nq,) configuration.
    """
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
    """Linear Jacobian, world axes, of a point of body i; columns of joints that do not carry it stay as they are."""
    r = t.rotation
    while 0 < i < t.parent.shape[0]:  # a compiler sees that a single body has none above it
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
    while 0 < i < t.parent.shape[0]:  # a compiler sees that a single body has none above it
        s, column = t.screw[i], t.column[i]
        out[column] = bx * s[0] + by * s[1] + bz * s[2] + mx * s[3] + my * s[4] + mz * s[5]
        i = t.parent[i]
    out[0], out[1], out[2], out[3], out[4], out[5] = bx, by, bz, mx, my, mz
