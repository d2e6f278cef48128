"""Command line of the comparison."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from comparison.benchmark import Settings, compare
from comparison.report import print_report, write_json
from harpy_pin.errors import HarpyError
from harpy_pin.run import check_writable

__all__ = ["app", "main"]

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command(
    epilog="Example:  python -m comparison --quick --json comparison.json",
)
def run(
    quick: Annotated[
        bool, typer.Option("--quick", help="Shorter walks and fewer repetitions: a look in under half a minute.")
    ] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Also write every number to this file, as JSON.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the pushes and of the order in which controllers are timed.")] = 0,
    friction: Annotated[
        float, typer.Option(help="Friction coefficient of the main condition. The paper's 0.25 is always added.")
    ] = 0.8,
    duration: Annotated[
        float | None, typer.Option(help="Length of a walk, s.  [default: 6, with --quick 2]", show_default=False)
    ] = None,
) -> None:
    """Compare the explicit reference governor with a QP whole-body controller.

    Both controllers walk the same robot; the states of both walks are then replayed, the same for both, and timed:
    the complete tick, its phases, and the governor and the solver alone. Every timed command is checked against an
    untimed one. Printed are the times, what each controller achieved while walking, what was checked, and what the
    numbers do not say.

    The full run takes about two minutes; the very first one compiles for a minute more. Leave the machine alone
    meanwhile: the medians forgive company, the tails do not.
    """
    if json is not None:
        check_writable(json)
    changes: dict[str, float | int] = {"friction": friction, "seed": seed}
    if duration is not None:
        changes["duration"] = duration
    settings = Settings.quick(**changes) if quick else Settings(**changes)  # type: ignore[arg-type]
    # No refreshing thread: it would wake up while the clock runs. The bars are drawn between pieces of work.
    with Bars(
        TextColumn("{task.description:<8}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        auto_refresh=False,
        transient=True,
    ) as bars:
        tasks: dict[str, TaskID] = {}

        def progress(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=total)
            bars.update(tasks[what], completed=done)
            bars.refresh()

        document = compare(settings, progress)
    if json is not None:
        write_json(json, document)
    print_report(Console(), document)
    if not (document["checks"]["passed"] and document["checks_low_friction"]["passed"]):
        typer.echo("error: a timed command was not what it should be; do not use these times", err=True)
        raise typer.Exit(1)


def main() -> None:
    """Run the command line; errors of the library become one line on stderr."""
    try:
        app(prog_name="python -m comparison")
    except HarpyError as error:
        typer.echo(f"error: {error}", err=True)
        sys.exit(1)


if __name__ == "__main__":
    main()
