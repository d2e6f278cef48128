"""Bezier curves of the feet (paper: 4th order, five control points)."""

from __future__ import annotations

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector

__all__ = ["bezier"]


@kernel(points=(5, 3), position=(3,), velocity=(3,), acceleration=(3,))
def bezier(points: Vector, s: float, duration: float, position: Vector, velocity: Vector, acceleration: Vector) -> None:
    """Point, velocity and acceleration of a Bezier curve, by de Casteljau's scheme.

    Args:
        points: (5, 3) control points, m.
        s: curve parameter in [0, 1].
        duration: time in which s goes from 0 to 1, s.
        position: (3,) out, m.
        velocity: (3,) out, m/s.
        acceleration: (3,) out, m/s².
    """
    r = 1.0 - s
    for i in range(3):
        p0, p1, p2, p3, p4 = points[0, i], points[1, i], points[2, i], points[3, i], points[4, i]
        a0, a1, a2, a3 = r * p0 + s * p1, r * p1 + s * p2, r * p2 + s * p3, r * p3 + s * p4
        b0, b1, b2 = r * a0 + s * a1, r * a1 + s * a2, r * a2 + s * a3
        c0, c1 = r * b0 + s * b1, r * b1 + s * b2
        position[i] = r * c0 + s * c1
        velocity[i] = 4.0 * (c1 - c0) / duration
        acceleration[i] = 12.0 * (b2 - 2.0 * b1 + b0) / (duration * duration)
