"""Walk with a wrong friction coefficient.

Every controller assumes from half to two and a half times the friction of the ground, without and
with the friction estimated. In the figure a vertical line is where the margin of the WBCs ends.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.contenders import WALKERS, controller_part, label
from comparison.study import (
    STARTS,
    Job,
    Rows,
    Study,
    View,
    grid,
    grouped,
    number_text,
    start_velocity,
    starts,
    walking,
)

PUSH = hp.Push(2.0, (0.0, 3.0, 0.0))
_COLOURS = ("#7a869a", "#c8553d", "#e09f3e", "#8e7cc3", "#4c956c", "#2c6e9b")


def _jobs(s: Any) -> Iterator[Job]:
    every = grid(
        friction=s.frictions, walker=s.walkers, estimate=(False, True), error=s.errors, **starts(s)
    )
    # The ungoverned one assumes nothing.
    return (job for job in every if job["walker"] != WALKERS[0] or not job["estimate"])


def _scenario(job: Job) -> hp.Scenario:
    part = controller_part(job["walker"], (1.0 + job["error"]) * job["friction"])
    return hp.Scenario(
        controller=replace(
            part, parameters={**part.parameters, "estimate_friction": job["estimate"]}
        ),
        ground=hp.Ground(mu_s=job["friction"]),
        disturbances=hp.Disturbances(pushes=(PUSH,), start_velocity=start_velocity(job)),
        duration=job["duration"],
    )


def _slip(rows: Rows) -> str:
    slip, falls = (
        float(np.median([row["slip_mm_per_step"] for row in rows])),
        sum(row["fell"] for row in rows),
    )
    return number_text(slip) + (f" ({falls} fell)" if falls else "")


def _draw(figure: Any, rows: Rows) -> None:
    frictions = grouped(rows, "friction")
    figure.set_size_inches(8.0, 3.6)
    panels = figure.subplots(1, len(frictions), sharey=True, squeeze=False)[0]
    for panel, ((friction,), here) in zip(panels, frictions.items(), strict=True):
        for colour, (walker, mine) in zip(_COLOURS, grouped(here, "walker").items(), strict=True):
            for estimate, style in ((False, "-"), (True, ":")):
                points = grouped([row for row in mine if row["estimate"] == estimate], "error")
                x = 100.0 * np.array([error for (error,) in points])
                slip = np.array(
                    [
                        np.median([row["slip_mm_per_step"] for row in same])
                        for same in points.values()
                    ]
                )
                fell = np.array(
                    [any(row["fell"] for row in same) for same in points.values()], dtype=bool
                )
                name, width = (
                    None if estimate else label(walker[0]),
                    4.0 if walker[0] == "condensed" else 1.5,
                )
                panel.plot(
                    x, slip, style, color=colour, label=name, lw=width
                )  # the QP's line lies on the condensed
                panel.plot(x[fell], slip[fell], "x", color=colour)
        panel.plot([], [], "k:", label="friction estimated")
        panel.plot([], [], "kx", label="walks fell")
        end = 100.0 / hp.wbc.WholeBodyLimits().friction_share - 100.0
        panel.axvline(end, color="#9aa5b1", zorder=0, label="end of the WBCs' margin")
        panel.set(
            yscale="log", title=f"ground of {friction:g}", xlabel="error of the assumed friction, %"
        )
    panels[0].set_ylabel("slip, mm per step")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", frameon=False)


STUDY = Study(
    name="assumption",
    help=__doc__,
    defaults={
        **STARTS,
        "starts": 3,
        "walkers": WALKERS,
        "frictions": (0.15, 0.25),
        "errors": (-0.5, -0.3, 0.0, 0.3, 0.5, 1.0, 1.5),
        "duration": 8.0,  # s
    },
    quick={"starts": 1, "frictions": (0.25,), "errors": (0.0, 1.0), "duration": 3.0},
    jobs=_jobs,
    measure=walking(_scenario, "slip_mm_per_step"),
    views=[
        View(
            "assumption_{friction:g}",
            "Slip by the error of the assumed friction, ground of {friction:g}, mm per step",
            row=lambda row: (
                label(row["walker"]) + (", friction estimated" if row["estimate"] else "")
            ),
            across=lambda row: f"{row['error']:+.0%}" if row["error"] else "right",
            columns=_slip,
            note="Medians over the starts, with a push of 3 N·s; a walk that falls counts up to "
            "its fall.",
        )
    ],
    draw=_draw,
)
