"""Ground from heights on a grid, bilinear between its points: given ones, or seeded rough ground."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.simulation.terrain.image import brightness
from harpy_pin.simulation.terrain.surface import MAX_CELLS, REPEATS
from harpy_pin.simulation.terrain.terrain import Terrain

__all__ = ["HeightField", "Rough"]

HIGHEST = 1e3
"""m."""


@dataclass(frozen=True, kw_only=True)
class HeightField(Terrain):
    """Heights on a grid; beyond its edge the ground goes on level, with the height of the edge.

    Attributes:
        heights: rows along x, each with the heights along y, m; two to 64 points each way.
        resolution: distance of the points, m.
        corner: x and y of the first point, m; by default the grid lies about the origin.
    """

    name = "height_field"
    heights: tuple[tuple[float, ...], ...]
    resolution: float = 0.1
    corner: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        try:
            heights = np.array(self.heights, dtype=np.float64)
        except (TypeError, ValueError):
            heights = np.zeros(0)
        if heights.ndim != 2 or not all(2 <= n <= MAX_CELLS for n in heights.shape):
            got = f"an array of shape {heights.shape}" if heights.ndim == 2 else shown(self.heights)
            message = f"heights must be 2 to {MAX_CELLS} rows of 2 to {MAX_CELLS} numbers, got {got}"
            raise InputError(message, name="heights", value=self.heights)
        if not (np.abs(heights) <= HIGHEST).all():
            raise InputError(f"heights must be finite and within {HIGHEST:g} m", name="heights", value=self.heights)
        self._keep("heights", tuple(tuple(row) for row in heights.tolist()))
        resolution = checks.number("resolution", self.resolution, low=1e-3, high=1e3)
        self._keep("resolution", resolution)
        middle = tuple(-0.5 * resolution * (n - 1) for n in heights.shape)
        corner = middle if self.corner is None else self.corner
        self._keep("corner", tuple(checks.vector("corner", corner, 2).tolist()))

    @classmethod
    @checked
    def from_image(cls, path: str | Path, *, length: float = 3.0, height: float = 0.1) -> HeightField:
        """Heights from a picture, such as a PNG of 8 or 16 bits: black is at zero, x to the right and y upwards.

        The grid lies about the origin. A picture of more than 64 points in a direction is averaged down.

        Args:
            path: of the picture.
            length: of its width along x, m.
            height: of white, m; below zero where that is negative.

        Raises:
            InputError: it is no picture, or a value is out of its domain.
        """
        length = checks.number("length", length, low=1e-3, high=1e3)
        height = checks.number("height", height, low=-HIGHEST, high=HIGHEST)
        heights = height * brightness(path, MAX_CELLS)
        return cls(heights=tuple(map(tuple, heights.tolist())), resolution=length / (len(heights) - 1))

    def _parts(self) -> dict[str, Any]:
        heights = np.array(self.heights)
        if not heights.any():
            return {}
        return _grid(heights, self.resolution, self.corner, cells=1)


@dataclass(frozen=True, kw_only=True)
class Rough(Terrain):
    """Rough ground: heights drawn evenly from ± ``amplitude`` on a grid of 64 by 64 points that repeats.

    Attributes:
        amplitude: m.
        resolution: distance of the points, m.
        seed: the same seed gives the same ground.
    """

    name = "rough"
    amplitude: float = 0.02
    resolution: float = 0.1
    seed: int = 0

    def __post_init__(self) -> None:
        self._keep("amplitude", checks.number("amplitude", self.amplitude, low=0.0, high=1.0))
        self._keep("resolution", checks.number("resolution", self.resolution, low=1e-3, high=1e3))
        self._keep("seed", checks.whole("seed", self.seed, low=0))

    def _parts(self) -> dict[str, Any]:
        if self.amplitude == 0.0:
            return {}
        draw = np.random.default_rng(self.seed).uniform(-self.amplitude, self.amplitude, (MAX_CELLS, MAX_CELLS))
        return _grid(draw, self.resolution, (0.0, 0.0), cells=REPEATS)


def _grid(heights: Any, resolution: float, corner: Any, *, cells: int) -> dict[str, Any]:
    """Heights as fields of the record."""
    grid = np.zeros((MAX_CELLS, MAX_CELLS))
    rows, columns = heights.shape
    grid[:rows, :columns] = heights
    return {"cells": (rows, columns, cells), "resolution": resolution, "corner": corner, "grid": grid}
