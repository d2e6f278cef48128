"""Every variant of the paper's governor and what it is compared with, in one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from comparison.campaign.levels import level_text
from comparison.contenders import label
from comparison.tables import Cell, Table, number_text

__all__ = ["variants_table"]

_SPLIT = ("delay", "plant", "joint_damping", "torque_share", "bandwidth")
"""Factors by whose levels falls are counted."""

_NOTE = (
    "Falls in all, and by level; intervals are of 95 %. The median of slip counts a fall as more than any, the mean "
    "leaves out walks that fell. Tracking: median of the body's rms distance from its target, up to a fall. Thrust: "
    "median of its rms. "
    "Tuned: with the settings that 'python -m comparison tune' found on other walks."
)


def variants_table(summary: Mapping[str, Any]) -> Table:
    """Falls, slip and tracking of every contender.

    Args:
        summary: of :func:`comparison.campaign.summary.summarise_rows`.
    """
    cells = []
    for name, entry in summary["whole"].items():
        row = label(name)
        cells += [Cell(row, "walks", entry["walks"]), Cell(row, "fell", entry["fell"])]
        cells.append(Cell(row, "fell, 95 %", _falls_interval(entry["falls"])))
        for factor in _SPLIT:
            for level, row_of in summary["factors"].get(factor, {}).items():
                share = row_of[name]["falls"]["value"]
                fell = None if share is None else round(share * row_of[name]["walks"])
                cells.append(Cell(row, f"fell, {level_text(factor, level)}", fell))
        for column, key in (("slip, median", "slip_median_mm"), ("slip, mean", "slip_mean_mm")):
            fell_most = entry["walks"] and entry[key] is None
            cells.append(Cell(row, column, "fell" if fell_most else entry[key], "mm"))
            if column == "slip, median":
                cells.append(Cell(row, "slip, 95 %", _slip_interval(entry["slip_interval_mm"]), "mm"))
        cells.append(Cell(row, "tracking", entry["tracking_rms_mm"]["value"], "mm"))
        cells.append(Cell(row, "thrust", entry["thrust_rms_n"]["value"], "N"))
    title = f"Variants: {summary['done']} of {summary['planned']} walks, the same scenarios for all"
    return Table("variants", title, tuple(cells), _NOTE)


def _falls_interval(share: Mapping[str, float | None]) -> str | None:
    """Interval of a share of falls, in percent; None if nobody walked."""
    if share["low"] is None or share["high"] is None:
        return None
    return f"{100.0 * share['low']:.0f} to {100.0 * share['high']:.0f} %"


def _slip_interval(ends: Sequence[float | str] | None) -> str | None:
    """Interval of a median; None if too few walked."""
    return None if ends is None else " to ".join(e if isinstance(e, str) else number_text(e, 2) for e in ends)
