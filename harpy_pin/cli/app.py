"""The ``harpy`` command: its subcommands, and what becomes of errors."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from harpy_pin import __version__
from harpy_pin.cli.compile import compile_ahead, export
from harpy_pin.cli.ending import one_line_errors, stopping
from harpy_pin.cli.lists import info, robots, settings
from harpy_pin.cli.live import live
from harpy_pin.cli.output import BAD_INPUT
from harpy_pin.cli.view import film, view
from harpy_pin.cli.walk import demo, walk

app = typer.Typer(
    name="harpy",
    help="Walk legged robots with thrusters, such as Harpy, under governors and whole-body controllers.",
    epilog="Start with:  harpy demo,  or  harpy walk --save walk.npz  and then  harpy view walk.npz",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (demo, walk, view, film, live, info, robots, settings, export):
    app.command()(stopping(command))
app.command("compile")(stopping(compile_ahead))


def _print_version(desired: bool) -> None:
    if desired:
        print(f"harpy {__version__}")
        raise typer.Exit


@app.callback()
def harpy(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Walk legged robots with thrusters, such as Harpy, under governors and whole-body controllers."""


def main() -> None:
    """Entry point: errors of ours become one line and an exit code."""
    with one_line_errors("harpy", BAD_INPUT):
        sys.exit(app(prog_name="harpy", standalone_mode=False))
