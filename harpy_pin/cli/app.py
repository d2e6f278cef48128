"""The ``harpy`` command: its subcommands, and what becomes of errors."""

import sys
from importlib.metadata import entry_points
from typing import Annotated

import typer

from harpy_pin import __version__
from harpy_pin.cli.compile import compile_ahead, export
from harpy_pin.cli.ending import one_line_errors, stopping
from harpy_pin.cli.lists import info, robots, settings
from harpy_pin.cli.output import BAD_INPUT
from harpy_pin.cli.view import film, view
from harpy_pin.cli.walk import demo, walk

FIRST = """\
Six first things to do:
  harpy demo                                 three controllers on low friction
  harpy walk --robot go2 --save walk.npz     a robot dog trots
  harpy view walk.npz                        its replay, forces in their cones
  harpy live --robot go2                     drive it in the browser
  harpy walk --robot my.urdf --feet a,b,c,d  your robot
  harpy export go2 --to folder               its controller in C
All commands: harpy --help; all options of one: harpy walk --help"""
"""What ``harpy`` alone says."""
app = typer.Typer(
    name="harpy",
    help="Walk legged robots under governors and whole-body controllers.",
    epilog="Start with:  harpy",
    invoke_without_command=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (demo, walk, view, film, info, robots, settings, export):
    app.command()(stopping(command))
app.command("compile")(stopping(compile_ahead))
for extension in entry_points(group="harpy_pin.commands"):
    app.command(extension.name)(stopping(extension.load()))


def _print_version(desired: bool) -> None:
    if desired:
        print(f"harpy {__version__}")
        raise typer.Exit


@app.callback()
def _first(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        print(FIRST)


def main() -> None:
    """Entry point: errors of ours become one line and an exit code."""
    with one_line_errors("harpy", BAD_INPUT):
        sys.exit(app(prog_name="harpy", standalone_mode=False))
