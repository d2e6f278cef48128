"""What a command shows: tables, a file of all numbers, and how far the work has come."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)

from comparison.report.record import origin
from comparison.tables import Table
from harpy_pin.files import check_writable, write_json

NumbersFile = Annotated[
    Path | None,
    typer.Option("--json", metavar="FILE", help="Also write every number to this file, as JSON."),
]
FigureFile = Annotated[
    Path | None,
    typer.Option("--figure", metavar="FILE", help="Also draw this figure, such as map.png."),
]
Quick = Annotated[bool, typer.Option("--quick", help="A few short ones: to see whether it works.")]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Walk on the workers of this Dask scheduler, as tcp://10.0.0.1:8786, not on this "
        "machine's cores.",
    ),
]
NO_EVIDENCE = "--quick shows that it works; its results are no evidence. Leave it out for results."


def print_tables(tables: Iterable[Table], *, quick: bool = False) -> None:
    """Print tables one below the other, as wide as the terminal; those of ``--quick`` say what they
    are.
    """
    typer.echo(
        "\n".join(
            [*(t.to_string(Console().width) for t in tables), *([NO_EVIDENCE] if quick else [])]
        )
    )


@contextmanager
def writing(path: Path | None) -> Iterator[dict[str, Any]]:
    """A document that is written as JSON at the end of the block, if there is a path; that it can
    be is checked before.

    Its origin is written with it.

    Raises:
        RunFileError: the file cannot be written.
    """
    if path is not None:
        check_writable(path)
    document: dict[str, Any] = {}
    yield document
    if path is not None:
        write_json(path, {**origin(), **document})


@contextmanager
def stages() -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each stage, drawn between pieces of work: a refreshing thread would wake up while
    the clock runs.

    Where the output is no terminal, a line says when a stage begins, and when it is done.
    """
    if not sys.stderr.isatty():
        begun: dict[str, float] = {}

        def line(what: str, done: int, total: int) -> None:
            if what not in begun:
                begun[what] = perf_counter()
                typer.echo(f"{what}: 0 of {total}", err=True)
            if done == total:
                typer.echo(
                    f"{what}: {done} of {total}, {perf_counter() - begun[what]:.1f} s", err=True
                )

        yield line
        return
    tasks: dict[str, TaskID] = {}
    columns = (
        TextColumn("{task.description:<8}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    with Progress(
        *columns, console=Console(stderr=True), auto_refresh=False, transient=True
    ) as bars:

        def progress(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=total)
            bars.update(tasks[what], completed=done)
            bars.refresh()

        yield progress
