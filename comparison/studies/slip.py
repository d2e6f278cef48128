"""Walk every controller on ever more slippery ground.

The controllers know the friction; there is no push and no error. The table shows how far the feet
slip in each step, and when the robot fell.
"""

from typing import Any

import harpy_pin as hp
from comparison.contenders import WALKERS, label
from comparison.study import (
    Job,
    Rows,
    Study,
    View,
    grid,
    grouped,
    number_text,
    scenario_of,
    walk_as_far_as_it_goes,
)

_COLOURS = ("#7a869a", "#c8553d", "#e09f3e", "#8e7cc3", "#4c956c", "#2c6e9b", "#1b1b1e")


def _measured(job: Job) -> dict[str, Any]:
    scenario = scenario_of(job["walker"], job["friction"], duration=job["duration"])
    return how_far(walk_as_far_as_it_goes(scenario))


def how_far(run: hp.Run) -> dict[str, Any]:
    """How far feet slip in a step, and how long the robot stood."""
    found = hp.measure(run)
    return {"fell": found.fell, "stood_s": found.duration_s, "slip_mm": found.slip_mm_per_step}


def slip_of(rows: Rows) -> str:
    """The slip of one walk, and when it fell."""
    (row,) = rows
    return number_text(row["slip_mm"]) + (f" (fell {row['stood_s']:.1f} s)" if row["fell"] else "")


def _draw(figure: Any, rows: Rows) -> None:
    figure.set_size_inches(6.4, 3.6)
    panel = figure.subplots()
    frictions = [friction for (friction,) in grouped(rows, "friction")]
    for (colour, ((walker,), mine)), marker in zip(
        zip(_COLOURS, grouped(rows, "walker").items(), strict=False), "osD^vPX", strict=False
    ):
        faces = ["white" if row["fell"] else colour for row in mine]
        x, slip = (
            [frictions.index(row["friction"]) for row in mine],
            [row["slip_mm"] for row in mine],
        )
        panel.plot(x, slip, color=colour)
        panel.plot([], [], marker, color=colour, label=label(walker))
        panel.scatter(x, slip, 36.0, faces, marker=marker, edgecolors=colour, zorder=3)
    panel.set_xticks(range(len(frictions)), [f"{mu:g}" for mu in frictions])
    panel.set(yscale="log", xlabel="friction coefficient of the ground", ylabel="slip, mm per step")
    panel.set_title("What each keeps from slipping (hollow: it fell)", loc="left")
    figure.legend(loc="outside right upper", frameon=False)


STUDY = Study(
    name="slip",
    help=__doc__,
    defaults={
        "walkers": (*WALKERS[:2], "paper/tracked/pid", *WALKERS[2:]),
        "frictions": (0.25, 0.2, 0.15, 0.1),
        "duration": 20.0,  # s
    },
    quick={"duration": 1.5},
    jobs=lambda s: grid(friction=s.frictions, walker=s.walkers, duration=s.duration),
    measure=_measured,
    views=[
        View(
            "slip",
            "Slip per step in walks of {duration:g} s, mm",
            row=lambda row: label(row["walker"]),
            across="{friction:g}",
            columns=slip_of,
        )
    ],
    draw=_draw,
)
