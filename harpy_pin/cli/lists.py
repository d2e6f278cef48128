"""The commands ``harpy info``, ``harpy robots`` and ``harpy settings``: tables of what there is."""

import re
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from harpy_pin import __version__
from harpy_pin.cli.output import console, say_next
from harpy_pin.cli.walk_options import (
    ROBOTS,
    FeetOption,
    LoopsOption,
    PostureOption,
    read_robot_options,
)
from harpy_pin.errors import install_line


def info(
    named: Annotated[str, typer.Option("--robot", help=ROBOTS)] = "harpy",
    feet: FeetOption = None,
    loops: LoopsOption = None,
    posture: PostureOption = None,
) -> None:
    """Print a robot's numbers, versions, and where examples are."""
    from harpy_pin.log.run import describe_versions
    from harpy_pin.model.source import loaded_robot

    robot = loaded_robot(read_robot_options(named, feet, posture, loops=loops))
    table = Table(
        *("joint", "lower rad", "upper rad", "torque N·m", "armature kg·m²"),
        title=f"{robot.name}: {robot.mass:.3f} kg, nq {robot.nq}, nv {robot.nv}",
        caption=f"feet {', '.join(robot.feet) or 'none'}",
    )
    if robot.thrusters:
        limit = f"{robot.thrust_limit:g} N each" if np.isfinite(robot.thrust_limit) else "no limit"
        table.caption = f"{table.caption}\nthrusters {', '.join(robot.thrusters)}, {limit}"
    if robot.loops is not None:
        passive = ", ".join(robot.model.names[joint] for joint in robot.loops.passive)
        table.caption = f"{table.caption}\n{len(robot.loops.ties)} closed loops move {passive}"
    rows = zip(
        robot.joints,
        robot.joint_lower,
        robot.joint_upper,
        robot.torque_limit,
        robot.armature,
        strict=True,
    )
    for name, lower, upper, torque, armature in rows:
        table.add_row(name, f"{lower:.2f}", f"{upper:.2f}", f"{torque:.1f}", f"{armature:g}")
    console.print(table)
    table = Table("package", "version")
    for name, version in {**describe_versions(), "harpy-pin": __version__}.items():
        table.add_row(name, version)
    console.print(table)
    # Examples come inside the package once it is installed, and are beside it in a checkout.
    package = Path(__file__).parents[1]
    checkout = (package.parent / "urdf" / "harpy.urdf").is_file()
    for path in ("examples", "docs/tutorials"):
        folder = package.parent / path if checkout else package / Path(path).name
        if folder.is_dir():
            print(f"{folder.name}: {folder}")
    say_next("harpy robots")


def robots() -> None:
    """List the robots that are known by name.

    Their files, but for Harpy's, are in example-robot-data, the extra "robots"; without it masses
    are not known.
    """
    from harpy_pin.model.catalogue import installed_data
    from harpy_pin.model.loading import robots as known_robots

    installed = installed_data()
    found = (
        f"is not installed: {install_line('robots')}"
        if installed is None
        else f"{installed} is installed"
    )
    table = Table("robot", "mass kg", "joints", "feet or rotors", "licence")
    for column in table.columns[1:3]:
        column.justify = "right"
    for name, robot in known_robots().items():
        numbers = ("–", "–") if robot.mass is None else (f"{robot.mass:.2f}", str(robot.joints))
        table.add_row(
            name, *numbers, " ".join(robot.feet) or f"{robot.rotors} rotors", robot.licence or "–"
        )
    output = _console(100)
    output.print(table)
    output.print(f"example-robot-data {found}", soft_wrap=True)
    say_next("harpy walk --robot go2")


def settings(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...", help="Only names that begin like this; all by default."
        ),
    ] = None,
) -> None:
    """List the settings of a walk: what --set takes.

    Gaits, controllers or engines that have a setting are named first. A part not named is the first
    that has it.

    \b
    harpy settings controller
    harpy walk --set controller=wbc --set controller.weights.swing=0.5
    harpy walk --set gait.velocity="0.3 0 0; 4s 0.2 0 0.5"
    """
    from harpy_pin.errors import InputError
    from harpy_pin.scenario.settings import settings_table

    table = Table("setting", "default", "meaning", pad_edge=False)
    everything = settings_table()
    found = [
        setting
        for setting in everything
        if any(setting.name.startswith(name) for name in names or ("",))
    ]
    if not found:
        raise InputError.unknown(
            "setting", " ".join(names or ()), [setting.name for setting in everything]
        )
    for setting in found:
        default = "null" if setting.default is None else str(setting.default).removesuffix("()")
        owners = f"{', '.join(setting.parts)}: " if setting.parts else ""
        meaning = re.sub(r":\w+:`[~!]?([^`]*)`", r"\1", setting.meaning).replace("``", "")
        table.add_row(setting.name, default, owners + meaning)
    _console(140).print(table)
    given = [setting for setting in found if isinstance(setting.default, str | float | int)]
    say_next(
        f"harpy walk --set {given[-1].name}={given[-1].default}" if given else "harpy settings"
    )


def _console(width: int) -> Console:
    """Where a table goes; it has so many columns where the output is no terminal."""
    return console if console.is_terminal else Console(width=width, markup=False)
