"""The figure of the comparison: what a tick costs against how well the feet hold.

It is drawn from the report's table only, which the CSV holds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from comparison.tables import Table
from harpy_pin.errors import InputError
from harpy_pin.view.figures import styled
from harpy_pin.view.palette import APPLIED, CONTACT, FRICTION, SLIDING, TARGET, THRUST

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PROXQP = SLIDING
_OTHERS = ("#6b7480", THRUST, CONTACT, TARGET, APPLIED, FRICTION, "#8c564b", "#3b3b3b")


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
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

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
    figure = Figure(figsize=(8.4, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.set(xscale="log", yscale="log")
    front = np.array([points[row] for row in pareto_front(points)])
    axes.plot(*front.T, color="#b8c2cc", linestyle=(0, (4, 3)), linewidth=1.0, zorder=1)
    for row, (x, y) in points.items():
        spread: dict[str, Any] = {"color": colours[row], "alpha": 0.55, "linewidth": 1.4}
        cell, tail = table.get(row, "slip per step"), table.number(row, "tick, p99")
        if cell is not None and cell.low is not None and cell.high is not None:
            axes.plot([x, x], [max(cell.low, 1e-6), cell.high], **spread)
        axes.plot([x, tail], [y, y], marker="|", markevery=[1], **spread)
        share = 100.0 * table.number(row, "falls")
        falls = f"falls in {share:.0f} % of walks" if share > 0.0 else "no falls"
        axes.plot(
            [x], [y], "o", markersize=9, zorder=3, color=colours[row], label=f"{row}\n{falls}"
        )
    for axis in (axes.xaxis, axes.yaxis):  # never as powers of ten
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.set_xlabel("time per complete tick, µs: median, line to the 99th percentile")
    axes.set_ylabel("slip, mm per step: median, 95 % interval")
    figure.legend(loc="outside right upper", frameon=False)
    return figure
