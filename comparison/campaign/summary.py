"""What came out of a campaign: tables that depend on the set of its rows only."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table as RichTable

from comparison.campaign.plan import Task, code_digest
from comparison.report.tables import Cell, Table

__all__ = ["cell_text", "label", "print_tables", "summarise_rows", "summary_tables"]

_WHOLE = {
    "slip_mm_per_step": ("slip per step", "mm"),
    "late_slip_mm_per_step": ("late slip per step", "mm"),
    "sliding": ("sliding", ""),
    "low_force": ("under 20 N", ""),
    "tracking_rms_mm": ("off target, rms", "mm"),
    "thrust_rms_n": ("thrust, rms", "N"),
}
_FACTORS: dict[str, tuple[str, Callable[[float], str]]] = {
    "friction": ("friction of the ground", lambda v: f"μ {v:g}"),
    "push": ("lateral push", lambda v: f"{v:g} N·s"),
    "mass_error": ("error of the body's mass", lambda v: f"{100 * v:+.0f} %"),
    "friction_error": ("error of the assumed friction", lambda v: f"{100 * v:+.0f} %"),
}
_NOTE = "In brackets: 95 % confidence interval over the drawn scenarios."


def label(contender: str) -> str:
    """A contender's name for readers."""
    controller, _, governor = contender.partition("/")
    if controller == "wbc":
        return {"proxqp": "whole-body QP, ProxQP alone", "daqp": "whole-body QP, DAQP alone"}.get(
            governor, "whole-body QP"
        )
    return {"none": "no governor", "paper": "paper's governor"}.get(governor, f"{governor} governor")


