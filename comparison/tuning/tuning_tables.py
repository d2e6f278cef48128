"""What the search found, in tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from comparison.tables import Cell, Table
from comparison.tuning.variants import VARIANTS

__all__ = ["tuning_tables"]

_NOTE = (
    "Falls, median slip per step (a fall counts as more than any) and median tracking error of the walks that did not "
    "fall, with published and with found settings."
)


def tuning_tables(document: Mapping[str, Any]) -> list[Table]:
    """A table of the scores on training walks, one on judging walks, and the settings that were found.

    Args:
        document: of :func:`comparison.tuning.tune.tune`.
    """
    found = document["variants"]
    tables = [_scores(found, which, document["budget"]) for which in ("training", "judging")]
    return [*tables, *(_settings(name, entry) for name, entry in found.items())]


def _scores(found: Mapping[str, Any], which: str, budget: int) -> Table:
    cells = []
    for name, entry in found.items():
        row = VARIANTS[name].label
        for settings, key in (("published", f"published, {which}"), ("found", which)):
            score = entry[key]
            cells.append(Cell(row, f"falls, {settings}", score["falls"]))
            slip = score["slip_median"]
            cells.append(Cell(row, f"slip, {settings}", "fell" if slip is None else slip, "mm"))
            cells.append(Cell(row, f"tracking, {settings}", score["tracking_median"], "mm"))
    walks = max(entry[which]["walks"] for entry in found.values())
    title = f"Tuning: {walks} {which} walks each; best of {budget} settings"
    return Table(f"tuning_{which}", title, tuple(cells), _NOTE)


def _settings(name: str, entry: Mapping[str, Any]) -> Table:
    cells = []
    for path, factor in entry["factors"].items():
        _, _, row = path.partition(".")
        value = entry["controller"]
        for part in path.split("."):
            value = value.get(part) if isinstance(value, Mapping) else None
        shown = value
        if isinstance(value, list):
            shown = ", ".join(f"{number:.3g}" for number in value)
        cells.append(Cell(row, "found", "as published" if shown is None else shown))
        cells.append(Cell(row, "multiple", factor if isinstance(factor, float) else None))
    return Table(f"tuning_{name}", f"Settings found: {VARIANTS[name].label}", tuple(cells))
