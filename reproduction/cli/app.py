"""The command ``python -m reproduction``: the paper's simulations, claims and planar gait."""

from __future__ import annotations

import sys

import typer

from harpy_pin.cli.ending import one_line_errors, stopping
from harpy_pin.cli.output import BAD_INPUT
from reproduction.cli.gait import gait
from reproduction.cli.paper import paper, vlip

__all__ = ["app", "main"]

NAME = "python -m reproduction"

app = typer.Typer(
    name=NAME,
    help="Reproduce the paper of 2021 whose governor the library has: its simulations, its claims, and its gait.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (paper, vlip, gait):
    app.command()(stopping(command))


def main() -> None:
    """Entry point: errors of ours become one line and an exit code."""
    with one_line_errors("reproduction", BAD_INPUT):
        sys.exit(app(prog_name=NAME, standalone_mode=False))
