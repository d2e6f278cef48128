"""The command ``harpy film``: a robot walks, and a film of it is saved."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from harpy_pin import checks
from harpy_pin.cli.output import FELL, console, walking_bar
from harpy_pin.cli.walk_options import PushOption, SetOption, SpeedOption, read_scenario
from harpy_pin.errors import InputError
from harpy_pin.files import check_outputs

__all__ = ["film"]

KINDS = (".gif", ".mp4")
BEGIN = 0.4
"""Time at which a film begins, s: robots stand until they have shifted their weight."""


def film(
    path: Annotated[Path, typer.Argument(metavar="FILE.gif", help="The film to save: .gif, or .mp4 (extra: film).")],
    robot: Annotated[str, typer.Option(help="harpy, or a robot that `harpy robots` lists.")] = "go2",
    friction: Annotated[float, typer.Option(help="Static friction coefficient.")] = 0.6,
    speed: SpeedOption = None,
    push: PushOption = None,
    settings: SetOption = None,
    duration: Annotated[float, typer.Option(help="Length of the walk, s.")] = 3.0,
    size: Annotated[str, typer.Option(metavar="WxH", help="Pixels.")] = "420x280",
) -> None:
    """Walk a robot, and save a film of its replay.

    It shows forces in their friction cones, footholds and slip. Needs Chromium and the extra film. The film
    begins 0.4 s after the walk. Exit code 1 if the robot fell; the film is saved.

    \b
    harpy film anymal.gif --robot anymal_c --set gait.schedule=crawl
    harpy film stairs.gif --set ground.terrain=stairs --set ground.terrain.rise=0.08
    """
    if path.suffix.lower() not in KINDS:
        raise InputError(f"a film's name must end in {' or '.join(KINDS)}, got '{path}'", name="path", value=path)
    check_outputs({"FILE": path})
    checks.number("duration", duration, low=BEGIN, strict=True)
    from harpy_pin.cli.view import read_pixels
    from harpy_pin.scenario import build
    from harpy_pin.view.page.film import Film

    pixels = read_pixels(size)
    scenario = read_scenario(
        settings or (), robot=robot, friction=friction, speed=speed, push=push or (), duration=duration
    )
    with walking_bar(duration) as on_piece:
        run = build(scenario).run(on_piece=on_piece)
    with Film(run, words=False) as shot:
        console.print(f"wrote {shot.save(path, begin=BEGIN, size=pixels)}", highlight=False)
    if run.fell:
        raise typer.Exit(FELL)
