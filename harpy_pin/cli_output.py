"""Where the ``harpy`` command writes to, and its plainest table."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

__all__ = ["INTERRUPTED", "console", "stderr", "values_table"]

INTERRUPTED = 130
"""Exit code after Ctrl-C."""

console = Console()
stderr = Console(stderr=True)


def values_table(title: str, values: dict[str, Any]) -> Table:
    """A line for each value."""
    table = Table("measure", "value", title=title)
    table.columns[1].justify = "right"
    for name, value in values.items():
        table.add_row(name, f"{value:.4g}" if isinstance(value, float) else str(value))
    return table
