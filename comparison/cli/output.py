"""What a command shows: tables, a file of all numbers, and how far the work has come."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from comparison.tables import Table
from harpy_pin.files import check_writable, write_json

__all__ = ["one_stage", "print_tables", "stages", "writing"]


def print_tables(tables: Iterable[Table]) -> None:
    """Print tables one below the other, as wide as the terminal."""
    width = Console().width
    typer.echo("\n".join(table.to_string(width) for table in tables))


@contextmanager
def writing(path: Path | None) -> Iterator[dict[str, Any]]:
    """A document that is written as JSON at the end of the block, if there is a path; that it can be is checked before.

    Raises:
        RunFileError: the file cannot be written.
    """
    if path is not None:
        check_writable(path)
    document: dict[str, Any] = {}
    yield document
    if path is not None:
        write_json(path, document)


def _bars(*, auto_refresh: bool) -> Progress:
    """Progress bars on stderr."""
    return Progress(
        TextColumn("{task.description:<8}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        auto_refresh=auto_refresh,
        transient=True,
        disable=not sys.stderr.isatty(),
    )


@contextmanager
def one_stage(what: str) -> Iterator[Callable[[int, int], None]]:
    """A bar for work in which nothing is timed; where the output is no terminal, lines."""
    if not sys.stderr.isatty():
        yield partial(_line_by_line(), what)
        return
    with _bars(auto_refresh=True) as bars:
        task = bars.add_task(what, total=None)
        yield lambda done, total: bars.update(task, completed=done, total=total)


@contextmanager
def stages() -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each stage, drawn between pieces of work: a refreshing thread would wake up while the clock runs.

    Where the output is no terminal, a line says when a stage begins, and when it is done.
    """
    if not sys.stderr.isatty():
        yield _line_by_line()
        return
    tasks: dict[str, TaskID] = {}
    with _bars(auto_refresh=False) as bars:

        def progress(what: str, done: int, total: int) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(what, total=total)
            bars.update(tasks[what], completed=done)
            bars.refresh()

        yield progress


def _line_by_line() -> Callable[[str, int, int], None]:
    """Progress as lines on stderr."""
    begun: dict[str, float] = {}

    def progress(what: str, done: int, total: int) -> None:
        if what not in begun:
            begun[what] = perf_counter()
            typer.echo(f"{what}: 0 of {total}", err=True)
        if done == total:
            typer.echo(f"{what}: {done} of {total}, {perf_counter() - begun[what]:.1f} s", err=True)

    return progress
