"""The map of slopes: for every walker a panel of friction by angle, with who stands where statics allow it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from comparison.measure.walking import Rows, grouped
from comparison.studies.slopes import WALKERS, how_it_stands
from harpy_pin.view.figures import styled
from harpy_pin.view.palette import CONTACT, SLIDING, THRUST

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"stands": CONTACT, "slides": THRUST, "falls": SLIDING, "not possible": "#d9dee4"}
"""Of what happens; the last one where statics do not allow to stand, and it does not."""
COLUMNS = 5
"""Panels in a row."""


@styled
def slopes_figure(rows: Rows) -> Figure:
    """A panel for each walker.

    Args:
        rows: of the study :mod:`comparison.studies.slopes`.
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    walkers = grouped(rows, "walker")
    down = -(-len(walkers) // COLUMNS)
    figure = Figure(figsize=(8.4, 0.6 + 2.3 * down), layout="constrained")
    panels = figure.subplots(down, min(COLUMNS, len(walkers)), sharex=True, sharey=True, squeeze=False)
    names = list(COLOURS)
    for panel in panels.ravel()[len(walkers) :]:
        panel.axis("off")
    for panel, ((walker,), here) in zip(panels.ravel(), walkers.items(), strict=False):
        degrees, frictions = (sorted({row[name] for row in here}) for name in ("degrees", "friction"))
        cells = np.zeros((len(degrees), len(frictions)))
        for row in here:
            place = degrees.index(row["degrees"]), frictions.index(row["friction"])
            cells[place] = names.index(what_happens(row))
        colours = ListedColormap(list(COLOURS.values()))
        panel.pcolormesh(frictions, degrees, cells, cmap=colours, vmin=-0.5, vmax=len(names) - 0.5, edgecolor="white")
        panel.set_title(WALKERS[walker].name, fontsize=9)
    for panel in panels[:, 0]:
        panel.set_ylabel("angle, degrees")
    for panel in panels[-1]:
        panel.set_xlabel("friction")
    handles = [Patch(color=colour, label=name) for name, colour in COLOURS.items()]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), frameon=False)
    return figure


def what_happens(row: dict[str, object]) -> str:
    """A name of :data:`COLOURS`; a walker without thrust is measured by what statics allow without it."""
    seen = how_it_stands(row)
    possible = row["without_thrust"] if row["walker"] == "no_thrust" else row["least_thrust"] is not None
    return seen if seen == "stands" or possible else "not possible"
