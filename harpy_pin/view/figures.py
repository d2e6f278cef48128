"""Figures: the charts of a run for print, and the style of all figures.

They are plain ``matplotlib.figure.Figure`` objects, tied to no window: save them with
``figure.savefig("feet.pdf")``.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from harpy_pin.arguments import checked
from harpy_pin.errors import HarpyError, install_line
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.view.page.charts import Chart, charts_of
from harpy_pin.view.page.shown import line_up

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLE: dict[str, Any] = {
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 9.5,
    "legend.fontsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dde3ea",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "axes.axisbelow": True,
    "savefig.dpi": 200,
}
PANEL = (6.4, 1.5)
"""Width and height of a chart, inches."""
ROWS = 6
"""Charts one above the other; more stand beside them."""
P = ParamSpec("P")
Drawn = TypeVar("Drawn")


def styled(draw: Callable[P, Drawn]) -> Callable[P, Drawn]:
    """Draws in the style of this file, whatever the user's own is."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Drawn:
        try:
            import matplotlib
        except ImportError as error:
            raise HarpyError(
                f"figures need Matplotlib ({error}): {install_line('view')}"
            ) from error
        with matplotlib.rc_context(STYLE):  # type: ignore[arg-type]
            return draw(*args, **kwargs)

    return drawn


def grid(
    rows: int, columns: int, *, width: float, height: float, sharey: Any = False
) -> tuple[Figure, list[list[Axes]]]:
    """Figure with panels that share their time axis; sizes in inches."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(max(width, 4.5), height), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=sharey, squeeze=False)
    return figure, [list(row) for row in panels]


def legend_above(panel: Axes) -> None:
    """Legend above the lines, where it hides none of them."""
    panel.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=4,
        frameon=False,
        borderaxespad=0.1,
        columnspacing=1.0,
        handlelength=1.2,
        handletextpad=0.5,
    )


@styled
@checked
def figures_of(run: Run, robot: Robot | None = None) -> dict[str, Figure]:
    """The charts of a run's replay as figures, by group: ``feet``, ``body``, ``effort`` and, if
    logged, ``command``.

    Args:
        run: the log.
        robot: that was logged; found from the log by default.

    Raises:
        InputError: the run holds nothing to draw, or is of another robot.
    """
    charts = charts_of(line_up(run if robot is None else [(run, robot)]))
    groups = {chart.group: [one for one in charts if one.group == chart.group] for chart in charts}
    return {name.lower(): _draw(group) for name, group in groups.items()}


def _draw(charts: list[Chart]) -> Figure:
    """Charts one above the other, with one time axis."""
    columns = -(-len(charts) // ROWS)
    rows = -(-len(charts) // columns)
    figure, axes = grid(rows, columns, width=PANEL[0] * columns, height=PANEL[1] * rows + 0.3)
    panels = [axes[row][column] for column in range(columns) for row in range(rows)]
    for panel, chart in zip(panels, charts, strict=False):
        for line in chart.lines:
            if line.filled:
                values = np.nan_to_num(line.values)
                panel.fill_between(
                    line.time,
                    values,
                    color=line.colour,
                    alpha=0.35,
                    linewidth=0.0,
                    label=line.label,
                )
            else:
                style = "--" if line.dashed else "-"
                panel.plot(
                    line.time, line.values, color=line.colour, linestyle=style, label=line.label
                )
        if chart.level is not None:
            panel.axhline(
                chart.level[0], color="#444444", linestyle=":", linewidth=0.9, label=chart.level[1]
            )
        panel.set_ylim(chart.low, chart.high)
        panel.set_title(chart.title, loc="right")
        panel.set_ylabel(chart.unit)
        legend_above(panel)
    for panel in panels[len(charts) :]:
        panel.set_axis_off()
    for column in range(columns):
        panels[min((column + 1) * rows, len(charts)) - 1].set_xlabel("time (s)")
    return figure
