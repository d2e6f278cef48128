"""Vectors, quaternions and rotations of three dimensions, for kernels; quaternions are (x, y, z, w)."""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector

SMALL_ANGLE = 1e-4
"""Below which functions of an angle are their series, rad."""


@kernel
def skew(v: Vector) -> Vector:
    """The matrix [v]× whose product with a vector is the cross product v × a."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@kernel
def exp(w: Vector) -> Vector:
    """The rotation matrix exp([w]×) = cos φ 1 + sin φ/φ [w]× + (1 − cos φ)/φ² w wᵀ, φ = |w|: Rodrigues' formula."""
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