def summarise_rows(tasks: Sequence[Task], rows: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """The part of the document that the tables are made of: counts, medians and their intervals.

    Args:
        tasks: the campaign.
        rows: finished walks by key; those of other campaigns are left aside.
    """
    code = code_digest()
    done = sorted((key, task) for key, task in ((t.key(code), t) for t in tasks) if key in rows)
    names = list(dict.fromkeys(task.contender for task in tasks))
    found: list[tuple[Task, Mapping[str, Any]]] = [(task, rows[key]["measures"]) for key, task in done]

    def of(contender: str, keep: Callable[[Task], bool] = lambda task: True) -> list[Mapping[str, Any]]:
        return [row for task, row in found if task.contender == contender and keep(task)]

    whole = {}
    for name in names:
        mine = of(name)
        whole[name] = {"walks": len(mine), "falls": _share(row["fell"] for row in mine)}
        times = [row["fall_time_s"] for row in mine if row["fell"]]
        whole[name]["fall_time_s"] = _median(times)
        whole[name] |= {key: _median(row[key] for row in mine) for key in _WHOLE}
        whole[name]["solver_failures"] = sum(row["solver_failures"] for row in mine)
    factors: dict[str, Any] = {}
    for factor in _FACTORS:
        levels = sorted({float(getattr(task, factor)) for task in tasks})
        factors[factor] = {}
        for level in levels:
            row_of = {}
            for name in names:
                mine = of(name, lambda task, f=factor, x=level: getattr(task, f) == x)  # type: ignore[misc]
                row_of[name] = {
                    "falls": _share(row["fell"] for row in mine),
                    "slip_mm_per_step": _median(row["slip_mm_per_step"] for row in mine),
                }
            factors[factor][f"{level:g}"] = row_of
    return {"planned": len({t.key(code) for t in tasks}), "done": len(done), "whole": whole, "factors": factors}


def summary_tables(summary: Mapping[str, Any]) -> list[Table]:
    """The tables of a summary."""
    whole: list[Cell] = []
    for name, entry in summary["whole"].items():
        row = label(name)
        whole += [Cell(row, "walks", entry["walks"]), _cell(row, "falls", entry["falls"])]
        whole.append(_cell(row, "time of fall", entry["fall_time_s"], "s"))
        whole += [_cell(row, text, entry[key], unit) for key, (text, unit) in _WHOLE.items()]
        whole.append(Cell(row, "failed solves", entry["solver_failures"]))
    title = f"Campaign: {summary['done']} of {summary['planned']} walks; shares and medians"
    tables = [Table("campaign", title, tuple(whole), f"{_NOTE} A walk that fell counts up to its fall.")]
    for factor, levels in summary["factors"].items():
        text, say = _FACTORS[factor]
        for key, what, unit in (("falls", "share of falls", ""), ("slip_mm_per_step", "median slip per step", "mm")):
            cells = [
                _cell(label(name), say(float(level)), entry[key], unit)
                for level, row_of in levels.items()
                for name, entry in row_of.items()
            ]
            in_unit = f", {unit}" if unit else ""
            tables.append(Table(f"campaign_{factor}_{key}", f"Campaign: {what}{in_unit}, by {text}", tuple(cells)))
    return tables


def print_tables(console: Console, tables: Iterable[Table]) -> None:
    """Print tables one below the other: what is measured in rows, contenders in columns."""
    for table in tables:
        shown = RichTable(title=table.title, title_justify="left")
        shown.add_column("", no_wrap=True)
        for row in table.rows:
            shown.add_column(row, justify="right", overflow="fold")
        units = {cell.column: cell.unit for cell in table.cells}
        if len(set(units.values())) == 1:
            units = {}  # the title says it
        for column in table.columns:
            name = f"{column}, {units[column]}" if units.get(column) else column
            shown.add_row(name, *(cell_text(table.get(row, column)).replace(" (", "\n(") for row in table.rows))
        console.print(shown)
        if table.note:
            console.print(table.note, style="dim", highlight=False)


def cell_text(cell: Cell | None) -> str:
    """A cell with its spread, to three digits."""
    if cell is None or cell.value is None:
        return "–"
    if isinstance(cell.value, bool):
        return "yes" if cell.value else "no"
    if not isinstance(cell.value, float):
        return str(cell.value)
    text = _digits(cell.value, 3)
    if cell.low is None or cell.high is None:
        return text
    low, high = (_digits(end, 2) for end in (cell.low, cell.high))
    if low == high:
        low, high = (_digits(end, 3) for end in (cell.low, cell.high))
    return f"{text} ({low}–{high})"


def _digits(value: float, count: int) -> str:
    """A number to so many digits, never in powers of ten for being large."""
    return f"{value:.0f}" if abs(value) >= 10.0**count else f"{value:.{count}g}"


def _cell(row: str, column: str, entry: Mapping[str, Any], unit: str = "") -> Cell:
    return Cell(row, column, entry["value"], unit, entry["low"], entry["high"])


def _share(hits: Iterable[bool]) -> dict[str, float | None]:
    """Share of hits with Wilson's 95 % interval."""
    found = list(hits)
    n = len(found)
    if n == 0:
        return {"value": None, "low": None, "high": None}
    z, p = 1.959964, sum(found) / n
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n)) / (1 + z * z / n)
    return {"value": p, "low": max(centre - half, 0.0), "high": min(centre + half, 1.0)}


def _median(values: Iterable[float | None]) -> dict[str, float | None]:
    """Median with the 95 % interval that its order statistics give (none for fewer than six values)."""
    found = sorted(v for v in values if v is not None)
    n = len(found)
    if n == 0:
        return {"value": None, "low": None, "high": None}
    value = 0.5 * (found[(n - 1) // 2] + found[n // 2])
    # The k-th smallest and k-th largest enclose the median with probability 1 − 2 P(Binomial(n, ½) < k).
    k, below = 0, 0.0
    while below + math.comb(n, k) * 0.5**n <= 0.025:
        below += math.comb(n, k) * 0.5**n
        k += 1
    if k == 0:
        return {"value": value, "low": None, "high": None}
    return {"value": value, "low": found[k - 1], "high": found[n - k]}
