"""A plane that rises in one direction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from harpy_pin import checks
from harpy_pin.simulation.terrain.terrain import Terrain

__all__ = ["STEEPEST", "Plane"]

STEEPEST = 1.2
"""Largest angle of a plane or a ramp, rad (69°)."""


@dataclass(frozen=True, kw_only=True)
class Plane(Terrain):
    """A plane, through the origin where nothing else is said.

    Attributes:
        slope: angle by which it rises, rad, at most 1.2; it falls where that is negative.
        heading: direction in which it rises, rad: 0 along x, π/2 along y.
        above: its height at the origin, m.
    """

    name = "plane"
    slope: float = 0.0
    heading: float = 0.0
    above: float = 0.0

    def __post_init__(self) -> None:
        self._keep("slope", checks.number("slope", self.slope, low=-STEEPEST, high=STEEPEST))
        self._keep("heading", checks.number("heading of the slope", self.heading, low=-10.0, high=10.0))
        self._keep("above", checks.number("height of the plane at the origin", self.above, low=-1e6, high=1e6))

    def _parts(self) -> dict[str, Any]:
        rise = math.tan(self.slope)
        if rise == 0.0 and self.above == 0.0:
            return {}
        return {"slope": (rise * math.cos(self.heading), rise * math.sin(self.heading)), "above": self.above}
