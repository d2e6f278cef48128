"""Figures of the comparison: what a tick costs against how well the feet hold, and how times grow.

They are drawn from the report's tables only, which the CSV holds.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from comparison.sections.growth import KINDS, PARTS
from comparison.tables import Table
from harpy_pin.errors import InputError
from harpy_pin.view.figures import styled
from harpy_pin.view.palette import APPLIED, CONTACT, FRICTION, SLIDING, TARGET, THRUST

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

_PROXQP = SLIDING
_OTHERS = ("#6b7480", THRUST, CONTACT, TARGET, APPLIED, FRICTION, "#8c564b", "#3b3b3b")
_GROWTH = ("#6b7480", SLIDING, THRUST, "#8c564b", TARGET, "#7a3e9d", CONTACT)
_LIFTS = (0.0, 22.0, -22.0, 40.0, -40.0, 66.0, -66.0, 92.0, -92.0, 118.0, -118.0)
"""How far above its point a label may stand, in the order of preference, points."""


def pareto_front(points: dict[str, tuple[float, float]]) -> list[str]:
    """Names of the points that no other betters in both coordinates, by their first."""
    front: list[str] = []
    for name in sorted(points, key=lambda name: points[name]):
        if not front or points[name][1] < points[front[-1]][1]:
            front.append(name)
    return front


@styled
def pareto_figure(table: Table) -> Figure:
    """Time per tick against slip, one point per controller and governor, both axes logarithmic."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    points = {
        row: (table.number(row, "tick, median"), table.number(row, "slip per step"))
        for row in table.rows
    }
    points = {row: p for row, p in points.items() if all(value > 0.0 for value in p)}
    if not points:
        raise InputError("no contender has both a time and a slip", name="table")
    others = [row for row in table.rows if "ProxQP" not in row]
    colours = {
        row: _OTHERS[others.index(row) % len(_OTHERS)] if row in others else _PROXQP
        for row in table.rows
    }
    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log")
    front = np.array([points[row] for row in pareto_front(points)])
    axes.plot(*front.T, color="#b8c2cc", linestyle=(0, (4, 3)), linewidth=1.0, zorder=1)
    ends: dict[str, float] = {}
    heights: list[float] = []
    for row, (x, y) in points.items():
        spread: dict[str, Any] = {"color": colours[row], "alpha": 0.55, "zorder": 2}
        cell, tail = table.get(row, "slip per step"), table.number(row, "tick, p99")
        heights.append(y)
        if cell is not None and cell.low is not None and cell.high is not None:
            heights += [max(cell.low, 1e-6), cell.high]
            axes.plot([x, x], heights[-2:], linewidth=1.4, **spread)
        if np.isfinite(tail):
            axes.plot([x, tail], [y, y], linewidth=1.4, **spread)
            axes.plot([tail], [y], marker="|", markersize=6, **spread)
        ends[row] = tail if np.isfinite(tail) else x
        axes.plot(
            [x],
            [y],
            marker="o",
            markersize=9,
            color=colours[row],
            markeredgecolor="white",
            zorder=3,
        )
    right = max(
        max(x, np.nan_to_num(table.number(row, "tick, p99"))) for row, (x, _) in points.items()
    )
    axes.set_xlim(0.6 * min(x for x, _ in points.values()), 2.6 * right)
    axes.set_ylim(min(heights) / 1.6, max(heights) * 1.6)
    _write_plainly(axes.xaxis, axes.yaxis)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.set_xlabel("time per complete tick, µs: median, line to the 99th percentile")
    axes.set_ylabel("slip per step, mm: median over the campaign, 95 % interval")
    axes.text(
        0.012, 0.02, "↙ cheaper, less slip", transform=axes.transAxes, color="#7b8794", fontsize=8.5
    )
    shares = {row: 100.0 * table.number(row, "falls") for row in points}
    texts = {
        row: f"falls in {share:.0f} % of walks" if share > 0.0 else "no falls"
        for row, share in shares.items()
    }
    _write_labels(axes, points, ends, texts, colours)
    return figure


