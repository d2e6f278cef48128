"""What the commands share: where they write to, exit codes, options, tables and the progress bar."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from harpy_pin.errors import InputError

__all__ = [
    "BAD_INPUT",
    "FELL",
    "INTERRUPTED",
    "TERMINATED",
    "JsonOption",
    "UrdfOption",
    "check_figure",
    "console",
    "measures_table",
    "stderr",
    "values_table",
    "walking_bar",
]

FELL = 1
"""Exit code when the robot fell or stumbled."""
BAD_INPUT = 2
"""Exit code of an error of ours."""
INTERRUPTED = 130
"""Exit code after Ctrl-C."""
TERMINATED = 143
"""Exit code after SIGTERM."""
FIGURES = (".png", ".pdf", ".svg")
UrdfOption = Annotated[
    Path | None, typer.Option("--urdf", metavar="FILE", help="A variant of Harpy's URDF; the packaged one by default.")
]
JsonOption = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write the numbers as JSON.")]

console = Console(markup=False)  # names and messages may hold brackets
stderr = Console(stderr=True, markup=False)


def check_figure(path: Path | None) -> None:
    """Refuse a file type that figures cannot have, before any work is done.

    Raises:
        InputError: the name ends in none of the kinds.
    """
    if path is not None and path.suffix.lower() not in FIGURES:
        raise InputError(f"a figure's name must end in {', '.join(FIGURES)}, got '{path}'", name="figure", value=path)


def values_table(title: str, values: dict[str, Any]) -> Table:
    """A line for each value."""
    table = Table("measure", "value", title=title)
    table.columns[1].justify = "right"
    for name, value in values.items():
        table.add_row(name, f"{value:.4g}" if isinstance(value, float) else str(value))
    return table


def measures_table(title: str, measures: dict[str, Any], *, thrusters: bool) -> Table:
    """A line for each measure of a run, in words; those of thrusters where it has some."""
    from harpy_pin.log.measures import OF_SOME_WALKS, OF_THRUSTERS, WORDS

    measures = {**measures, "steps": f"{measures['steps']:.1f}"}
    values = {
        name: ("yes" if value else "no") if isinstance(value, bool) else value
        for name, value in measures.items()
        if not (name in OF_SOME_WALKS and math.isnan(value)) and not (name in OF_THRUSTERS and not thrusters)
    }
    return values_table(title, {WORDS[name]: value for name, value in values.items()})


@contextmanager
def walking_bar(duration: float) -> Iterator[Callable[[float], None]]:
    """A progress bar over simulated time, on a terminal only."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.2f} s"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=stderr, transient=True, disable=not stderr.is_terminal) as bar:
        task = bar.add_task("preparing (the first run compiles)", total=duration)

        def on_piece(t: float) -> None:
            bar.update(task, description="walking", completed=t)

        yield on_piece
