"""Charts of the last five seconds: how much of the friction each foot uses, and its normal force."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import viser
from viser import uplot

from harpy_pin.view.palette import LEFT, RIGHT

__all__ = ["Charts"]

SPAN = 5.0
"""s."""
HEIGHT = 150
COLOURS, EDGES, DASH = (LEFT, RIGHT), ("#7fb8d8", "#eab48a"), (5.0, 4.0)
"""Of the feet: of what they use, and of what there is."""
MIN_LOAD = 3.0
"""Normal force below which the ratio of a foot is not drawn, N."""


class Charts:
    """Two charts with one time axis.

    Args:
        gui: of viser, in the container that they go into.
        feet: names.
    """

    def __init__(self, gui: viser.GuiApi, feet: tuple[str, ...]) -> None:
        self._rows: deque[tuple[float, ...]] = deque(maxlen=1000)
        self._feet = len(feet)
        lines = [
            uplot.Series(label=name.replace("_", " "), stroke=COLOURS[k % 2], width=1.5, points={"show": False})
            for k, name in enumerate(feet)
        ]
        edges = [
            uplot.Series(
                label=f"μ, {name.partition('_')[0]}", stroke=EDGES[k % 2], width=1.5, dash=DASH, points={"show": False}
            )
            for k, name in enumerate(feet)
        ]
        self._ratio = self._chart(gui, "Tangential / normal force", (*lines, *edges))
        self._load = self._chart(gui, "Normal force, N", tuple(lines))

    def _chart(self, gui: viser.GuiApi, title: str, series: tuple[uplot.Series, ...]) -> Any:
        empty = np.zeros(2)
        axis = uplot.Axis(stroke="#5b6573", font="11px sans-serif", size=30, grid={"stroke": "#e3e7ec", "width": 1})
        return gui.add_uplot(
            (np.array([-SPAN, 0.0]), *(empty for _ in series)),
            (uplot.Series(label="s"), *series),
            title=title,
            scales={"x": uplot.Scale(time=False), "y": uplot.Scale(auto=True)},
            axes=(axis, uplot.Axis(**{**axis, "size": 40})),
            legend=uplot.Legend(show=True, live=False),
            height=HEIGHT,
            padding=(4, 8, 0, 0),
        )

    def add(self, snapshots: Any) -> None:
        """Keep snapshots."""
        for s in snapshots:
            if self._rows and s["time"] <= self._rows[-1][0]:
                if s["time"] < self._rows[-1][0]:
                    self._rows.clear()
                else:
                    continue
            force = s["foot_force"]
            normal = np.maximum(force[:, 2], 0.0)
            tangential = np.hypot(force[:, 0], force[:, 1])
            ratio = np.where(normal > MIN_LOAD, tangential / np.maximum(normal, MIN_LOAD), 0.0)
            self._rows.append((float(s["time"]), *ratio, *s["friction"], *normal))

    def draw(self) -> None:
        """Show them."""
        if len(self._rows) < 2:
            return
        table = np.array(self._rows)
        table[:, 0] -= table[-1, 0]
        table = table[table[:, 0] >= -SPAN]
        feet = self._feet
        self._ratio.data = tuple(np.ascontiguousarray(column) for column in table[:, : 2 * feet + 1].T)
        self._load.data = tuple(np.ascontiguousarray(table[:, n]) for n in (0, *range(2 * feet + 1, 3 * feet + 1)))
