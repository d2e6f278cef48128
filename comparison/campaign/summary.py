"""What came out of a campaign: shares and medians with their intervals, by contender and by level,
and its tables.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import binomtest, quantile_test

from comparison.campaign.plan import FACTORS, Task, code_digest, level_key
from comparison.contenders import OWN, label
from comparison.tables import Cell, Table, in_columns, number_text
from harpy_pin.errors import RunFileError
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    import pandas as pd

WHOLE_BODY = ("condensed", OWN, "wbc")
_WHOLE = {
    "slip_mm_per_step": ("slip per step", "mm"),
    "net_slip_mm_per_step": ("net slip per step", "mm"),
    "late_slip_mm_per_step": ("late slip per step", "mm"),
    "sliding": ("sliding", ""),
    "low_force": ("under 20 N", ""),
    "tracking_rms_mm": ("off target, rms", "mm"),
    "thrust_rms_n": ("thrust, rms", "N"),
}
_COLUMNS = {
    **{
        "walks": ("walks", ""),
        "falls": ("falls", ""),
        "fall_time_s": ("time of fall", "s"),
        **_WHOLE,
    },
    "slip_mean_mm": ("slip of walks without a fall, mean", "mm"),
    "slip_largest_mm": ("largest", "mm"),
    "solver_failures": ("failed solves", ""),
    "solver_fallbacks": ("ticks by the dual method", ""),
}
_VALUE = float | int | None
_MEASURES = ("fell", "fall_time_s", "solver_failures", "solver_fallbacks", *_WHOLE)
_SPLIT = ("delay", "plant", "joint_damping", "torque_share", "bandwidth")
"""Factors by whose levels falls are counted in the table of variants."""

_NOTE = (
    "In brackets: 95 % confidence interval over the drawn scenarios. A walk that fell counts "
    "up to its fall."
)
_OF_VARIANTS = (
    "Falls in all, and by level; intervals are of 95 %. The median of slip counts a fall as more "
    "than any, the mean "
    "leaves out walks that fell. Tracking: median of the body's rms distance from its target, up "
    "to a fall. Thrust: "
    "median of its rms. "
    "Tuned: with the settings that 'python -m comparison tune' found on other walks."
)


def summarise_rows(tasks: Sequence[Task], rows: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """The part of the document that the tables are made of: counts, medians and their intervals.

    Rows of other campaigns are ignored.
    """
    import pandas as pd

    code = code_digest()
    planned = {task.key(code): task for task in tasks}
    found = []
    for key, task in planned.items():
        if key in rows:
            measures = rows[key].get("measures")
            if not isinstance(measures, dict) or not all(
                isinstance(measures.get(n, ""), _VALUE) for n in _MEASURES
            ):
                raise RunFileError(
                    f"the row '{key}' of the campaign does not hold its measures; delete its line"
                )
            found.append({**asdict(task), **measures})
    frame = pd.DataFrame(
        found, columns=list(found[0]) if found else ["contender", "seed", *FACTORS, *_MEASURES]
    )
    names = list(dict.fromkeys(task.contender for task in tasks))
    factors: dict[str, Any] = {}
    for factor in FACTORS:
        levels = sorted({getattr(task, factor) for task in tasks})
        if len(levels) > 1:
            at = {level: frame[frame[factor] == level] for level in levels}
            factors[factor] = {
                level_key(level): {name: _of_level(here[here.contender == name]) for name in names}
                for level, here in at.items()
            }
    return {
        "planned": len(planned),
        "done": len(found),
        "whole": {name: _of(frame[frame.contender == name]) for name in names},
        "factors": factors,
        "exceptions": exceptions_of(frame),
    }


def _of_level(part: pd.DataFrame) -> dict[str, Any]:
    return {
        "walks": len(part),
        "falls": _share(part.fell),
        "slip_mm_per_step": _median(part.slip_mm_per_step),
    }


def _of(part: pd.DataFrame) -> dict[str, Any]:
    """What all walks together came to; in the median of slip and its ends a fall is more slip than
    any.
    """
    fell = part.fell.astype(bool)
    slips: Vector = (
        part.slip_mm_per_step.astype(float).where(~fell, np.inf).dropna().to_numpy(dtype=float)
    )
    ends = _interval(slips)
    return {
        **_of_level(part),
        "fell": int(part.fell.sum()),
        "fall_time_s": _median(part.fall_time_s),
        **{key: _median(part[key]) for key in _WHOLE},
        "slip_mean_mm": _statistic(part.slip_mm_per_step[~fell].mean()),
        "slip_largest_mm": _statistic(part.slip_mm_per_step[~fell].max()),
        "slip_median_mm": _statistic(float(np.median(slips))) if len(slips) else None,
        "slip_interval_mm": None
        if np.isnan(ends).any()
        else ["fell" if np.isinf(end) else end for end in ends],
        "solver_failures": int(part.solver_failures.sum()),
        "solver_fallbacks": int(part.solver_fallbacks.sum()),
    }


def exceptions_of(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Scenarios in which the condensed WBC or the QP fell, and another contender did not.

    Args:
        frame: of the walks that are done, with ``seed``, ``contender``, ``fell``, ``fall_time_s``,
            ``slip_mm_per_step`` and the factors.

    Returns:
        For each: ``seed``, ``fell`` (when, by WBC, s), ``stood`` (slip in mm per step of those
            without optimum, by
        contender) and ``levels`` (key of the level, by factor; those with one level only are left
        out).
    """
    varied = [factor for factor in FACTORS if frame[factor].nunique() > 1]
    found = []
    for seed, walks in frame.groupby("seed"):
        whole_body = walks[walks.contender.isin(WHOLE_BODY) & walks.fell.astype(bool)]
        others = walks[
            ~walks.contender.str.split("/").str[0].isin(("condensed", "wbc"))
            & ~walks.fell.astype(bool)
        ]
        if len(whole_body) and len(others):
            found.append(
                {
                    "seed": int(str(seed)),
                    "fell": dict(
                        zip(whole_body.contender, whole_body.fall_time_s.astype(float), strict=True)
                    ),
                    "stood": dict(
                        zip(others.contender, others.slip_mm_per_step.astype(float), strict=True)
                    ),
                    "levels": {factor: level_key(walks[factor].iloc[0]) for factor in varied},
                }
            )
    return found


