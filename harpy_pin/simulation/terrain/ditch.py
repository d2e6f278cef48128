"""A ditch with stones for kernels: how far it lies below the level ground, and its slope."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel

if TYPE_CHECKING:
    from harpy_pin.simulation.terrain.surface import TerrainRecord

__all__: list[str] = []

ALONG, ACROSS = (0.7548776662466927, 0.5698402909980532), (0.5698402909980532, 0.3247179572447460)
"""Shares by which the number of a stone moves it along x and along y: they fill the unit square evenly."""


@kernel
def ditch_height(t: TerrainRecord, x: float, y: float) -> float:
    """Height of stones and ditch, m: zero on a stone or a bank, negative between them.

    Args:
        t: element of the terrain's record.
        x: of the place, m.
        y: likewise.
    """
    if t.stones[0] == 0.0:
        return 0.0
    return float(-t.stones[0] * min(max(_nearest_top(t, x, y)[0], 0.0) / t.stones[1], 1.0))


@kernel
def ditch_slope(t: TerrainRecord, x: float, y: float) -> tuple[float, float]:
    """Rise of stones and ditch per metre along x and y.

    Args:
        t: element of the terrain's record.
        x: of the place, m.
        y: likewise.
    """
    if t.stones[0] == 0.0:
        return 0.0, 0.0
    away, along, across = _nearest_top(t, x, y)
    if not 0.0 < away < t.stones[1]:
        return 0.0, 0.0
    steep = -t.stones[0] / t.stones[1]
    return steep * along, steep * across


@kernel
def _nearest_top(t: TerrainRecord, x: float, y: float) -> tuple[float, float, float]:
    """Distance from the nearest stone or bank, along x or y, m; and the axis along which it grows, with its sign."""
    half, pitch, room, start, length = t.stones[2], t.stones[3], t.stones[4], t.stones[5], t.stones[6]
    if x <= start or x >= start + length:
        return 0.0, 0.0, 0.0
    i, j = np.floor((x - start) / pitch), np.floor(y / pitch)
    a = ALONG[0] * i + ALONG[1] * j
    b = ACROSS[0] * i + ACROSS[1] * j
    dx = x - start - (i + 0.5) * pitch - room * (2.0 * (a - np.floor(a)) - 1.0)
    dy = y - (j + 0.5) * pitch - room * (2.0 * (b - np.floor(b)) - 1.0)
    away, along, across = abs(dx) - half, 1.0 if dx > 0.0 else -1.0, 0.0
    if abs(dy) - half > away:
        away, along, across = abs(dy) - half, 0.0, 1.0 if dy > 0.0 else -1.0
    if x - start < away:
        away, along, across = x - start, 1.0, 0.0
    if start + length - x < away:
        away, along, across = start + length - x, -1.0, 0.0
    return float(away), float(along), float(across)
