"""The command ``harpy export``: a controller as portable C."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from harpy_pin.cli.output import console

__all__ = ["export"]


def export(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="harpy, or a name that `harpy robots` lists.")],
    to: Annotated[Path, typer.Option("--to", metavar="DIR", help="Output folder; created if missing.")],
    controller: Annotated[
        str, typer.Option("--controller", metavar="NAME", help="condensed, wbc, paper or filter.")
    ] = "condensed",
    precision: Annotated[str, typer.Option("--precision", help="float or double.")] = "float",
) -> None:
    """Write a controller as C99 for a microcontroller.

    That is one .h, one .c, and recorded ticks to check it with.
    condensed is the whole-body QP condensed to contact forces, wbc the whole-body QP (last active set, then dual
    method), paper the paper's reference governor, filter the contact-force filter behind the paper's controller. The
    last two are for Harpy. The code allocates no memory and needs only the C mathematical library. Where
    gcc-arm-none-eabi and qemu-system-arm are installed, the README in the folder gives the cost of a tick.
    """
    from harpy_pin.export import export as write

    done = write(robot, to, controller=controller, precision=precision)
    name, folder = done.code.name, done.folder
    console.print(f"{folder}/{name}.h, {name}.c, {name}.hpp: {done.what.title}, in {precision}", soft_wrap=True)
    console.print(f"{done.code.ram} bytes of RAM; {done.ticks} recorded ticks; README.md says more", soft_wrap=True)
    console.print(f"cmake -S {folder} -B {folder}/b && cmake --build {folder}/b && {folder}/b/check", soft_wrap=True)
