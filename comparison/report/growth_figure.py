"""Figure of growth: time against faces, feet held and degrees of freedom, both axes logarithmic."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from comparison.report.pareto_figure import write_plainly
from comparison.sections.growth import PARTS
from comparison.tables import Table
from harpy_pin.view.figures.style import styled
from harpy_pin.view.palette import CONTACT, SLIDING, TARGET, THRUST

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["growth_figure"]

_AXES = {
    "growth_faces": "faces of the friction pyramid",
    "growth_contacts": "feet held",
    "growth_freedoms": "degrees of freedom",
}
_COLOURS = ("#6b7480", SLIDING, THRUST, TARGET, "#7a3e9d", CONTACT)


@styled
def growth_figure(tables: Mapping[str, Table]) -> Figure:
    """Three panels that share the axis of time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 3.6), layout="constrained")
    panels = figure.subplots(1, len(_AXES), sharey=True)
    for panel, (name, axis) in zip(panels, _AXES.items(), strict=True):
        table = tables[name]
        rows = [row for row in table.rows if np.isfinite(table.number(row, "size"))]
        sizes = np.array([table.number(row, "size") for row in rows])
        order = np.argsort(sizes, kind="stable")
        for colour, text in zip(_COLOURS, PARTS.values(), strict=True):
            times = np.array([table.number(row, text) for row in rows])
            robots = [row.partition(",")[0] for row in rows]
            if name == "growth_contacts":  # a line for each robot
                for robot in dict.fromkeys(robots):
                    mine = [i for i in range(len(rows)) if robots[i] == robot]
                    panel.plot(sizes[mine], times[mine], marker="o", markersize=4, color=colour)
            else:
                panel.plot(sizes[order], times[order], marker="o", markersize=4, color=colour, label=text)
        panel.set_xscale("log", base=2)
        panel.set_yscale("log")
        panel.set_xticks(sorted(set(sizes)))
        write_plainly(panel.xaxis, panel.yaxis)
        panel.set_xlabel(axis)
        panel.grid(True, which="both", alpha=0.25)
    panels[0].yaxis.set_minor_formatter(panels[0].yaxis.get_major_formatter())
    panels[0].set_ylabel("median, µs")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    return figure
