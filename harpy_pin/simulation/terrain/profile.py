"""Ramps and stairs: ground whose height changes along x alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.simulation.terrain.plane import STEEPEST
from harpy_pin.simulation.terrain.surface import MAX_PIECES
from harpy_pin.simulation.terrain.terrain import Terrain

__all__ = ["Ramp", "Stairs"]


@dataclass(frozen=True, kw_only=True)
class Ramp(Terrain):
    """Level ground, then a ramp along x, then level ground again.

    Attributes:
        slope: angle by which it rises, rad, at most 1.2; it falls where that is negative.
        start: x where it begins, m.
        length: along x, m.
    """

    name = "ramp"
    slope: float = 0.1
    start: float = 0.5
    length: float = 2.0

    def __post_init__(self) -> None:
        self._keep("slope", checks.number("slope", self.slope, low=-STEEPEST, high=STEEPEST))
        self._keep("start", checks.number("start of the ramp", self.start, low=-1e6, high=1e6))
        self._keep("length", checks.number("length of the ramp", self.length, low=0.0, high=1e6, strict=True))

    def _parts(self) -> dict[str, Any]:
        rise = math.tan(self.slope)
        end = self.start + self.length
        return _profile([(self.start, 0.0, rise), (end, rise * self.length, 0.0)])


@dataclass(frozen=True, kw_only=True)
class Stairs(Terrain):
    """Level ground, then steps along x, then level ground again.

    The riser of a step is a steep ramp of the width ``edge`` before its tread, so that a foot that meets it from the
    side is pushed back, and not up.

    Attributes:
        rise: height of a step, m; they go down where it is negative.
        depth: of a tread and its riser, m.
        steps: how many, at most 32.
        start: x where the first riser begins, m.
        edge: width of a riser, m.
    """

    name = "stairs"
    rise: float = 0.05
    depth: float = 0.3
    steps: int = 10
    start: float = 0.5
    edge: float = 0.01

    def __post_init__(self) -> None:
        self._keep("rise", checks.number("rise of a step", self.rise, low=-1.0, high=1.0))
        self._keep("depth", checks.number("depth of a step", self.depth, low=0.0, high=1e3, strict=True))
        self._keep("steps", checks.whole("steps", self.steps, low=1, high=MAX_PIECES // 2))
        self._keep("start", checks.number("start of the stairs", self.start, low=-1e6, high=1e6))
        self._keep("edge", checks.number("edge of a step", self.edge, low=1e-4, high=0.5 * self.depth))

    def _parts(self) -> dict[str, Any]:
        pieces = []
        for step in range(self.steps):
            begin = self.start + step * self.depth
            pieces.append((begin, step * self.rise, self.rise / self.edge))
            pieces.append((begin + self.edge, (step + 1) * self.rise, 0.0))
        return _profile(pieces) if self.rise != 0.0 else {}


def _profile(pieces: list[tuple[float, float, float]]) -> dict[str, Any]:
    """Pieces as fields of the record; none where all are level."""
    if not any(height or rise for _, height, rise in pieces):
        return {}
    profile = np.zeros((MAX_PIECES, 3))
    profile[: len(pieces)] = pieces
    return {"pieces": len(pieces), "profile": profile}
