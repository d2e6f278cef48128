"""Slip of several controllers over friction, in one figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from harpy_pin.errors import InputError
from harpy_pin.view.figures.style import styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["slip_figure"]

_COLOURS = ("#7a869a", "#c8553d", "#e09f3e", "#8e7cc3", "#4c956c", "#2c6e9b", "#1b1b1e", "#b56576")
_MARKERS = "osD^vPX*"


@styled
def slip_figure(rows: Sequence[tuple[str, float, float, bool]]) -> Figure:
    """Slip per step against the friction of the ground.

    Args:
        rows: (name, friction, slip in mm per step, whether it fell) of each walk; a fall is drawn as a hollow mark.

    Raises:
        InputError: no rows.
    """
    from matplotlib.figure import Figure

    if not rows:
        raise InputError("there is no walk to draw", name="rows")
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    panel = figure.subplots()
    frictions = sorted({mu for _, mu, _, _ in rows}, reverse=True)
    for k, name in enumerate(dict.fromkeys(name for name, *_ in rows)):
        mine = sorted((frictions.index(mu), slip, fell) for other, mu, slip, fell in rows if other == name)
        colour, marker = _COLOURS[k % len(_COLOURS)], _MARKERS[k % len(_MARKERS)]
        panel.plot([x for x, *_ in mine], [slip for _, slip, _ in mine], color=colour, zorder=2 + k)
        for fell in (False, True):
            points = [(x, slip) for x, slip, down in mine if down == fell]
            panel.plot(
                [x for x, _ in points],
                [slip for _, slip in points],
                marker,
                color=colour,
                markerfacecolor="white" if fell else colour,
                markersize=6.0,
                label=name if not fell else None,
                zorder=2 + k,
            )
    panel.set_yscale("log")
    panel.set_xticks(range(len(frictions)), [f"{mu:g}" for mu in frictions])
    panel.set_xlabel("friction coefficient of the ground")
    panel.set_ylabel("slip, mm per step")
    panel.set_title("What each keeps from slipping (hollow: it fell)", loc="left")
    figure.legend(loc="outside right upper", frameon=False)
    return figure
