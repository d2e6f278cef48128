"""The command ``harpy view``: replay a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from harpy_pin import checks
from harpy_pin.cli.output import UrdfOption, console
from harpy_pin.files import check_outputs

__all__ = ["view"]


def view(
    run: Annotated[Path, typer.Argument(metavar="RUN.npz", help="A log written by harpy walk --save.")],
    html: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Write one self-contained page instead of serving it live.")
    ] = None,
    port: Annotated[int, typer.Option(help="Port of the live page; any free one by default.", show_default=False)] = 0,
    urdf: UrdfOption = None,
) -> None:
    """Replay a run in the browser: robot, contact forces, friction cones, thrust, target and applied reference.

    \b
    harpy view walk.npz
    harpy view walk.npz --html walk.html
    """
    checks.whole("port", port, high=65535)
    check_outputs({"--html": html}, inputs={"RUN.npz": run})
    from harpy_pin.model.robot import load_harpy
    from harpy_pin.plant.run import Run
    from harpy_pin.view.page.replay import show, write_html

    log = Run.load(run)
    robot = load_harpy(urdf)
    if html is None:
        show(log, robot, port=port).wait()
        return
    write_html(log, robot, html)
    console.print(f"wrote {html}", highlight=False)
