"""The command ``harpy export``: a controller as portable C."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from harpy_pin.cli.output import console

__all__ = ["export"]


def export(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="harpy, or a name that `harpy robots` lists.")],
    to: Annotated[Path, typer.Option("--to", metavar="DIR", help="Folder; made if it is not there.")],
    controller: Annotated[
        str, typer.Option("--controller", metavar="NAME", help="condensed, wbc, paper or filter.")
    ] = "condensed",
    precision: Annotated[str, typer.Option("--precision", help="float or double.")] = "float",
) -> None:
    """Write a controller as C99 for a microcontroller: one .h, one .c, and recorded ticks to check it with.

    law is the whole-body optimum in contact forces, qp the whole-body QP by its last active set and the dual method,
    paper the paper's reference governor, contact the governor of the contact forces behind the paper's controller; the
    last two are for Harpy. Nothing is allocated, and nothing but the mathematical library is needed. Where
    gcc-arm-none-eabi and qemu-system-arm are installed, the README in the folder says what a tick costs there.
    """
    from harpy_pin.export import export as write

    done = write(robot, to, controller=controller, precision=precision)
    name, folder = done.code.name, done.folder
    console.print(f"{folder}/{name}.h, {name}.c, {name}.hpp: {done.what.title}, in {precision}", soft_wrap=True)
    console.print(f"{done.code.ram} bytes of RAM; {done.ticks} recorded ticks; README.md says more", soft_wrap=True)
    console.print(f"cmake -S {folder} -B {folder}/b && cmake --build {folder}/b && {folder}/b/check", soft_wrap=True)
