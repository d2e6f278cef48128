"""Vectors of three numbers, rotations and spatial vectors, for kernels that compute with them.

Quaternions are (x, y, z, w) of length one (Solà, Quaternion kinematics for the error-state Kalman
filter, 2017). Motions are linear, then angular, and forces are force, then moment (Featherstone,
Rigid Body Dynamics Algorithms, 2008).
"""

from __future__ import annotations

import numpy as np

from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector

SMALL_ANGLE = 1e-4
"""Below it functions of an angle are their series, exact to rounding, rad."""


@kernel(v=(3,))
def skew(v: Vector) -> Vector:
    """[v] with [v] x = v × x."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@kernel(p=(4,), q=(4,))
def quaternion_product(p: Vector, q: Vector) -> Vector:
    """The rotation q, then p (Solà, 13)."""
    vector = p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])
    return np.array([*vector, p[3] * q[3] - p[:3] @ q[:3]])


@kernel(quaternion=(4,))
def rotation_matrix(quaternion: Vector) -> Vector:
    """R (3, 3) of a quaternion (Solà, 115)."""
    x, y, z, w = quaternion
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


@kernel(quaternion=(4,), v=(3,))
def rotate(quaternion: Vector, v: Vector) -> Vector:
    """R v = v + w s + x × s with s = 2 x × v, by a quaternion."""
    s = 2.0 * np.cross(quaternion[:3], v)
    turned: Vector = v + quaternion[3] * s + np.cross(quaternion[:3], s)
    return turned


@kernel(w=(3,))
def exp(w: Vector) -> Vector:
    """exp([w]) = cos φ 1 + sin φ/φ [w] + (1 − cos φ)/φ² w wᵀ with φ = |w| (Rodrigues)."""
    square = w @ w
    angle = np.sqrt(square)
    if angle < SMALL_ANGLE:
        a, b = 1.0 - square / 6.0, 0.5 - square / 24.0
    else:
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
    return (1.0 - b * square) * np.eye(3) + np.outer(b * w, w) + a * skew(w)


@kernel
def rotation_in_plane(angle: float) -> Vector:
    """The rotation (2, 2) to the left by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


@kernel(axis=(3,))
def rotation_about(axis: Vector, cosine: float, sine: float) -> Vector:
    """Rotation about an axis of length one by an angle (Rodrigues)."""
    x, y, z = axis
    u, v, w = (1.0 - cosine) * axis
    a, b, c = sine * axis
    return np.array(
        [
            [u * x + cosine, u * y - c, u * z + b],
            [v * x + c, v * y + cosine, v * z - a],
            [w * x - b, w * y + a, w * z + cosine],
        ]
    )


@kernel(u=(6,), s=(6,))
def motion_cross(u: Vector, s: Vector) -> Vector:
    """u × s of two motions (Featherstone, 2.31)."""
    return np.array([*(np.cross(u[3:], s[:3]) + np.cross(u[:3], s[3:])), *np.cross(u[3:], s[3:])])


@kernel(u=(6,), f=(6,))
def force_cross(u: Vector, f: Vector) -> Vector:
    """u ×* f of a motion and a force (Featherstone, 2.32)."""
    return np.array([*np.cross(u[3:], f[:3]), *(np.cross(u[3:], f[3:]) + np.cross(u[:3], f[:3]))])


@kernel(r=(3, 3))
def log(r: Vector) -> Vector:
    """The rotation vector of a rotation, of length up to π, by its quaternion (Solà, 106; Shepperd,
    1978).
    """
    v, w = (
        np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]),
        1.0 + r[0, 0] + r[1, 1] + r[2, 2],
    )
    i = 0 if r[0, 0] > max(r[1, 1], r[2, 2]) else 1 if r[1, 1] > r[2, 2] else 2
    if w < 1.0:
        j, k = (i + 1) % 3, (i + 2) % 3
        w = v[i]
        v[i] = 1.0 + r[i, i] - r[j, j] - r[k, k]
        v[j], v[k] = r[i, j] + r[j, i], r[i, k] + r[k, i]
    size = np.sqrt(v @ v)
    angle = 2.0 * np.arctan2(size, abs(w))
    return v * (np.copysign(angle / size, w) if size > 1e-12 else 0.0)
