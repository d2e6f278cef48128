"""Figures of the comparison: what a tick costs against how well the feet hold, and how long ticks take.

They are drawn from the report's tables only, so that they can be drawn again from the CSV.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from comparison.tables import Table
from harpy_pin.errors import InputError
from harpy_pin.view.figures.style import styled
from harpy_pin.view.palette import APPLIED, CONTACT, FRICTION, SLIDING, TARGET, THRUST

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

__all__ = ["latency_figure", "pareto_figure", "pareto_front", "write_plainly"]

_QP = SLIDING
_OTHERS = ("#6b7480", THRUST, CONTACT, TARGET, APPLIED, FRICTION, "#8c564b", "#3b3b3b")
_INK = "#2b3440"
_SOFT = "#7b8794"
_LIFTS = (0.0, 22.0, -22.0, 40.0, -40.0, 66.0, -66.0, 92.0, -92.0, 118.0, -118.0)
"""How far above its point a label may stand, in the order of preference, points."""


def pareto_front(points: dict[str, tuple[float, float]]) -> list[str]:
    """Names of the points that no other betters in both coordinates, by their first."""
    ordered = sorted(points, key=lambda name: points[name])
    front: list[str] = []
    for name in ordered:
        if not front or points[name][1] < points[front[-1]][1]:
            front.append(name)
    return front


@styled
def pareto_figure(table: Table) -> Figure:
    """Time per tick against slip, one point per controller and governor, both axes logarithmic.

    Raises:
        InputError: no row has both numbers.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    colours = _colours(table.rows)
    points = {row: (table.number(row, "tick, median"), table.number(row, "slip per step")) for row in table.rows}
    points = {row: p for row, p in points.items() if all(value > 0.0 for value in p)}
    if not points:
        raise InputError("no contender has both a time and a slip", name="table")
    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.subplots()
    axes.set_xscale("log")
    axes.set_yscale("log")
    front = pareto_front(points)
    axes.plot(
        [points[row][0] for row in front],
        [points[row][1] for row in front],
        color="#b8c2cc",
        linestyle=(0, (4, 3)),
        linewidth=1.0,
        zorder=1,
    )
    lows, highs = [y for _, y in points.values()], [y for _, y in points.values()]
    for row, (x, y) in points.items():
        colour = colours[row]
        cell = table.get(row, "slip per step")
        if cell is not None and cell.low is not None and cell.high is not None:
            axes.plot([x, x], [max(cell.low, 1e-6), cell.high], color=colour, linewidth=1.4, alpha=0.55, zorder=2)
            lows.append(max(cell.low, 1e-6))
            highs.append(cell.high)
        tail = table.number(row, "tick, p99")
        if np.isfinite(tail):
            axes.plot([x, tail], [y, y], color=colour, linewidth=1.4, alpha=0.55, zorder=2)
            axes.plot([tail], [y], marker="|", color=colour, markersize=6, alpha=0.55, zorder=2)
        axes.plot([x], [y], marker="o", markersize=9, color=colour, markeredgecolor="white", zorder=3)
    right = max(max(x, np.nan_to_num(table.number(row, "tick, p99"))) for row, (x, _) in points.items())
    axes.set_xlim(0.6 * min(x for x, _ in points.values()), 2.6 * right)
    axes.set_ylim(min(lows) / 1.6, max(highs) * 1.6)
    write_plainly(axes.xaxis, axes.yaxis)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.set_xlabel("time per complete tick, µs: median, line to the 99th percentile")
    axes.set_ylabel("slip per step, mm: median over the campaign, 95 % interval")
    axes.text(0.012, 0.02, "↙ cheaper, less slip", transform=axes.transAxes, color=_SOFT, fontsize=8.5)
    _write_labels(axes, table, points, colours)
    return figure


