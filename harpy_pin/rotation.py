"""Rotation of a free-flying body from its quaternion."""

from __future__ import annotations

from numba import njit

__all__ = ["body_rotation"]


@njit(cache=True)
def body_rotation(q, rotation):  # type: ignore[no-untyped-def]
    """Rotation matrix, body to world, of a configuration whose entries 3 to 6 are the quaternion (x, y, z, w).

    Args:
        q: (nq,) configuration, the quaternion of unit length.
        rotation: (3, 3) out.
    """
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
