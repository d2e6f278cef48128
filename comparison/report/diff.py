"""What changed between two results: ratios of medians, flagged where the spreads do not overlap."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from comparison.report.contents import tables_of
from harpy_pin.errors import RunFileError

_LEFT_OUT = ("checks", "activity", "settings", "machine", "versions")
_MEDIANS = ("p50", "ratio", "tick, median", "slip per step", "falls")
_PLACE = ["table", "row", "column"]


def read_document(path: Path) -> dict[str, Any]:
    """A result in JSON.

    Raises:
        RunFileError: the file cannot be read or is no result of the comparison.
    """
    try:
        result: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise RunFileError(f"cannot read '{path}': {error.strerror or error}", path=path) from error
    except (ValueError, RecursionError) as error:
        raise RunFileError(f"'{path}' is not JSON: {error}", path=path) from error
    for key in ("timing", "walk", "settings", "machine", "versions", "limitations"):
        if not isinstance(result, dict) or key not in result:
            raise RunFileError(f"'{path}' is not a result of the comparison: it lacks '{key}'", path=path)
    try:
        changes_text(result, result, 80)
    except (AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise RunFileError(f"'{path}' is not a result of the comparison ({reason:.120})", path=path) from error
    return result


def changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> pd.DataFrame:
    """Medians and shares that both results have, in the order of the new one.

    Returns:
        ``table``, ``row``, ``column``, ``old``, ``new``, ``ratio`` (none where old is zero) and ``spread``: whether the
        two spreads do not overlap (``beyond``), do (``within``), or one of them is not known (``unknown``).
    """
    both = _cells(new).merge(_cells(old), on=_PLACE, suffixes=("", "_old"))
    found = both[_PLACE].assign(old=both.value_old, new=both.value)
    found["ratio"] = (both.value / both.value_old).where(both.value_old != 0.0)
    apart = (both.low > both.high_old) | (both.high < both.low_old)
    known = both[["low", "high", "low_old", "high_old"]].notna().all(axis=1)
    found["spread"] = apart.map({True: "beyond", False: "within"}).where(known, "unknown")
    return found


def changes_text(old: Mapping[str, Any], new: Mapping[str, Any], width: int) -> str:
    """The changes, those beyond the spreads marked, and what else differs between the two results."""
    lines: list[str] = []
    for key in ("machine", "versions", "settings"):
        names = sorted(k for k in old[key].keys() | new[key].keys() if old[key].get(k) != new[key].get(k))
        names = [name for name in names if name != "load_1min"]
        if names:
            lines.append(textwrap.fill(f"The {key} differ: {', '.join(names)}", width))
    frame = changes(old, new)
    for name, part in frame.groupby("table", sort=False):
        shown = part.set_index(part.row + ", " + part.column)[["old", "new", "ratio", "spread"]]
        formats = {"old": "{:.4g}".format, "new": "{:.4g}".format, "ratio": "{:.3f}".format}
        lines += ["", str(name), shown.to_string(line_width=width, na_rep="–", formatters=formats)]
    beyond, known = (frame.spread == "beyond").sum(), (frame.spread != "unknown").sum()
    return "\n".join([*lines, "", f"{beyond} of {known} numbers with a known spread changed beyond it."])


def _cells(document: Mapping[str, Any]) -> pd.DataFrame:
    """Finite numbers that have a spread or are medians, with the table in which they stand."""
    rows = [
        (table.name, *cell._replace(unit=""))
        for table in tables_of(document)
        if not table.name.startswith(_LEFT_OUT)
        for cell in table.cells
        if (cell.low is not None or cell.column in _MEDIANS)
        and isinstance(cell.value, float | int)
        and not isinstance(cell.value, bool)
    ]
    frame = pd.DataFrame(rows, columns=[*_PLACE, "value", "unit", "low", "high"])
    numbers = frame[["value", "low", "high"]].astype(float)
    return frame[_PLACE].join(numbers)[numbers.value.abs() < float("inf")]