def summary_tables(summary: Mapping[str, Any]) -> list[Table]:
    """The tables of a summary: all contenders, then falls and slip by the levels of each factor."""
    whole = [
        cell
        for name, entry in summary["whole"].items()
        for cell in in_columns(label(name), entry, _COLUMNS)
    ]
    title = f"Campaign: {summary['done']} of {summary['planned']} walks; shares and medians"
    tables = [Table("campaign", title, tuple(whole), _NOTE)]
    for factor, levels in summary["factors"].items():
        for key, what, unit in (
            ("falls", "share of falls", ""),
            ("slip_mm_per_step", "median slip per step", "mm"),
        ):
            cells = [
                cell
                for level, row_of in levels.items()
                for name, entry in row_of.items()
                for cell in in_columns(
                    label(name), entry, {key: (FACTORS[factor].text(level), unit)}
                )
            ]
            title = f"Campaign: {what}{', ' if unit else ''}{unit}, by {FACTORS[factor].name}"
            tables.append(Table(f"campaign_{factor}_{key}", title, tuple(cells)))
    return tables


def variants_table(summary: Mapping[str, Any]) -> Table:
    """Falls, slip and tracking of every contender."""
    cells = []
    for name, entry in summary["whole"].items():
        row, share, ends = label(name), entry["falls"], entry["slip_interval_mm"]
        low_high = (
            None
            if share["low"] is None
            else f"{100.0 * share['low']:.0f} to {100.0 * share['high']:.0f} %"
        )
        cells += in_columns(row, entry, {"walks": ("walks", ""), "fell": ("fell", "")})
        cells.append(Cell(row, "fell, 95 %", low_high))
        for factor in _SPLIT:
            for level, row_of in summary["factors"].get(factor, {}).items():
                value = row_of[name]["falls"]["value"]
                fell = None if value is None else round(value * row_of[name]["walks"])
                cells.append(Cell(row, f"fell, {FACTORS[factor].text(level)}", fell))
        median, mean = (
            "fell" if entry["walks"] and entry[key] is None else entry[key]
            for key in ("slip_median_mm", "slip_mean_mm")
        )
        interval = (
            None
            if ends is None
            else " to ".join(e if isinstance(e, str) else number_text(e, 2) for e in ends)
        )
        cells += [Cell(row, "slip, median", median, "mm"), Cell(row, "slip, 95 %", interval, "mm")]
        cells.append(Cell(row, "slip, mean", mean, "mm"))
        cells.append(Cell(row, "tracking", entry["tracking_rms_mm"]["value"], "mm"))
        cells.append(Cell(row, "thrust", entry["thrust_rms_n"]["value"], "N"))
    title = f"Variants: {summary['done']} of {summary['planned']} walks, the same scenarios for all"
    return Table("variants", title, tuple(cells), _OF_VARIANTS)


def _interval(values: Vector) -> tuple[float, float]:
    """The 95 % interval of the median that order statistics give; NaN for fewer than six values."""
    if len(values) == 0:
        return np.nan, np.nan
    ends = quantile_test(values, p=0.5).confidence_interval(0.95)
    return float(ends.low), float(ends.high)


def _statistic(value: float) -> float | None:
    """A number, or None where there is none."""
    return float(value) if np.isfinite(value) else None


def _share(hits: pd.Series[bool]) -> dict[str, float | None]:
    """Share of hits with Wilson's 95 % interval."""
    if hits.empty:
        return {"value": None, "low": None, "high": None}
    interval = binomtest(int(hits.sum()), len(hits)).proportion_ci(method="wilson")
    return {"value": float(hits.mean()), "low": float(interval.low), "high": float(interval.high)}


def _median(values: pd.Series[float]) -> dict[str, float | None]:
    """Median with its interval."""
    known = values.dropna().to_numpy(dtype=float)
    ends = map(_statistic, _interval(known))
    return {
        "value": float(np.median(known)) if len(known) else None,
        **dict(zip(("low", "high"), ends, strict=True)),
    }
