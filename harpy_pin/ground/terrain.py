"""Ground that is not flat: planes, ramps, stairs, rough ground and height fields, by name, in files
and for kernels.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.ground.surface import (
    MAX_CELLS,
    MAX_PIECES,
    REPEATS,
    TerrainRecord,
    flat_terrain,
    surface_height,
    surface_normal,
)
from harpy_pin.kernels import kernel
from harpy_pin.model.record import Records
from harpy_pin.model.state import Vector

STEEPEST = 1.2
"""Largest angle of a plane or a ramp, rad (69°)."""
HIGHEST = 1e3
"""Largest height of a grid, m."""
RESOLUTION: dict[str, Any] = {"low": 1e-3, "high": 1e3}
"""Bounds of the distance of its points, m."""


@dataclass(frozen=True, kw_only=True)
class Terrain(checks.Checked, ABC):
    """The surface of the ground, z = h(x, y).

    Attributes:
        name: what the kind is called in files.
    """

    name: ClassVar[str]

    @abstractmethod
    def _parts(self) -> dict[str, Any]:
        """Fields of the record that are not those of flat ground; none where it is flat."""

    @property
    def record(self) -> Records[TerrainRecord]:
        """The surface, for kernels."""
        record, parts = flat_terrain(), self._parts()
        for name, value in parts.items():
            record[name] = value
        record["level"] = not parts
        return record

    @checked
    def height(self, x: ArrayLike, y: ArrayLike) -> Vector:
        """Height of the ground, m.

        Args:
            x: of the places, m.
            y: of the places, m, of the same shape.

        Returns:
            The heights, in that shape.
        """
        u, v = _places(x, y)
        out = np.zeros(u.shape)
        _heights(self.record, u.ravel(), v.ravel(), out.reshape(-1))
        return out

    @checked
    def normal(self, x: ArrayLike, y: ArrayLike) -> Vector:
        """Normals of the ground, of length one, upwards.

        Args:
            x: of the places, m.
            y: of the places, m, of the same shape.

        Returns:
            The normals, in that shape and three.
        """
        u, v = _places(x, y)
        out = np.zeros((*u.shape, 3))
        _normals(self.record, u.ravel(), v.ravel(), out.reshape(-1, 3))
        return out

    def to_dict(self) -> dict[str, Any]:
        """Name and settings, ready for JSON and exact."""
        return {
            "name": self.name,
            **{entry.name: _plain(getattr(self, entry.name)) for entry in fields(self)},
        }


@dataclass(frozen=True, kw_only=True)
class Plane(Terrain):
    """A plane, through the origin where nothing else is said.

    Attributes:
        slope: angle by which it rises, rad, at most 1.2; it falls where that is negative.
        heading: direction in which it rises, rad: 0 along x, π/2 along y.
        above: its height at the origin, m.
    """

    name = "plane"
    slope: float = checks.setting(0.0, low=-STEEPEST, high=STEEPEST)
    heading: float = checks.setting(0.0, low=-10.0, high=10.0, called="heading of the slope")
    above: float = checks.setting(
        0.0, low=-1e6, high=1e6, called="height of the plane at the origin"
    )

    def _parts(self) -> dict[str, Any]:
        rise = math.tan(self.slope)
        if rise == 0.0 and self.above == 0.0:
            return {}
        return {
            "slope": (rise * math.cos(self.heading), rise * math.sin(self.heading)),
            "above": self.above,
        }


@dataclass(frozen=True, kw_only=True)
class Ramp(Terrain):
    """Level ground, then a ramp along x, then level ground again.

    Attributes:
        slope: angle by which it rises, rad, at most 1.2; it falls where that is negative.
        start: x where it begins, m.
        length: along x, m.
    """

    name = "ramp"
    slope: float = checks.setting(0.1, low=-STEEPEST, high=STEEPEST)
    start: float = checks.setting(0.5, low=-1e6, high=1e6, called="start of the ramp")
    length: float = checks.setting(2.0, low=0.0, high=1e6, strict=True, called="length of the ramp")

    def _parts(self) -> dict[str, Any]:
        rise = math.tan(self.slope)
        end = self.start + self.length
        return _profile([(self.start, 0.0, rise), (end, rise * self.length, 0.0)])


@dataclass(frozen=True, kw_only=True)
class Stairs(Terrain):
    """Level ground, then steps along x, then level ground again.

    The riser of a step is a steep ramp of the width ``edge`` before its tread, so that a foot that
    meets it from the side is pushed back, and not up.

    Attributes:
        rise: height of a step, m; they go down where it is negative.
        depth: of a tread and its riser, m.
        steps: how many, at most 32.
        start: x where the first riser begins, m.
        edge: width of a riser, m.
    """

    name = "stairs"
    rise: float = checks.setting(0.05, low=-1.0, high=1.0, called="rise of a step")
    depth: float = checks.setting(0.3, low=0.0, high=1e3, strict=True, called="depth of a step")
    steps: int = checks.setting(10, checks.whole, low=1, high=MAX_PIECES // 2)
    start: float = checks.setting(0.5, low=-1e6, high=1e6, called="start of the stairs")
    edge: float = checks.setting(0.01, called="edge of a step")

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.number("edge of a step", self.edge, low=1e-4, high=0.5 * self.depth)

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


def _read_heights(name: str, value: Any) -> tuple[tuple[float, ...], ...]:
    try:
        heights = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        heights = np.zeros(0)
    if heights.ndim != 2 or not all(2 <= n <= MAX_CELLS for n in heights.shape):
        got = f"an array of shape {heights.shape}" if heights.ndim == 2 else shown(value)
        raise InputError(
            f"{name} must be 2 to {MAX_CELLS} rows of 2 to {MAX_CELLS} numbers, got {got}",
            name=name,
            value=value,
        )
    if not (np.abs(heights) <= HIGHEST).all():
        raise InputError(f"{name} must be finite and within {HIGHEST:g} m", name=name, value=value)
    return tuple(tuple(row) for row in heights.tolist())


@dataclass(frozen=True, kw_only=True)
class HeightField(Terrain):
    """Heights on a grid; beyond its edge the ground goes on level, with the height of the edge.

    Attributes:
        heights: rows along x, each with the heights along y, m; two to 64 points each way.
        resolution: distance of the points, m.
        corner: x and y of the first point, m; by default the grid lies about the origin.
    """

    name = "height_field"
    heights: tuple[tuple[float, ...], ...] = field(metadata=checks.rule(_read_heights))
    resolution: float = checks.setting(0.1, **RESOLUTION)
    corner: tuple[float, ...] | None = checks.setting(None, checks.fixed_vector, size=2)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.corner is None:
            points = (len(self.heights), len(self.heights[0]))
            checks.keep(self, corner=tuple(-0.5 * self.resolution * (n - 1) for n in points))

    def _parts(self) -> dict[str, Any]:
        heights = np.array(self.heights)
        if not heights.any():
            return {}
        return _grid(heights, self.resolution, self.corner, cells=1)


@dataclass(frozen=True, kw_only=True)
class Rough(Terrain):
    """Rough ground: heights drawn evenly from ± ``amplitude`` on a grid of 64 by 64 points that
    repeats.

    Attributes:
        amplitude: m.
        resolution: distance of the points, m.
        seed: the same seed gives the same ground.
    """

    name = "rough"
    amplitude: float = checks.setting(0.02, low=0.0, high=1.0)
    resolution: float = checks.setting(0.1, **RESOLUTION)
    seed: int = checks.setting(0, checks.whole)

    def _parts(self) -> dict[str, Any]:
        if self.amplitude == 0.0:
            return {}
        draw = np.random.default_rng(self.seed).uniform(
            -self.amplitude, self.amplitude, (MAX_CELLS, MAX_CELLS)
        )
        return _grid(draw, self.resolution, (0.0, 0.0), cells=REPEATS)


def _grid(heights: Any, resolution: float, corner: Any, *, cells: int) -> dict[str, Any]:
    """Heights as fields of the record."""
    grid = np.zeros((MAX_CELLS, MAX_CELLS))
    rows, columns = heights.shape
    grid[:rows, :columns] = heights
    return {
        "cells": (rows, columns, cells),
        "resolution": resolution,
        "corner": corner,
        "grid": grid,
    }


TERRAINS: dict[str, type[Terrain]] = {
    kind.name: kind for kind in (Plane, Ramp, Stairs, Rough, HeightField)
}
"""Kinds of terrain by name."""


@checked
def read_terrain(value: Any) -> Terrain:
    """A terrain from itself, its name, or what :meth:`Terrain.to_dict` made of it.

    Args:
        value: to read.

    Raises:
        InputError: an unknown name or setting, or a value out of its domain.
    """
    if isinstance(value, Terrain):
        return value
    if isinstance(value, str):
        value = {"name": value}
    if not isinstance(value, Mapping):
        kinds = ", ".join(kind.__name__ for kind in TERRAINS.values())
        raise InputError(
            f"terrain must be one of {kinds}, or a name, got {shown(value)}",
            name="terrain",
            value=value,
        )
    name = value.get("name")
    checks.one_of("terrain", name, TERRAINS)
    kind = TERRAINS[str(name)]
    valid = [entry.name for entry in fields(kind)]
    settings = {key: entry for key, entry in value.items() if key != "name"}
    for key in settings:
        checks.one_of(f"setting of the terrain '{name}'", key, valid)
    try:
        return kind(**settings)
    except TypeError as error:
        raise InputError(f"terrain '{name}': {error}", name="terrain", value=value) from None


def _plain(value: Any) -> Any:
    """Tuples as lists, as JSON has them."""
    return [_plain(entry) for entry in value] if isinstance(value, tuple) else value


def _places(x: ArrayLike, y: ArrayLike) -> tuple[Vector, Vector]:
    """Places as arrays of one shape."""
    u, v = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(y, dtype=np.float64)
    if np.shape(x) != np.shape(y):
        raise InputError(
            f"x and y must have one shape, got {np.shape(x)} and {np.shape(y)}", name="y", value=y
        )
    return u.reshape(np.shape(x)), v.reshape(np.shape(y))


@kernel
def _heights(terrain: TerrainRecord, x: Vector, y: Vector, out: Vector) -> None:
    for i in range(x.shape[0]):
        out[i] = surface_height(terrain, x[i], y[i])


@kernel
def _normals(terrain: TerrainRecord, x: Vector, y: Vector, out: Vector) -> None:
    for i in range(x.shape[0]):
        out[i] = surface_normal(terrain, x[i], y[i])
