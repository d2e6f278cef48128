"""The command ``harpy settings``: every setting of a scenario, for ``--set``."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from harpy_pin.cli.output import console

__all__ = ["settings"]

WIDTH = 140
"""Columns of the table where the output is no terminal."""


def settings(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Only names that begin like this; all by default.")
    ] = None,
) -> None:
    """List the settings of a walk: what --set takes.

    Where a setting does not belong to all gaits, controllers or engines, those that have it are named first. A part
    that is not named is the first one that has the settings given.

    \b
    harpy settings controller
    harpy walk --set controller=wbc --set controller.weights.swing=0.5
    harpy walk --set gait.velocity="0.3 0 0; 4s 0.2 0 0.5"
    """
    from harpy_pin.errors import InputError
    from harpy_pin.scenario.settings import settings_table

    table = Table("setting", "default", "meaning", pad_edge=False)
    everything = settings_table()
    found = [setting for setting in everything if any(setting.name.startswith(name) for name in names or ("",))]
    if not found:
        raise InputError.unknown("setting", " ".join(names or ()), [setting.name for setting in everything])
    for setting in found:
        default = "null" if setting.default is None else str(setting.default).removesuffix("()")
        owners = f"{', '.join(setting.parts)}: " if setting.parts else ""
        table.add_row(setting.name, default, owners + setting.meaning.replace("``", ""))
    (console if console.is_terminal else Console(width=WIDTH, markup=False)).print(table)
