"""Results of a campaign: tables that depend on the set of its rows only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binomtest, quantile_test

from comparison.campaign.exceptions import exceptions_of
from comparison.campaign.levels import FACTOR_TEXTS, level_key
from comparison.campaign.plan import Task, code_digest
from comparison.campaign.ranking import ranked_engines, slip_interval, slip_median
from comparison.contenders import label
from comparison.tables import Cell, Table, with_interval
from harpy_pin.errors import RunFileError

__all__ = ["summarise_rows", "summary_tables"]

_WHOLE = {
    "slip_mm_per_step": ("slip per step", "mm"),
    "net_slip_mm_per_step": ("net slip per step", "mm"),
    "late_slip_mm_per_step": ("late slip per step", "mm"),
    "sliding": ("sliding", ""),
    "low_force": ("under 20 N", ""),
    "tracking_rms_mm": ("off target, rms", "mm"),
    "thrust_rms_n": ("thrust, rms", "N"),
}
_VALUE = float | int | None
_MEASURES = ("fell", "fall_time_s", "solver_failures", *_WHOLE)
_NOTE = "In brackets: 95 % confidence interval over the drawn scenarios."


def summarise_rows(tasks: Sequence[Task], rows: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """The part of the document that the tables are made of: counts, medians and their intervals.

    Rows of other campaigns are ignored.

    Raises:
        RunFileError: a row of this campaign does not hold its measures.
    """
    code = code_digest()
    planned = {task.key(code): task for task in tasks}
    for key in planned.keys() & rows.keys():
        measures = rows[key].get("measures")
        if not isinstance(measures, dict) or not all(isinstance(measures.get(name, ""), _VALUE) for name in _MEASURES):
            raise RunFileError(f"the row '{key}' of the campaign does not hold its measures; delete its line")
    found = [{**asdict(planned[key]), **rows[key]["measures"]} for key in sorted(planned.keys() & rows.keys())]
    frame = pd.DataFrame(found, columns=list(found[0]) if found else ["contender", "seed", *FACTOR_TEXTS, *_MEASURES])
    names = list(dict.fromkeys(task.contender for task in tasks))
    whole: dict[str, Any] = {}
    for name in names:
        part = frame[frame.contender == name]
        whole[name] = {"walks": len(part), "fell": int(part.fell.sum()), "falls": _share(part.fell)}
        whole[name]["fall_time_s"] = _median(part.fall_time_s)
        whole[name] |= {key: _median(part[key]) for key in _WHOLE}
        upright = part.slip_mm_per_step[~part.fell.astype(bool)]
        whole[name] |= {"slip_mean_mm": _statistic(upright.mean()), "slip_largest_mm": _statistic(upright.max())}
        whole[name]["slip_median_mm"] = _statistic(slip_median(part))
        whole[name]["slip_interval_mm"] = slip_interval(part)
        whole[name]["net_slip_median_mm"] = _statistic(slip_median(part, "net_slip_mm_per_step"))
        whole[name]["solver_failures"] = int(part.solver_failures.sum())
    factors: dict[str, Any] = {}
    for factor in FACTOR_TEXTS:
        levels = sorted({getattr(task, factor) for task in tasks})
        if len(levels) == 1:
            continue
        factors[factor] = {level_key(level): {} for level in levels}
        for level, name in ((level, name) for level in levels for name in names):
            part = frame[(frame.contender == name) & (frame[factor] == level)]
            factors[factor][level_key(level)][name] = {
                "walks": len(part),
                "falls": _share(part.fell),
                "slip_mm_per_step": _median(part.slip_mm_per_step),
                "slip_median_mm": _statistic(slip_median(part)),
            }
    return {
        "planned": len(planned),
        "done": len(found),
        "whole": whole,
        "factors": factors,
        "engines": ranked_engines(frame, names),
        "exceptions": exceptions_of(frame),
    }


def summary_tables(summary: Mapping[str, Any]) -> list[Table]:
    """The tables of a summary."""
    whole: list[Cell] = []
    for name, entry in summary["whole"].items():
        row = label(name)
        whole += [Cell(row, "walks", entry["walks"]), with_interval(row, "falls", entry["falls"])]
        whole.append(with_interval(row, "time of fall", entry["fall_time_s"], "s"))
        whole += [with_interval(row, text, entry[key], unit) for key, (text, unit) in _WHOLE.items()]
        whole.append(Cell(row, "slip of walks without a fall, mean", entry["slip_mean_mm"], "mm"))
        whole.append(Cell(row, "largest", entry["slip_largest_mm"], "mm"))
        whole.append(Cell(row, "failed solves", entry["solver_failures"]))
    title = f"Campaign: {summary['done']} of {summary['planned']} walks; shares and medians"
    tables = [Table("campaign", title, tuple(whole), f"{_NOTE} A walk that fell counts up to its fall.")]
    for factor, levels in summary["factors"].items():
        text, write = FACTOR_TEXTS[factor]
        for key, what, unit in (("falls", "share of falls", ""), ("slip_mm_per_step", "median slip per step", "mm")):
            cells = [
                with_interval(label(name), write(level), entry[key], unit)
                for level, row_of in levels.items()
                for name, entry in row_of.items()
            ]
            in_unit = f", {unit}" if unit else ""
            tables.append(Table(f"campaign_{factor}_{key}", f"Campaign: {what}{in_unit}, by {text}", tuple(cells)))
    return tables


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
    """Median with the 95 % interval that its order statistics give (none for fewer than six values)."""
    known = values.dropna().to_numpy(dtype=float)
    if len(known) == 0:
        return {"value": None, "low": None, "high": None}
    interval = quantile_test(known, p=0.5).confidence_interval(0.95)
    ends = {"low": float(interval.low), "high": float(interval.high)}
    return {"value": float(np.median(known)), **{k: v if np.isfinite(v) else None for k, v in ends.items()}}
