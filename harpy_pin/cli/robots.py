"""The command ``harpy robots``: the robots that are known by name."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from harpy_pin.cli.output import console

__all__ = ["robots"]

WIDTH = 100
"""Columns of the table where the output is no terminal."""


def robots() -> None:
    """List the robots that are known by name.

    Each is loaded by its name, such as load_robot("solo12"). Their files, but for Harpy's, are in example-robot-data,
    the extra "robots"; without it, masses, joints and licences are not known.
    """
    from harpy_pin.model.catalogue import installed_data
    from harpy_pin.model.robot import robots as known_robots

    installed = installed_data()
    found = "is not installed: pip install 'harpy-pin[robots]'" if installed is None else f"{installed} is installed"
    table = Table("robot", "mass kg", "joints", "feet or rotors", "licence")
    for column in table.columns[1:3]:
        column.justify = "right"
    for name, robot in known_robots().items():
        numbers = ("–", "–") if robot.mass is None else (f"{robot.mass:.2f}", str(robot.joints))
        table.add_row(name, *numbers, " ".join(robot.feet) or f"{robot.rotors} rotors", robot.licence or "–")
    output = console if console.is_terminal else Console(width=WIDTH, markup=False)
    output.print(table)
    output.print(f"example-robot-data {found}", soft_wrap=True, highlight=False)
