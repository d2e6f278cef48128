"""The style of the figures, and panels that share a time axis."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["grid", "legend_above", "styled"]

_STYLE: dict[str, Any] = {
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
_P = ParamSpec("_P")


def styled(draw: Callable[_P, Figure]) -> Callable[_P, Figure]:
    """Draws in the style of this file, whatever the user's own is."""

    @wraps(draw)
    def drawn(*args: _P.args, **kwargs: _P.kwargs) -> Figure:
        import matplotlib

        with matplotlib.rc_context(_STYLE):  # type: ignore[arg-type]
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
