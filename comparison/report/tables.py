"""Tables of numbers that HTML, CSV and figures share: what is not in a table is not in the report."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

__all__ = ["Cell", "Table", "Value", "from_csv", "to_csv"]

Value = float | int | str | bool | None
"""What a cell holds; None is "not known" or "does not apply"."""

_LIMITS = ("/low", "/high")
_HEADER = ("table", "row", "column", "value", "unit")


@dataclass(frozen=True)
class Cell:
    """One number of a table.

    Attributes:
        row: its row.
        column: its column.
        value: what is reported.
        unit: of the value, empty for counts, shares and text.
        low: lower end of its spread, where it has one (the table says which spread).
        high: upper end.
    """

    row: str
    column: str
    value: Value
    unit: str = ""
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Table:
    """Cells in the order in which they are shown.

    Attributes:
        name: identifies the table in the CSV.
        title: what it says, with the conditions.
        cells: its contents.
        note: how to read it.
    """

    name: str
    title: str
    cells: tuple[Cell, ...]
    note: str = ""

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
        return next((c for c in self.cells if c.row == row and c.column == column), None)

    def number(self, row: str, column: str) -> float:
        """The number at a place; NaN where there is none."""
        cell = self.get(row, column)
        return float(cell.value) if cell is not None and isinstance(cell.value, float | int) else float("nan")


def to_csv(tables: Iterable[Table]) -> str:
    """All cells in long format, one per line, in full precision; ends of a spread are lines of their own."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(_HEADER)
    for table in tables:
        for c in table.cells:
            writer.writerow((table.name, c.row, c.column, _text(c.value), c.unit))
            for end, limit in zip(_LIMITS, (c.low, c.high), strict=True):
                if limit is not None:
                    writer.writerow((table.name, c.row, c.column + end, _text(limit), c.unit))
    return out.getvalue()


def from_csv(text: str) -> dict[str, Table]:
    """The tables of :func:`to_csv`, by name; titles and notes are not in the file."""
    found: dict[str, dict[tuple[str, str], list[object]]] = {}
    for line in csv.DictReader(io.StringIO(text)):
        cells = found.setdefault(line["table"], {})
        column = line["column"]
        end = next((e for e in _LIMITS if column.endswith(e)), None)
        if end is None:
            cells[line["row"], column] = [_value(line["value"]), line["unit"], None, None]
        else:
            cells[line["row"], column.removesuffix(end)][2 + _LIMITS.index(end)] = float(line["value"])
    return {
        name: Table(name, name, tuple(Cell(*place, *parts) for place, parts in cells.items()))  # type: ignore[arg-type]
        for name, cells in found.items()
    }


def _text(value: Value) -> str:
    """A value as it stands in the CSV: a number reads back to the same bits."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def _value(text: str) -> Value:
    if text == "":
        return None
    if text in ("true", "false"):
        return text == "true"
    kinds: Sequence[type[int] | type[float]] = (int, float)
    for kind in kinds:
        try:
            return kind(text)
        except ValueError:
            continue
    return text
