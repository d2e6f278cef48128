"""Rotations in kernels. Quaternions are (x, y, z, w), as Pinocchio's; their product is Hamilton's."""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector


@kernel
def quaternion_product(p: Vector, q: Vector) -> Vector:
    """p q, of quaternions (x, y, z, w): first the rotation q, then p (Solà, arXiv:1711.02508, equation 12)."""
    return np.array([*(p[3] * q[:3] + q[3] * p[:3] + np.cross(p[:3], q[:3])), p[3] * q[3] - p[:3] @ q[:3]])
