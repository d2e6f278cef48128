"""The command ``harpy demo``: three controllers on slippery ground, side by side."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from harpy_pin.cli.output import console, walking_bar
from harpy_pin.files import check_outputs

__all__ = ["demo"]

FRICTION = 0.15
DURATION = 4.0
"""s"""
NAME_WIDTH = 20
"""Columns of a controller's name."""
CONTROLLERS = ("governed", "condensed", "wbc")


def demo(
    html: Annotated[Path, typer.Option(metavar="FILE.html", help="The page to write.")] = Path("harpy_demo.html"),
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the page in the browser.")] = False,
) -> None:
    """Walk on slippery ground under three controllers.

    They are the paper's governor, the condensed controller and the whole-body QP, shown side by side.
    The friction coefficient is 0.15, and each walk lasts 4 s, if the robot does not fall.
    """
    check_outputs({"--html": html})
    from harpy_pin.ground.ground import Ground
    from harpy_pin.log.run import Run
    from harpy_pin.scenario import Scenario, build
    from harpy_pin.view.identity import name_of
    from harpy_pin.view.page.replay import write_html
    from harpy_pin.view.page.shown import scoreboard

    runs: list[Run] = []
    for controller in CONTROLLERS:
        scenario = Scenario(controller=controller, ground=Ground(mu_s=FRICTION), duration=DURATION)
        with walking_bar(DURATION) as on_piece:
            runs.append(build(scenario).run(on_piece=on_piece))
    scores = {score.label: score.values for score in scoreboard(runs)}
    for k, run in enumerate(runs):
        ending, slip, tick = (scores[label][k] for label in ("ending", "slip, mm per step", "tick, µs median"))
        console.print(
            f"{name_of(run):<{NAME_WIDTH}} {ending:<16} slip {slip:>6} mm per step   tick {tick:>3} µs", highlight=False
        )
    write_html(runs, html)
    console.print(f"wrote {html}", highlight=False)
    if not no_open:
        webbrowser.open(html.resolve().as_uri())
