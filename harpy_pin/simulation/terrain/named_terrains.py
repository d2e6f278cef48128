"""The kinds of terrain by name, and reading one from a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.simulation.terrain.grid import HeightField, Rough
from harpy_pin.simulation.terrain.plane import Plane
from harpy_pin.simulation.terrain.profile import Ramp, Stairs
from harpy_pin.simulation.terrain.stones import SteppingStones
from harpy_pin.simulation.terrain.terrain import Terrain

__all__ = ["TERRAINS", "read_terrain"]

TERRAINS: dict[str, type[Terrain]] = {
    kind.name: kind for kind in (Plane, Ramp, Stairs, SteppingStones, Rough, HeightField)
}
"""By name."""


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
        raise InputError(f"terrain must be one of {kinds}, or a name, got {shown(value)}", name="terrain", value=value)
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
