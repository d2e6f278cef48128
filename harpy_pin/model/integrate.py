"""The configuration after a displacement, as Pinocchio's ``integrate``, for kernels."""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import UNBOUNDED, TreeRecord

__all__: list[str] = []

SMALL_ANGLE = 1e-4
"""Below it the series of sine and cosine are exact to rounding after the terms used, rad."""


@kernel
def integrate(t: TreeRecord, q: Vector, displacement: Vector) -> None:
    """Move q by a displacement, in place; the base moves along the screw of its six entries.

    Args:
        t: tree (an element of its record).
        q: (nq,) configuration, in and out.
        displacement: (nv,) velocity times time, base entries in base axes.
    """
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
