"""The option ``--terrain``: a kind of ground and its settings as one word."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from harpy_pin.errors import InputError

if TYPE_CHECKING:
    from harpy_pin.simulation.terrain import Terrain

__all__ = ["TerrainOption", "terrain_of"]

TerrainOption = Annotated[
    str | None,
    typer.Option(
        metavar="KIND:NAME=NUMBER,...",
        help="Ground that is not flat: plane, ramp, stairs, stepping_stones or rough, such as stairs:rise=0.08,steps=6 "
        "(m, rad).",
        show_default=False,
    ),
]


def terrain_of(text: str | None) -> Terrain | None:
    """The terrain from ``KIND:NAME=NUMBER,...``.

    Args:
        text: as given; None gives none.

    Raises:
        InputError: it does not look like that, or as :func:`harpy_pin.simulation.terrain.read_terrain`.
    """
    from harpy_pin.simulation.terrain import read_terrain

    if text is None:
        return None
    kind, _, rest = text.partition(":")
    settings: dict[str, object] = {"name": kind}
    for part in rest.split(",") if rest else ():
        name, _, number = part.partition("=")
        try:
            settings[name] = int(number) if number.isdecimal() else float(number)
        except ValueError:
            message = f"terrain must look like KIND:NAME=NUMBER,..., such as stairs:rise=0.08,steps=6, got '{text}'"
            raise InputError(message, name="terrain", value=text) from None
    return read_terrain(settings)