def _write_labels(
    axes: Axes,
    points: Mapping[str, tuple[float, float]],
    ends: Mapping[str, float],
    texts: Mapping[str, str],
    colours: Mapping[str, str],
) -> None:
    """Names and falls, each where it covers neither a point nor another label, and stands nearest
    to its own point.
    """
    from matplotlib.patheffects import withStroke

    axes.figure.draw_without_rendering()  # type: ignore[union-attr]
    scale = 72.0 / axes.figure.dpi  # everything below is in points
    frame = np.array(axes.bbox.extents) * scale + (0.0, 16.0, 0.0, 0.0)
    places = {row: axes.transData.transform(point) * scale for row, point in points.items()}
    tails = {
        row: float(axes.transData.transform((ends[row], y))[0] * scale)
        for row, (_, y) in points.items()
    }
    taken = [
        np.array((x - 6.0, y - 6.0, tails[row] + 3.0, y + 6.0)) for row, (x, y) in places.items()
    ]

    def common(a: Any, b: Any) -> float:
        """Area that two boxes have in common."""
        width, height = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
        return float(max(width, 0.0) * max(height, 0.0))

    def far(box: Any, point: Any) -> float:
        """Distance of a point from a box."""
        return float(np.linalg.norm(np.maximum(np.maximum(box[:2] - point, point - box[2:]), 0.0)))

    for row in sorted(points, key=lambda name: points[name][0], reverse=True):
        x, y = places[row]
        others = [place for name, place in places.items() if name != row]
        width, height = max(6.4 * len(row), 4.6 * len(texts[row])) + 4.0, 26.0
        lefts = (tails[row] + 8.0, x - 8.0 - width, x - 0.5 * width)
        corners = [(left, y + lift - 0.5 * height) for lift in _LIFTS for left in lefts]
        boxes = [np.array((left, low, left + width, low + height)) for left, low in corners]
        covered = [
            sum(common(box, b) for b in taken) + 10.0 * (width * height - common(box, frame))
            for box in boxes
        ]
        stray = [
            max([far(box, places[row]) - far(box, other) for other in others], default=0.0)
            for box in boxes
        ]
        box = boxes[int(np.argmin(np.array(covered) + 20.0 * np.maximum(stray, 0.0)))]
        taken.append(box)
        place: dict[str, Any] = {
            "textcoords": "offset points",
            "va": "center",
            "annotation_clip": False,
            "zorder": 5,
        }
        place["path_effects"] = [
            withStroke(linewidth=2.5, foreground="white")
        ]  # where a line passes behind
        line = {
            "arrowstyle": "-",
            "color": colours[row],
            "alpha": 0.4,
            "linewidth": 0.7,
            "shrinkB": 5.0,
        }
        right, up = box[0] - x, box[1] + 0.5 * height - y
        how: dict[str, Any] = {
            "fontweight": "bold",
            "arrowprops": line if abs(up) > 30.0 else None,
            **place,
        }
        axes.annotate(row, points[row], (right, up + 5.5), color=colours[row], **how)
        axes.annotate(
            texts[row], points[row], (right, up - 5.5), color="#2b3440", fontsize=8.0, **place
        )


@styled
def growth_figure(tables: Mapping[str, Table]) -> Figure:
    """Times against faces, feet held and degrees of freedom: three panels that share the axis of
    time.
    """
    from matplotlib.figure import Figure
    from matplotlib.ticker import LogLocator

    figure = Figure(figsize=(8.4, 3.6), layout="constrained")
    panels = figure.subplots(1, len(KINDS), sharey=True)
    for panel, (kind, (axis, _)) in zip(panels, KINDS.items(), strict=True):
        table = tables[f"growth_{kind}"]
        rows = [row for row in table.rows if np.isfinite(table.number(row, "size"))]
        rows.sort(key=lambda row: table.number(row, "size"))
        robots = [
            row.partition(",")[0] if kind == "contacts" else "all" for row in rows
        ]  # a line for each of them
        for colour, text in zip(_GROWTH, PARTS.values(), strict=True):
            for robot in dict.fromkeys(robots):
                own = [row for row, of in zip(rows, robots, strict=True) if of == robot]
                x, y = ([table.number(row, column) for row in own] for column in ("size", text))
                panel.plot(x, y, marker="o", markersize=4, color=colour, label=text)
        panel.set_xscale("log", base=2)
        panel.set_yscale("log")
        panel.set_xticks(sorted({table.number(row, "size") for row in rows}))
        _write_plainly(panel.xaxis, panel.yaxis)
        panel.set_xlabel(axis)
        panel.grid(True, which="both", alpha=0.25)
    panels[0].yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panels[0].set_ylabel("median, µs")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False
    )
    return figure


def _write_plainly(*axes: Axis) -> None:
    """Numbers at the major ticks of logarithmic axes, never as powers of ten."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    for axis in axes:
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
