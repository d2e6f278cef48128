"""Every variant of the paper's governor and what it is compared with, in one table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from comparison.campaign.levels import level_text
from comparison.contenders import label
from comparison.tables import Cell, Table

__all__ = ["variants_table"]

_SPLIT = ("delay", "plant", "joint_damping", "torque_share", "bandwidth")
"""Factors by whose levels falls are counted."""

_NOTE = (
    "Falls in all, by delay and by engine. The median of slip counts a fall as more than any, the mean leaves out "
    "walks that fell. Tracking: median of the body's rms distance from its target, up to a fall. "
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
        for factor in _SPLIT:
            for level, row_of in summary["factors"].get(factor, {}).items():
                share = row_of[name]["falls"]["value"]
                fell = None if share is None else round(share * row_of[name]["walks"])
                cells.append(Cell(row, f"fell, {level_text(factor, level)}", fell))
        for column, key in (("slip, median", "slip_median_mm"), ("slip, mean", "slip_mean_mm")):
            fell_most = entry["walks"] and entry[key] is None
            cells.append(Cell(row, column, "fell" if fell_most else entry[key], "mm"))
        cells.append(Cell(row, "tracking", entry["tracking_rms_mm"]["value"], "mm"))
    title = f"Variants: {summary['done']} of {summary['planned']} walks, the same scenarios for all"
    return Table("variants", title, tuple(cells), _NOTE)
