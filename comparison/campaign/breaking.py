"""Who breaks first, and on what: a campaign in tables of 80 columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from comparison.campaign.levels import level_text
from comparison.campaign.ranking import RESOLUTION_MM, RESOLUTION_SHARE, SIGNIFICANCE
from comparison.contenders import short_name
from comparison.tables import Cell, Table, Value, number_text

__all__ = ["breaking_tables"]

_WHOLE_NOTE = (
    "Who falls most comes first. 'Most at': the level with the largest share of falls, %. Medians count a fall as more "
    "slip than any; mean and largest leave walks that fell out, and so flatter who falls where it is hard. Slip is the "
    "feet's path; 'net', the median from touchdown to last touch. 'est.': the friction is estimated; "
    "'best': the paper's governor in its best variant."
)
_RANK_NOTE = (
    "Rank (falls), and rank (median slip). Who is set apart by nothing shares a rank: falls have to differ in a sign "
    f"test over the same scenarios at {100 * SIGNIFICANCE:g} %, slip by {RESOLUTION_MM:g} mm and by "
    f"{100 * RESOLUTION_SHARE:g} %."
)


def breaking_tables(summary: Mapping[str, Any]) -> list[Table]:
    """The tables of :func:`comparison.campaign.summary.summarise_rows` for a terminal; the last one says most."""
    tables = [
        _by_level(summary, "slip", "Median slip per step, mm, a fall counting as more than any"),
        _by_level(summary, "falls", "Walks that fell, %"),
    ]
    if len(summary["engines"]) > 1:
        tables.append(_engines(summary["engines"]))
    return [*tables, _whole(summary)]


def _whole(summary: Mapping[str, Any]) -> Table:
    cells = []
    order = sorted(summary["whole"].items(), key=lambda item: -(item[1]["falls"]["value"] or 0.0))
    for name, entry in order:
        row, share = short_name(name), entry["falls"]["value"]
        cells += [
            Cell(row, "fell", entry["fell"]),
            Cell(row, "%", None if share is None else 100.0 * share),
            Cell(row, "most at", _hardest(summary["factors"], name)),
            Cell(row, "median", _slip(entry)),
            Cell(row, "mean", entry["slip_mean_mm"]),
            Cell(row, "largest", entry["slip_largest_mm"]),
            Cell(row, "net", _slip(entry, "net_slip_median_mm")),
        ]
    each = max(entry["walks"] for entry in summary["whole"].values())
    title = f"Campaign: {summary['done']} of {summary['planned']} walks, {each} each; slip in mm per step"
    return Table("breaking", title, tuple(cells), _WHOLE_NOTE)


def _hardest(factors: Mapping[str, Any], name: str) -> str | None:
    """The level at which a contender falls most, with its share of falls; None if it never falls."""
    shares = [
        (row_of[name]["falls"]["value"] or 0.0, level_text(factor, level))
        for factor, levels in factors.items()
        for level, row_of in levels.items()
    ]
    share, text = max(shares, key=lambda pair: pair[0], default=(0.0, ""))
    return f"{text} ({100.0 * share:.0f})" if share > 0.0 else None


def _by_level(summary: Mapping[str, Any], what: str, title: str) -> Table:
    cells = []
    for factor, levels in summary["factors"].items():
        for level, row_of in levels.items():
            row = level_text(factor, level)
            for name, entry in row_of.items():
                share = entry["falls"]["value"]
                value: Value = _slip(entry) if what == "slip" else None if share is None else 100.0 * share
                cells.append(Cell(row, short_name(name), value))
    return Table(f"breaking_{what}", title, tuple(cells))


def _engines(engines: Mapping[str, Any]) -> Table:
    """Ranks in all engines, side by side."""
    cells = []
    for what in ("falls", "slip"):
        for plant, entries in engines.items():
            for name, entry in entries.items():
                if entry["walks"]:
                    size = f"{100.0 * entry['fell'] / entry['walks']:.0f} %" if what == "falls" else _text(_slip(entry))
                    column = f"{what}, {plant.replace('mujoco', 'MuJoCo')}"
                    cells.append(Cell(short_name(name), column, f"{entry[f'{what}_rank']} ({size})"))
    return Table("breaking_engines", "Ranks in both engines; slip in mm per step", tuple(cells), _RANK_NOTE)


def _slip(entry: Mapping[str, Any], key: str = "slip_median_mm") -> float | str | None:
    """Median slip, or that half or more fell."""
    if not entry["walks"]:
        return None
    value: float | None = entry[key]
    return "fell" if value is None else value


def _text(value: float | str | None) -> str:
    return number_text(value) if isinstance(value, float) else str(value)
