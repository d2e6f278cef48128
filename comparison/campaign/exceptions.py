"""Scenarios in which a whole-body controller falls, and somebody else stands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from comparison.campaign.levels import FACTOR_TEXTS, level_key, level_text
from comparison.contenders import label
from comparison.tables import Cell, Table, number_text

__all__ = ["exceptions_of", "exceptions_table"]

WHOLE_BODY = ("condensed", "wbc")
_NOTE = (
    "By seed. 'Who' slipped least of those that stood. 'Stands without': the levels without any one of which all WBCs "
    "that fell stand."
)


def exceptions_of(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Scenarios in which the condensed WBC or the QP fell, and another contender did not.

    Args:
        frame: of the walks that are done, with ``seed``, ``contender``, ``fell``, ``fall_time_s``,
            ``slip_mm_per_step`` and the factors.

    Returns:
        For each: ``seed``, ``fell`` (when, by WBC, s), ``stood`` (slip in mm per step of those without optimum, by
        contender) and ``levels`` (key of the level, by factor; those with one level only are left out).
    """
    varied = [factor for factor in FACTOR_TEXTS if frame[factor].nunique() > 1]
    found = []
    for seed, walks in frame.groupby("seed"):
        whole_body = walks[walks.contender.isin(WHOLE_BODY) & walks.fell.astype(bool)]
        others = walks[~walks.contender.str.split("/").str[0].isin(WHOLE_BODY) & ~walks.fell.astype(bool)]
        if len(whole_body) and len(others):
            found.append(
                {
                    "seed": int(str(seed)),
                    "fell": dict(zip(whole_body.contender, whole_body.fall_time_s.astype(float), strict=True)),
                    "stood": dict(zip(others.contender, others.slip_mm_per_step.astype(float), strict=True)),
                    "levels": {factor: level_key(walks[factor].iloc[0]) for factor in varied},
                }
            )
    return found


def exceptions_table(summary: Mapping[str, Any]) -> Table:
    """The table of :func:`exceptions_of`.

    Args:
        summary: of :func:`comparison.campaign.summary.summarise_rows`.
    """
    cells: list[Cell] = []
    for entry in summary["exceptions"]:
        row = str(entry["seed"])
        least = min(entry["stood"], key=entry["stood"].get)
        cells += [
            *(Cell(row, f"{label(name)} fell at", entry["fell"].get(name), "s") for name in WHOLE_BODY),
            Cell(row, "others that stood", len(entry["stood"])),
            Cell(row, "their least slip", entry["stood"][least], "mm"),
            Cell(row, "scenario", ", ".join(level_text(*level) for level in entry["levels"].items())),
            Cell(row, "who", f"{label(least)}, {number_text(entry['stood'][least])} mm"),
            Cell(row, "stands without", " or ".join(entry.get("reasons", ())) or None),
        ]
    title = f"Scenarios in which a WBC fell and another stood: {len(summary['exceptions'])}"
    return Table("exceptions", title, tuple(cells), _NOTE)