@styled
def latency_figure(table: Table) -> Figure:
    """Histograms of the complete tick of every controller, one below the other on a shared logarithmic axis."""
    from matplotlib.figure import Figure

    bins: dict[str, list[tuple[float, float, float]]] = {}
    for row in table.rows:
        name = row.rpartition(" #")[0]
        bins.setdefault(name, []).append(
            (table.number(row, "from"), table.number(row, "to"), table.number(row, "count"))
        )
    colours = _colours(list(bins))
    figure = Figure(figsize=(7.2, 0.9 + 0.72 * len(bins)), layout="constrained")
    panels = figure.subplots(len(bins), 1, sharex=True, squeeze=False)[:, 0]
    for panel, (name, parts) in zip(panels, bins.items(), strict=True):
        array = np.array(parts)
        total = array[:, 2].sum()
        share = array[:, 2] / total
        edges = np.append(array[:, 0], array[-1, 1])
        panel.stairs(share / share.max(), edges, fill=True, color=colours[name], alpha=0.85)
        rare = (array[:, 2] > 0.0) & (share < 0.01 * share.max())  # too low for a bar: shown as dots
        panel.plot(
            np.sqrt(array[rare, 0] * array[rare, 1]),
            np.full(rare.sum(), 0.05),
            linestyle="",
            marker=".",
            markersize=2.5,
            color=colours[name],
        )
        panel.set_xscale("log")
        panel.set_ylim(0.0, 1.15)
        panel.set_yticks([])
        panel.spines["left"].set_visible(False)
        panel.text(0.995, 0.6, name, transform=panel.transAxes, ha="right", color=colours[name], fontweight="bold")
    write_plainly(panels[-1].xaxis)
    panels[-1].set_xlabel(
        "time per complete tick, µs (height: share of ticks, each scaled to its own peak; dots: rare)"
    )
    return figure


def write_plainly(*axes: Axis) -> None:
    """Numbers at the major ticks of logarithmic axes, never as powers of ten."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    for axis in axes:
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def _colours(names: list[str]) -> dict[str, str]:
    """A colour for each contender, the QP's always the same."""
    others = [name for name in names if "QP" not in name]
    return {name: _QP if "QP" in name else _OTHERS[others.index(name) % len(_OTHERS)] for name in names}


def _write_labels(axes: Axes, table: Table, points: dict[str, tuple[float, float]], colours: dict[str, str]) -> None:
    """Names and falls beside the points, each where it covers neither a point nor another label."""
    from matplotlib.patheffects import withStroke

    figure = axes.figure
    figure.draw_without_rendering()  # type: ignore[union-attr]
    scale = 72.0 / figure.dpi  # everything below is in points

    def to_points(x: float, y: float) -> tuple[float, float]:
        px, py = axes.transData.transform((x, y)) * scale
        return float(px), float(py)

    frame = [axes.bbox.x0 * scale, axes.bbox.y0 * scale + 16.0, axes.bbox.x1 * scale, axes.bbox.y1 * scale]
    taken: list[list[float]] = []
    ends: dict[str, float] = {}
    for row, (x, y) in points.items():
        tail = table.number(row, "tick, p99")
        px, py = to_points(x, y)
        ends[row] = to_points(tail, y)[0] if np.isfinite(tail) else px
        taken.append([px - 6.0, py - 6.0, ends[row] + 3.0, py + 6.0])
    halo = [withStroke(linewidth=2.5, foreground="white")]  # where a line passes behind
    for row in sorted(points, key=lambda name: points[name][0], reverse=True):
        falls = table.number(row, "falls")
        text = f"falls in {100.0 * falls:.0f} % of walks" if falls > 0.0 else "no falls"
        width, height = max(6.4 * len(row), 4.6 * len(text)) + 4.0, 26.0
        (px, py), end = to_points(*points[row]), ends[row]
        sides = (end + 8.0, px - 8.0 - width, px - 0.5 * width)
        places = [(left, py + lift) for lift in _LIFTS for left in sides]
        left, level = min(places, key=lambda at: _covered_area(at, width, height, taken, frame))
        taken.append([left, level - 0.5 * height, left + width, level + 0.5 * height])
        place = {"xycoords": "data", "textcoords": "offset points", "va": "center", "annotation_clip": False}
        place |= {"path_effects": halo, "zorder": 5}
        line = {"arrowstyle": "-", "color": colours[row], "alpha": 0.4, "linewidth": 0.7, "shrinkB": 5.0}
        axes.annotate(
            row,
            points[row],
            (left - px, level - py + 5.5),
            color=colours[row],
            fontweight="bold",
            arrowprops=line if abs(level - py) > 30.0 else None,
            **place,  # type: ignore[arg-type]
        )
        axes.annotate(text, points[row], (left - px, level - py - 5.5), color=_INK, fontsize=8.0, **place)  # type: ignore[arg-type]


def _covered_area(
    at: tuple[float, float], width: float, height: float, taken: list[list[float]], frame: list[float]
) -> float:
    """Area of a label at a place that would lie over something else or outside the frame, square points."""
    x0, y0, x1, y1 = at[0], at[1] - 0.5 * height, at[0] + width, at[1] + 0.5 * height

    def common(box: list[float]) -> float:
        return max(min(x1, box[2]) - max(x0, box[0]), 0.0) * max(min(y1, box[3]) - max(y0, box[1]), 0.0)

    return sum(map(common, taken)) + 10.0 * (width * height - common(frame))
