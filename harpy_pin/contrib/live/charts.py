"""Charts of the live page: what the feet carry and use of the friction, over the last seconds."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
import viser
from viser import uplot

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.palette import FEET

SPAN = 5.0
"""s."""
HEIGHT = 150
EDGES, DASH = ("#7fb8d8", "#eab48a"), (5.0, 4.0)
"""Colours and dashes of the friction that there is under the feet; of more than two feet, the
least.
"""
MIN_LOAD = 3.0
"""Normal force below which the ratio of a foot is not drawn, N."""


class Charts:
    """Two charts with one time axis.

    Args:
        gui: of viser, in the container that they go into.
        feet: of the robot.
    """

    def __init__(self, gui: viser.GuiApi, feet: WholeFeet) -> None:
        self._rows: deque[tuple[float, ...]] = deque(maxlen=1000)
        self._whole = feet
        names = feet.names
        self._feet, self._edges = len(names), len(names) if len(names) <= len(EDGES) else 1
        style = {"width": 1.5, "points": {"show": False}}
        edge_names = (
            [f"μ, {name.partition('_')[0]}" for name in names] if self._edges > 1 else ["μ"]
        )
        edges: Any = [
            {"label": n, "stroke": EDGES[k], "dash": DASH, **style}
            for k, n in enumerate(edge_names)
        ]
        lines: Any = [
            {"label": name.replace("_", " "), "stroke": FEET[k % len(FEET)], **style}
            for k, name in enumerate(names)
        ]
        self._ratio = self._chart(gui, "Tangential / normal force", (*lines, *edges))
        self._load = self._chart(gui, "Normal force, N", tuple(lines))

    def _chart(self, gui: viser.GuiApi, title: str, series: tuple[uplot.Series, ...]) -> Any:
        empty = np.zeros(2)
        axis = uplot.Axis(
            stroke="#5b6573",
            font="11px sans-serif",
            size=30,
            grid={"stroke": "#e3e7ec", "width": 1},
        )
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
            if self._rows and s["t"] == self._rows[-1][0]:
                continue
            force, friction = (
                self._whole.force(s["contact_force"]),
                self._whole.least(s["foot_friction"]),
            )
            if self._edges == 1:
                friction = friction.min(keepdims=True)
            normal = np.maximum(force[:, 2], 0.0)
            tangential = np.hypot(force[:, 0], force[:, 1])
            ratio = np.where(normal > MIN_LOAD, tangential / np.maximum(normal, MIN_LOAD), 0.0)
            self._rows.append((float(s["t"]), *ratio, *friction, *normal))

    def draw(self) -> None:
        """Show them."""
        if len(self._rows) < 2:
            return
        table = np.array(self._rows)
        table[:, 0] -= table[-1, 0]
        table = table[table[:, 0] >= -SPAN]
        first = 1 + self._feet + self._edges  # of the columns of normal forces
        self._ratio.data = tuple(np.ascontiguousarray(column) for column in table[:, :first].T)
        self._load.data = tuple(
            np.ascontiguousarray(table[:, n]) for n in (0, *range(first, first + self._feet))
        )


class WholeFeet:
    """Which contact points are one foot.

    Args:
        robot: with feet.

    Attributes:
        names: of the feet.
    """

    def __init__(self, robot: Robot) -> None:
        self._starts = np.cumsum((0, *robot.corners[:-1]))
        flat = bool(robot.flat_feet)
        firsts = [robot.feet[start] for start in self._starts]
        self.names = tuple(name.rpartition("_")[0] if flat else name for name in firsts)

    def force(self, points: Vector) -> Vector:
        """(feet, 3) sums of the forces of the contact points, N."""
        return np.asarray(np.add.reduceat(points, self._starts, axis=0))

    def least(self, values: Vector) -> Vector:
        """(feet,) the least value among the contact points of each foot."""
        return np.asarray(np.minimum.reduceat(values, self._starts))
