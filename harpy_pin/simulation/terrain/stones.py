"""Stepping stones: level ground with a ditch across, and square stones in the ditch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.simulation.terrain.terrain import Terrain

__all__ = ["SteppingStones"]


@dataclass(frozen=True, kw_only=True)
class SteppingStones(Terrain):
    """Level ground, then square stones as high as it in a ditch along x, then level ground again.

    The sides of stones and ditch are steep ramps of the width ``edge``. Gaits of this library that choose their
    footholds set feet on stones and banks alone.

    Attributes:
        size: side of a stone's top, m.
        gap: mean distance between two stones, m; it holds two edges.
        scatter: how far stones are off a regular grid, as a share of the room that they have, 0 to 1.
        depth: of the ditch, m.
        start: x where the ditch begins, m.
        length: of the ditch along x, m.
        edge: width of the sides, m.
    """

    name = "stepping_stones"
    size: float = 0.2
    gap: float = 0.08
    scatter: float = 0.5
    depth: float = 0.2
    start: float = 0.5
    length: float = 2.0
    edge: float = 0.01

    def __post_init__(self) -> None:
        self._keep("size", checks.number("size of a stone", self.size, low=0.0, high=1e3, strict=True))
        self._keep("edge", checks.number("edge of a stone", self.edge, low=1e-4, high=1.0))
        self._keep("gap", checks.number("gap between stones", self.gap, low=2.0 * self.edge, high=1e3))
        self._keep("scatter", checks.number("scatter of the stones", self.scatter, low=0.0, high=1.0))
        self._keep("depth", checks.number("depth of the ditch", self.depth, low=0.0, high=1e3))
        self._keep("start", checks.number("start of the ditch", self.start, low=-1e6, high=1e6))
        self._keep("length", checks.number("length of the ditch", self.length, low=0.0, high=1e6, strict=True))

    def _parts(self) -> dict[str, Any]:
        if self.depth == 0.0:
            return {}
        pitch, free = self.size + self.gap, 0.5 * self.gap - self.edge
        numbers = (self.depth, self.edge, 0.5 * self.size, pitch, self.scatter * free, self.start, self.length)
        return {"stones": np.array(numbers)}
