"""Tables of numbers that page, CSV, terminal and figures share: what is not in a table is not in
the report.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    import pandas as pd

Value = float | int | str | bool | None
"""What a cell holds; None is "not known" or "does not apply"."""

Columns = Mapping[str, tuple[str, str]]
"""Headings and units of columns, by the key under which an entry holds their value."""

PERCENTILES = {
    "p50_us": "p50",
    "p95_us": "p95",
    "p99_us": "p99",
    "p99_9_us": "p99.9",
    "max_us": "max",
}
"""Column of each percentile of :func:`comparison.measure.timing.summarise`."""

NOT_KNOWN = "–"
"""What stands in the place of a number that there is not."""

WORDY = 30
"""Text longer than this is a sentence: below a table in the terminal, and flush left in a page."""


class Cell(NamedTuple):
    """One number of a table."""

    row: str
    column: str
    value: Value
    unit: str = ""  # of the value, empty for counts, shares and text
    # lower end of its spread, where it has one (the table says which spread)
    low: float | None = None
    high: float | None = None  # upper end


@dataclass(frozen=True)
class Table:
    """Cells in the order in which they are shown."""

    name: str  # identifies the table in the CSV
    title: str  # what it says, with the conditions
    cells: tuple[Cell, ...]  # its contents
    note: str = ""  # how to read it

    @cached_property
    def _places(self) -> dict[tuple[str, str], Cell]:
        return {(cell.row, cell.column): cell for cell in self.cells}

    @property
    def rows(self) -> list[str]:
        """Names of the rows."""
        return list(dict.fromkeys(cell.row for cell in self.cells))

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return list(dict.fromkeys(cell.column for cell in self.cells))

    def get(self, row: str, column: str) -> Cell | None:
        """The cell at a place, if there is one."""
        return self._places.get((row, column))

    def number(self, row: str, column: str) -> float:
        """The number at a place; NaN where there is none."""
        cell = self.get(row, column)
        return (
            float(cell.value)
            if cell is not None and isinstance(cell.value, float | int)
            else float("nan")
        )

    @property
    def text(self) -> pd.DataFrame:
        """Every cell as readers see it; units stand in the columns' names unless the title says the
        only one.
        """
        import pandas as pd

        units = {cell.column: cell.unit for cell in self.cells}
        said = len(set(units.values()) - {""}) == 1 and f", {max(units.values())}" in self.title
        names = {c: f"{c}, {unit}" if unit and not said else c for c, unit in units.items()}
        lines = [[cell_text(self.get(row, column)) for column in names] for row in self.rows]
        return pd.DataFrame(lines, index=self.rows, columns=list(names.values()))

    def to_string(self, width: int) -> str:
        """The table for a terminal: columns that do not fit go on below, no cell is ever broken."""
        frame, below = self.text, [self.note] if self.note else []
        for column in frame.columns:
            wordy = frame[column].str.len() > WORDY
            below[:0] = [f"{row}: {text}" for row, text in frame.loc[wordy, column].items()]
            frame.loc[wordy, column] = NOT_KNOWN
        known = frame != NOT_KNOWN
        frame = frame.loc[known.any(axis=1), known.any()]
        body = [] if frame.empty else [frame.to_string(line_width=width)]
        wrap = textwrap.TextWrapper(width, break_long_words=False, break_on_hyphens=False)
        return "\n".join([wrap.fill(self.title), *body, *map(wrap.fill, below)]) + "\n"


def in_columns(row: str, entry: Mapping[str, Any], columns: Columns) -> list[Cell]:
    """The values of an entry in these columns, or each ``value`` between ``low`` and ``high``; None
    is not known.
    """
    cells = []
    for key, (heading, unit) in columns.items():
        value, low, high = entry.get(key), None, None
        if isinstance(value, Mapping):
            value, low, high = value["value"], value["low"], value["high"]
        cells.append(Cell(row, heading, value, unit, low, high))
    return cells


def percentiles(row: str, times: Mapping[str, Any]) -> list[Cell]:
    """Cells of the percentiles of a summary, the median between those of the repetitions where it
    has them.
    """
    spread = {"p50_us": (times.get("low_us"), times.get("high_us"))}
    return [
        Cell(row, name, times[key], "µs", *spread.get(key, ())) for key, name in PERCENTILES.items()
    ]


def cell_text(cell: Cell | None) -> str:
    """A cell with its spread, to three digits."""
    if cell is None or cell.value is None:
        return NOT_KNOWN
    if isinstance(cell.value, bool):
        return "yes" if cell.value else "no"
    if not isinstance(cell.value, float):
        return str(cell.value)
    text = number_text(cell.value)
    if cell.low is None or cell.high is None:
        return text
    low, high = (number_text(end, 2) for end in (cell.low, cell.high))
    if low == high or not float(low) <= float(text) <= float(high):
        low, high = (number_text(end) for end in (cell.low, cell.high))
    return f"{text} ({low}–{high})"


def number_text(value: float, digits: int = 3) -> str:
    """A number to so many digits, never in powers of ten for being large."""
    return f"{value:.0f}" if abs(value) >= 10.0**digits else f"{value:.{digits}g}"


def to_csv(tables: Iterable[Table]) -> str:
    """All cells in long format, one per line, in full precision."""
    import pandas as pd

    rows = [(table.name, *cell) for table in tables for cell in table.cells]
    frame = pd.DataFrame(rows, columns=["table", *Cell._fields], dtype=object)
    return str(frame.to_csv(index=False, lineterminator="\n"))
