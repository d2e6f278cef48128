"""What changed between two results: ratios of medians, flagged where the spreads do not overlap."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import pandas as pd

from comparison.report.contents import tables_of
from comparison.tables import Cell
from harpy_pin.errors import RunFileError

__all__ = ["Change", "changes", "changes_text", "read_document"]

_BOUND = float | int | None
_LEFT_OUT = ("latency", "checks", "activity", "settings", "machine", "versions")
_VERDICTS = {True: "beyond", False: "within", None: "unknown"}
_MEDIANS = ("p50", "ratio", "tick, median", "slip per step", "falls")


@dataclass(frozen=True)
class Change:
    """One number in both results.

    Attributes:
        ratio: new over old; None where old is zero.
        beyond: whether the two spreads do not overlap; None where one of them is not known.
    """

    table: str
    row: str
    column: str
    old: float
    new: float
    ratio: float | None
    beyond: bool | None


def read_document(path: Path) -> dict[str, Any]:
    """A result in JSON.

    Raises:
        RunFileError: the file cannot be read or is no result of the comparison.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunFileError(f"cannot read '{path}': {error.strerror or error}", path=path) from error
    except (ValueError, RecursionError) as error:
        raise RunFileError(f"'{path}' is not JSON: {error}", path=path) from error
    desired = ("timing", "walk", "settings", "machine", "versions", "limitations")
    missing = [key for key in desired if not isinstance(document, dict) or key not in document]
    if missing:
        raise RunFileError(f"'{path}' is not a result of the comparison: it lacks '{missing[0]}'", path=path)
    result: dict[str, Any] = document
    try:
        changes_text(result, result, 80)
        wrong = [
            cell for _, cell in _cells(result) if not isinstance(cell.low, _BOUND) or not isinstance(cell.high, _BOUND)
        ]
    except (AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise RunFileError(f"'{path}' is not a result of the comparison ({reason:.120})", path=path) from error
    if wrong:
        raise RunFileError(f"'{path}' is not a result of the comparison: bounds that are no numbers", path=path)
    return result


def changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Change]:
    """Medians and shares that both results have, in the order of the new one."""
    before = {place: cell for place, cell in _cells(old)}
    found: list[Change] = []
    for place, cell in _cells(new):
        other = before.get(place)
        if other is None:
            continue
        x, y = _number(other), _number(cell)
        if x is None or y is None:
            continue
        found.append(Change(*place, x, y, y / x if x != 0.0 else None, _apart(other, cell)))
    return found


def changes_text(old: Mapping[str, Any], new: Mapping[str, Any], width: int) -> str:
    """The changes, those beyond the spreads marked, and what else differs between the two results."""
    lines: list[str] = []
    for key in ("machine", "versions", "settings"):
        names = sorted(k for k in old[key].keys() | new[key].keys() if old[key].get(k) != new[key].get(k))
        names = [name for name in names if name != "load_1min"]
        if names:
            lines.append(textwrap.fill(f"The {key} differ: {', '.join(names)}", width))
    frame = pd.DataFrame(changes(old, new), columns=[field.name for field in fields(Change)])
    frame["what"] = frame.row + ", " + frame.column
    frame["spread"] = [_VERDICTS[beyond] for beyond in frame.beyond]
    for name, part in frame.groupby("table", sort=False):
        shown = part.set_index("what")[["old", "new", "ratio", "spread"]].rename_axis(None)
        formats = {"old": "{:.4g}".format, "new": "{:.4g}".format, "ratio": "{:.3f}".format}
        lines += ["", str(name), shown.to_string(line_width=width, na_rep="–", formatters=formats)]
    beyond, known = sum(verdict is True for verdict in frame.beyond), frame.beyond.notna().sum()
    return "\n".join([*lines, "", f"{beyond} of {known} numbers with a known spread changed beyond it."])


def _cells(document: Mapping[str, Any]) -> list[tuple[tuple[str, str, str], Cell]]:
    tables = (t for t in tables_of(document) if not t.name.startswith(_LEFT_OUT))
    cells = ((table.name, cell) for table in tables for cell in table.cells)
    return [((name, c.row, c.column), c) for name, c in cells if c.low is not None or c.column in _MEDIANS]


def _number(cell: Cell) -> float | None:
    if isinstance(cell.value, bool) or not isinstance(cell.value, float | int):
        return None
    return float(cell.value) if math.isfinite(cell.value) else None


def _apart(old: Cell, new: Cell) -> bool | None:
    if old.low is None or old.high is None or new.low is None or new.high is None:
        return None
    return new.low > old.high or new.high < old.low
