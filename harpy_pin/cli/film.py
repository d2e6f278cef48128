"""The command ``harpy film``: a robot walks, and a film of it is saved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from harpy_pin import checks
from harpy_pin.cli.output import FELL, ScheduleOption, console, walking_bar
from harpy_pin.cli.terrain_option import TerrainOption, terrain_of
from harpy_pin.errors import InputError
from harpy_pin.files import check_outputs
from harpy_pin.model.catalogue import check_robot_name, known_name

__all__ = ["film"]

KINDS = (".gif", ".mp4")
BEGIN = 0.4
"""Time at which a film begins, s: robots stand until they have shifted their weight."""


def film(
    path: Annotated[Path, typer.Argument(metavar="FILE.gif", help="The film to save: .gif, or .mp4 (extra: film).")],
    robot: Annotated[str, typer.Option(help="harpy, or a robot that `harpy robots` lists and that walks.")] = "go2",
    command: Annotated[
        str | None, typer.Option(help='Velocity command, as in harpy walk: "0.5 0 0; 3s 0 0 0.5".', show_default=False)
    ] = None,
    schedule: ScheduleOption = None,
    jump: Annotated[bool, typer.Option("--jump", help="It jumps 0.3 m high. Harpy alone does.")] = False,
    friction: Annotated[float, typer.Option(help="Static friction coefficient.")] = 0.6,
    terrain: TerrainOption = None,
    duration: Annotated[float, typer.Option(help="Length of the walk, s.")] = 3.0,
    size: Annotated[str, typer.Option(metavar="WxH", help="Pixels.")] = "420x280",
) -> None:
    """Walk a robot, and save a film of its replay.

    It shows forces in their friction cones, footholds and slip. Needs Chromium on PATH. The film begins 0.4 s after the
    walk. Exit code 1 if the robot fell; the film is saved.

    \b
    harpy film go2.gif
    harpy film anymal.gif --robot anymal_c --schedule crawl
    harpy film turn.gif --robot g1 --command "0.2 0 0.2" --duration 6
    harpy film jump.gif --robot harpy --jump
    harpy film stairs.gif --terrain stairs:rise=0.08
    """
    if path.suffix.lower() not in KINDS:
        raise InputError(f"a film's name must end in {' or '.join(KINDS)}, got '{path}'", name="path", value=path)
    check_outputs({"FILE": path})
    checks.number("duration", duration, low=BEGIN, strict=True)
    robot = known_name(robot)
    check_robot_name(robot)
    from harpy_pin.cli.view import read_pair
    from harpy_pin.cli.walk_options import read_command
    from harpy_pin.model.robot import load_robot
    from harpy_pin.scenario import Scenario, build
    from harpy_pin.simulation.ground import Ground
    from harpy_pin.simulation.resting import walking_stiffness
    from harpy_pin.view.page.film import Film
    from harpy_pin.view.robot_of import robot_of

    width, height = read_pair("--size", size, "x")
    options: dict[str, Any] = {} if command is None else {"velocity": read_command(command)}
    if schedule is not None:
        options["schedule"] = schedule
    if jump and (robot != "harpy" or options):
        raise InputError("only Harpy jumps, and without a command or a schedule: give --robot harpy", name="jump")
    ground = Ground(mu_s=friction, terrain=terrain_of(terrain))
    gait: dict[str, Any] = {"name": "flying" if jump else "commanded", **options}
    if robot != "harpy":
        ground = replace(ground, stiffness=walking_stiffness(load_robot(robot)), damping=None)
        gait["name"] = "walking"
    scenario = Scenario(robot=robot, gait=gait, ground=ground, duration=duration)
    with walking_bar(duration) as on_piece:
        run = build(scenario).run(on_piece=on_piece)
    with Film([(run, robot_of(run))], words=False) as shot:
        save = shot.gif if path.suffix.lower() == ".gif" else shot.mp4
        console.print(f"wrote {save(path, begin=BEGIN, size=(int(width), int(height)))}", highlight=False)
    if run.fell:
        raise typer.Exit(FELL)
