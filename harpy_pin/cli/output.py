"""What the commands share: where they write to, exit codes, a table and the progress bar."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

FELL, BAD_INPUT, INTERRUPTED, TERMINATED = 1, 2, 130, 143
"""Exit codes: the robot fell or stumbled; an error of ours; Ctrl-C; SIGTERM."""
console = Console(markup=False, highlight=False)  # names and messages may hold brackets
stderr = Console(stderr=True, markup=False, highlight=False)
Force = Annotated[
    bool,
    typer.Option(
        "--force", help="Also take a folder with other files; those of the same names are replaced."
    ),
]


def values_table(title: str, values: dict[str, Any]) -> Table:
    """A line for each value."""
    table = Table("measure", "value", title=title)
    table.columns[1].justify = "right"
    for name, value in values.items():
        table.add_row(name, f"{value:.3g}" if isinstance(value, float) else str(value))
    return table


def say_next(command: str) -> None:
    """The last line of a command: what may follow it."""
    console.print(f"next: {command}", soft_wrap=True)


@contextmanager
def walking_bar(duration: float) -> Iterator[Callable[[float], None]]:
    """A progress bar over simulated time, on a terminal only."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    done = TextColumn("{task.completed:.2f} s")
    columns = (TextColumn("{task.description}"), BarColumn(), done, TimeRemainingColumn())
    with Progress(*columns, console=stderr, transient=True, disable=not stderr.is_terminal) as bar:
        task = bar.add_task("preparing (the first run compiles)", total=duration)

        def on_piece(t: float) -> None:
            bar.update(task, description="walking", completed=t)

        yield on_piece
