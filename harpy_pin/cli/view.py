"""The commands ``harpy view`` and ``harpy film``: replays of runs, alone or side by side, pictures
and films.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harpy_pin import checks
from harpy_pin.cli import walk_options as options
from harpy_pin.cli.output import FELL, console, say_next, walking_bar
from harpy_pin.errors import InputError
from harpy_pin.files import check_outputs, replacing

if TYPE_CHECKING:
    from harpy_pin.log.run import Run
    from harpy_pin.model.robot import Robot

MAX_RUNS = 4
KINDS: dict[str, tuple[str, ...]] = {
    **{f"--{kind}": (f".{kind}",) for kind in ("png", "gif", "mp4", "csv")},
    "--figures": (".png", ".pdf", ".svg"),
    "FILE": (".gif", ".mp4"),
}
"""Endings of the names of files, by what the user calls them."""
BEGIN = 0.4
"""Time at which the film of a walk begins, s: robots stand until they have shifted their weight."""


def view(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="RUN.npz...", help="One to four logs of harpy walk --save."),
    ],
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html", help="Write one self-contained page instead of serving it live."
        ),
    ] = None,
    png: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="Save a picture, or one for each of --times."),
    ] = None,
    times: Annotated[
        str | None,
        typer.Option(
            metavar="T,T,...", help="Moments of the pictures, s; the most telling one by default."
        ),
    ] = None,
    gif: Annotated[
        Path | None, typer.Option(metavar="FILE.gif", help="Save an animated GIF.")
    ] = None,
    mp4: Annotated[
        Path | None, typer.Option(metavar="FILE.mp4", help="Save a film (extra: film).")
    ] = None,
    span: Annotated[
        str | None,
        typer.Option(
            metavar="FROM:TO", help="Part of the run that is filmed, s; all of it by default."
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(
            metavar="WxH", help="Pixels of pictures and films.  [default: 1200x675, GIF 640x400]"
        ),
    ] = None,
    figures: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The page's charts as figures: .png, .pdf or .svg."),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="Export all signals as a table.")
    ] = None,
    charts: Annotated[
        bool, typer.Option("--charts", help="Pictures and films of the whole page, charts too.")
    ] = False,
    port: Annotated[
        int,
        typer.Option(help="Port of the live page; any free one by default.", show_default=False),
    ] = 0,
    urdf: Annotated[
        Path | None,
        typer.Option(
            "--robot",
            "--urdf",
            metavar="FILE",
            help="URDF, MJCF or name, if the log leads to no robot.",
        ),
    ] = None,
) -> None:
    """Replay runs in the browser, with forces and charts.

    Several runs are played in step, with their measures beside each other. Pictures and films need
    Chromium and the extra film. Without --html, pictures, films or figures the page is served until
    Ctrl-C (code 130; 143 on SIGTERM).

    \b
    harpy view walk.npz --png walk.png --times 1.2,1.4
    harpy view paper.npz condensed.npz --gif walk.gif --span 0:4
    harpy view walk.npz --figures walk.pdf --csv walk.csv
    """
    checks.whole("port", port, high=65535)
    if len(runs) > MAX_RUNS:
        raise InputError(
            f"at most {MAX_RUNS} runs are shown side by side, got {len(runs)}", name="runs"
        )
    outputs = {"--html": html, "--png": png, "--gif": gif, "--mp4": mp4, "--csv": csv}
    check_outputs(outputs, inputs={f"RUN.npz {k + 1}": run for k, run in enumerate(runs)})
    pictured = any(path is not None for path in (png, gif, mp4))
    for name, path in {**outputs, "--figures": figures}.items():
        _check_ending(name, path)
    if len(runs) > 1 and (figures is not None or csv is not None):
        raise InputError("--figures and --csv are of one run", name="runs")
    if times is not None and png is None:
        raise InputError(
            "--times says when to take pictures: give --png", name="times", value=times
        )
    moments = None if times is None else _numbers("--times", times, ",")
    begin, end = (None, None) if span is None else _numbers("--span", span, ":", 2)
    pixels = None if size is None else _pixels(size)
    from harpy_pin.log.run import Run
    from harpy_pin.view.identity import robot_of

    logs = [Run.load(path) for path in runs]
    if csv is not None:
        logs[0].to_csv(csv)
        console.print(f"wrote {csv}")
        if html is None and figures is None and not pictured:
            say_next(f"harpy view {runs[0]}")
            return
    from harpy_pin.view.page.replay import show, write_html

    pairs = [(log, robot_of(log, urdf)) for log in logs]
    if html is not None:
        write_html(pairs, html)
        console.print(f"wrote {html}")
    if figures is not None:
        draw_figures(*pairs[0], figures)
    if pictured:
        from harpy_pin.view.page.film import Film

        with Film(pairs, charts=charts) as film:
            made = [] if png is None else film.pictures(png, moments, size=pixels or (1200, 675))
            made += [
                film.save(path, begin=begin, end=end, size=pixels)
                for path in (gif, mp4)
                if path is not None
            ]
            for path in made:
                console.print(f"wrote {path}")
    elif html is None and figures is None:
        show(pairs, port=port).wait()
    say_next(
        f"harpy view {runs[0]} --html walk.html" if html is None else f"open {html} in a browser"
    )


def film(
    path: Annotated[
        Path,
        typer.Argument(metavar="FILE.gif", help="The film to save: .gif, or .mp4 (extra: film)."),
    ],
    robot: options.RobotOption = "go2",
    feet: options.FeetOption = None,
    flat_feet: options.FlatFeetOption = None,
    loops: options.LoopsOption = None,
    posture: options.PostureOption = None,
    friction: options.FrictionOption = None,
    speed: options.SpeedOption = None,
    push: options.PushOption = None,
    settings: options.SetOption = None,
    duration: Annotated[float, typer.Option(help="Length of the walk, s.")] = 3.0,
    size: Annotated[str, typer.Option(metavar="WxH", help="Pixels.")] = "420x280",
) -> None:
    """Walk a robot, and save a film of its replay.

    Needs Chromium and the extra film. It begins 0.4 s after the walk. Exit code 1 if the robot
    fell.

    \b
    harpy film anymal.gif --robot anymal_c --set gait.schedule=crawl --friction 0.6
    harpy film stairs.gif --set ground.terrain=stairs --set ground.terrain.rise=0.08 --friction 0.6
    """
    _check_ending("FILE", path)
    check_outputs({"FILE": path})
    checks.number("duration", duration, low=BEGIN, strict=True)
    from harpy_pin.scenario import build
    from harpy_pin.view.page.film import Film

    pixels = _pixels(size)
    walk: dict[str, Any] = {
        "friction": friction,
        "speed": speed,
        "push": push or (),
        "duration": duration,
    }
    walk |= {"feet": feet, "flat_feet": flat_feet, "loops": loops, "posture": posture}
    scenario = options.read_scenario(settings or (), robot=robot, **walk)
    with walking_bar(duration) as on_piece:
        run = build(scenario).run(on_piece=on_piece)
    with Film(run, words=False) as shot:
        console.print(f"wrote {shot.save(path, begin=BEGIN, size=pixels)}")
    say_next(f"harpy live --robot {robot}")
    if run.fell:
        raise typer.Exit(FELL)


def draw_figures(run: Run, robot: Robot, path: Path) -> None:
    """Save the figures of a run."""
    from harpy_pin.view.figures import figures_of

    drawn = {
        path.with_stem(f"{path.stem}-{group}"): figure
        for group, figure in figures_of(run, robot).items()
    }
    check_outputs({f"--figures ({target.stem})": target for target in drawn})
    for target, figure in drawn.items():
        with replacing(target) as file:
            figure.savefig(file, format=path.suffix[1:].lower())
        console.print(f"wrote {target}")


def _check_ending(name: str, path: Path | None) -> None:
    """Refuse a name of a file that does not end as its kind asks, before any work is done."""
    if path is not None and name in KINDS and path.suffix.lower() not in KINDS[name]:
        ends = " or ".join(KINDS[name])
        raise InputError(
            f"{name} wants a name that ends in {ends}, got '{path}'", name=name, value=path
        )


def _numbers(option: str, text: str, between: str, count: int | None = None) -> list[float]:
    """Numbers of an option, with a sign between them."""
    parts = text.lower().split(between)
    if count is not None and len(parts) != count:
        raise InputError(
            f"{option} must be {count} numbers with '{between}' between, got '{text}'",
            name=option,
            value=text,
        )
    try:
        return [checks.number(option, float(part)) for part in parts]
    except ValueError:
        raise InputError(f"{option} takes numbers, got '{text}'", name=option, value=text) from None


def _pixels(text: str) -> tuple[int, int]:
    """Width and height of the option ``--size``."""
    width, height = _numbers("--size", text, "x", 2)
    return int(width), int(height)
