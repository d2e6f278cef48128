"""The command ``harpy live``: drive the robot in the browser."""

import logging
import webbrowser
from importlib.util import find_spec
from pathlib import Path
from signal import SIGTERM
from threading import Thread
from typing import Annotated

import typer

from harpy_pin import checks
from harpy_pin.cli import walk_options as options
from harpy_pin.cli.output import INTERRUPTED, TERMINATED, console, say_next
from harpy_pin.errors import HarpyError, InputError, install_line
from harpy_pin.files import check_outputs, journal_path, write_json

LONGEST = 1e6
"""Longest drive, s."""


def live(
    robot: options.RobotOption = "harpy",
    feet: options.FeetOption = None,
    flat_feet: options.FlatFeetOption = None,
    loops: options.LoopsOption = None,
    posture: options.PostureOption = None,
    friction: Annotated[
        float, typer.Option(help="Static friction coefficient; sliding friction is 0.9 of it.")
    ] = 0.8,
    speed: Annotated[float, typer.Option(help="Forward velocity at the start, m/s.")] = 0.0,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Another setting, such as slope=0.17."),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(
            help="Time of the clock after which it ends, s; Ctrl-C without.", show_default=False
        ),
    ] = None,
    save: Annotated[
        Path | None,
        typer.Option(metavar="FILE.npz", help="Write what is driven as a log, while it is driven."),
    ] = None,
    json: options.JsonOption = None,
    host: Annotated[
        str,
        typer.Option(
            help="Address to serve the page on; others than this machine's let others drive."
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(help="Port of the page; any free one by default.", show_default=False)
    ] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")
    ] = True,
    urdf: options.UrdfOption = None,
) -> None:
    """Drive a robot in the browser, in real time.

    --set takes what the page has by the names of harpy_pin.contrib.live.settings.LiveSettings. The
    page is this machine's alone. Ctrl-C ends it (exit code 130; 143 on SIGTERM). If the process
    dies, harpy view reads FILE.npz.part.

    \b
    harpy live --set controller=paper --friction 0.25 --speed 0.3
    harpy live --robot anymal_c --set schedule=crawl --speed 0.3
    harpy live --duration 20 --speed 0.3 --no-browser --json times.json
    """
    walker = options.read_robot_options(robot, feet, posture, flat_feet, loops)
    if urdf is not None and walker != "harpy":
        raise InputError("--urdf is a variant of Harpy: it does not go with --robot", name="urdf")
    if duration is not None:
        checks.number("duration", duration, low=1e-3, high=LONGEST)
    check_outputs(
        {"--save": save, "--json": json},
        inputs={"the journal of --save": None if save is None else journal_path(save)},
    )
    if find_spec("viser") is None:
        raise HarpyError(f"driving needs viser, which is not installed: {install_line('live')}")
    from harpy_pin.contrib.live.drive import Drive
    from harpy_pin.contrib.live.settings import DriveRanges, usual_settings
    from harpy_pin.model.loading import load_harpy
    from harpy_pin.model.source import loaded_robot

    driven_robot = load_harpy(urdf) if walker == "harpy" else loaded_robot(walker)
    ranges = DriveRanges.of(driven_robot)
    checks.number("speed", speed, low=-ranges.forward, high=ranges.forward)
    changes = {"friction": friction, "forward": speed, **options.read_settings(settings or ())}
    start = usual_settings(driven_robot).changed(changes)
    logging.getLogger("harpy_pin.compiling").setLevel(logging.ERROR)  # the line below says it

    def show(url: str) -> None:
        console.print(
            f"{url} shows {driven_robot.name} standing; compiling the controllers", soft_wrap=True
        )
        if browser:
            Thread(target=webbrowser.open, args=(url,), daemon=True).start()

    drive = Drive(start, robot=driven_robot, save=save, address=(host, port), on_page=show)
    console.print(f"drive {driven_robot.name}: {drive.url}  (Ctrl-C ends)")
    driven = drive.run(duration)
    console.print(
        f"drove {driven.simulated:.1f} s at {driven.factor:.2f} × real time; falls {driven.falls}, "
        f"slip {1e3 * driven.slip:.1f} mm"
    )
    times = driven.as_dict()
    for viewers, tick in times["tick_us"].items():
        console.print(
            f"tick, pages open {viewers}: median {tick['p50']:.1f} µs, p99 {tick['p99']:.1f} µs "
            f"({tick['ticks']} ticks)"
        )
    if json is not None:
        write_json(json, times)
    if save is not None:
        console.print(f"log: {save}", soft_wrap=True)
    say_next("the same with --save drive.npz" if save is None else f"harpy view {save}")
    if driven.signal is not None:
        raise typer.Exit(TERMINATED if driven.signal == SIGTERM else INTERRUPTED)
