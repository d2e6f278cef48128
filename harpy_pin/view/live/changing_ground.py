"""The ground of the live page goes to what is set: at once, it would throw the robot."""

from __future__ import annotations

import math

from harpy_pin.model.state import Vector
from harpy_pin.simulation.terrain import Plane

__all__ = ["nearer_stiffness", "tilted"]

STIFFNESS_RATE = 4.0
"""How fast the stiffness changes, 1/s: by a factor of e in 0.25 s."""
TILT_RATE = 0.1
"""How fast the ground tilts, rad/s."""


def nearer_stiffness(now: float, desired: float, span: float) -> float:
    """The stiffness after a time, N/m.

    Args:
        now: before it, N/m.
        desired: where it goes, N/m.
        span: the time, s.
    """
    most = math.exp(STIFFNESS_RATE * span)
    return min(desired, now * most) if desired > now else max(desired, now / most)


def tilted(plane: Plane, slope: float, place: Vector, span: float) -> Plane:
    """The ground after a time in which it tilts about a place.

    Args:
        plane: before it.
        slope: to which it tilts, rad.
        place: (2,) that keeps its height, m.
        span: the time, s.
    """
    step = TILT_RATE * span
    angle = plane.slope + min(max(slope - plane.slope, -step), step)
    height = float(plane.height(place[0], place[1]))
    return Plane(slope=angle, above=height - math.tan(angle) * float(place[0]))
