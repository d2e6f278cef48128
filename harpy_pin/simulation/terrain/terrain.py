"""What every kind of terrain has: a height and a normal at every place, a record for kernels, and a form for files."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError
from harpy_pin.model.record import Records
from harpy_pin.model.state import Vector
from harpy_pin.simulation.terrain.surface import TerrainRecord, flat_terrain, surface_height, surface_normal

__all__ = ["Terrain"]


@dataclass(frozen=True, kw_only=True)
class Terrain(ABC):
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
            y: likewise, of the same shape.

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
            y: likewise, of the same shape.

        Returns:
            The normals, in that shape and three.
        """
        u, v = _places(x, y)
        out = np.zeros((*u.shape, 3))
        _normals(self.record, u.ravel(), v.ravel(), out.reshape(-1, 3))
        return out

    def to_dict(self) -> dict[str, Any]:
        """Name and settings, ready for JSON and exact."""
        return {"name": self.name, **{entry.name: _plain(getattr(self, entry.name)) for entry in fields(self)}}

    def _keep(self, name: str, value: Any) -> None:
        """Keep a checked value."""
        object.__setattr__(self, name, value)


def _plain(value: Any) -> Any:
    """Tuples as lists, as JSON has them."""
    return [_plain(entry) for entry in value] if isinstance(value, tuple) else value


def _places(x: ArrayLike, y: ArrayLike) -> tuple[Vector, Vector]:
    """Places as arrays of one shape.

    Raises:
        InputError: they are not.
    """
    u, v = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(y, dtype=np.float64)
    if np.shape(x) != np.shape(y):
        raise InputError(f"x and y must have one shape, got {np.shape(x)} and {np.shape(y)}", name="y", value=y)
    return u.reshape(np.shape(x)), v.reshape(np.shape(y))


@kernel
def _heights(terrain: Records[TerrainRecord], x: Vector, y: Vector, out: Vector) -> None:
    for i in range(x.shape[0]):
        out[i] = surface_height(terrain[0], x[i], y[i])


@kernel
def _normals(terrain: Records[TerrainRecord], x: Vector, y: Vector, out: Vector) -> None:
    for i in range(x.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = surface_normal(terrain[0], x[i], y[i])
