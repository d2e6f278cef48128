"""The commands ``harpy walk``, which measures and reports a scenario, and ``harpy demo``, three on
slippery ground.
"""

from __future__ import annotations

import math
import webbrowser
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harpy_pin.cli import walk_options as options
from harpy_pin.cli.ending import say
from harpy_pin.cli.output import (
    FELL,
    INTERRUPTED,
    console,
    say_next,
    stderr,
    values_table,
    walking_bar,
)
from harpy_pin.errors import ControlError, InputError, Interrupted, RunFileError
from harpy_pin.files import Shield, check_outputs, journal_path, write_json

if TYPE_CHECKING:
    from harpy_pin.log.run import Run
    from harpy_pin.scenario import Scenario

SLIPPERY, SHOWN = 0.15, 4.0  # friction of the demo, and how long each of its walks is, s
NAME_WIDTH = 22  # columns of a controller's name


def walk(
    robot: Annotated[str | None, typer.Option(help=options.ROBOTS, show_default=False)] = None,
    feet: options.FeetOption = None,
    flat_feet: options.FlatFeetOption = None,
    loops: options.LoopsOption = None,
    posture: options.PostureOption = None,
    friction: options.FrictionOption = None,
    speed: options.SpeedOption = None,
    push: options.PushOption = None,
    settings: options.SetOption = None,
    duration: options.DurationOption = None,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE.npz", help="Write the log of the run.")
    ] = None,
    html: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Write its replay as a page.")
    ] = None,
    again: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN.npz", help="Walk the scenario of this log again, with no other options."
        ),
    ] = None,
    json: options.JsonOption = None,
) -> None:
    """Simulate a walk of the full robot, and print its measures.

    Everything that is not an option here is a setting, given by --set; `harpy settings` lists them.
    Exit code 0 if the robot walked to the end, 1 if it fell or stumbled, 130 on Ctrl-C, 143 on
    SIGTERM (the log is kept). With --save the log is written to disk during the walk: if the
    process dies, harpy view reads FILE.npz.part.

    \b
    harpy walk --set controller.governor=paper --friction 0.25 --save a.npz
    harpy walk --push 2.0:0,5,0 --set disturbances.noise=0.5 --set disturbances.delay=0.001
    harpy walk --robot go2 --set gait.velocity="0.5 0 0; 3s 0 0 0.5" --set plant.preset=stiff
    harpy walk --set plant=pinocchio --friction 0.8
    harpy walk --robot my.urdf --feet lf_foot,rf_foot,lh_foot,rh_foot
    harpy walk --robot humanoid.urdf --feet '*_sole' --flat-feet 0.2x0.09
    harpy walk --again a.npz
    """
    journal = None if save is None else journal_path(save)
    check_outputs(
        {"--html": html, "--json": json},
        inputs={"--again": again, "the journal of --save": journal},
    )
    check_outputs({"--save": save, "--html": html, "--json": json})
    choices: dict[str, Any] = {
        "robot": robot,
        "feet": feet,
        "posture": posture,
        "friction": friction,
    }
    choices |= {"flat_feet": flat_feet, "loops": loops}
    choices |= {"speed": speed, "push": push, "duration": duration}
    given = {name: value for name, value in choices.items() if value is not None}
    if again is None:
        scenario = options.read_scenario(settings or (), **given)
    elif given or settings:
        named = ", ".join(
            f"--{name}".replace("_", "-") for name in (*given, *(("set",) if settings else ()))
        )
        raise InputError(f"--again walks the scenario of its file: leave out {named}", name="again")
    else:
        from harpy_pin.log.run import Run
        from harpy_pin.scenario import Scenario

        scenario = Scenario.of(Run.load(again))
    if html is not None:
        import_module("harpy_pin.view.page.replay")  # what it lacks is said before the walk
    run, trouble = _run(scenario, save=save)
    # Once it is interrupted, what is left to be written is: the next Ctrl-C waits.
    with Shield(saving=isinstance(trouble, Interrupted)) as shield:
        code = _report(scenario, run, trouble, save=save, html=html, json=json)
        shield.late = None
    if code:
        raise typer.Exit(code)


def _run(
    scenario: Scenario, *, save: Path | None
) -> tuple[Run, ControlError | Interrupted | RunFileError | None]:
    """The run of a scenario, and what ended or befell it."""
    from harpy_pin.scenario import build

    built = build(scenario)
    with walking_bar(scenario.duration) as on_piece:
        try:
            return built.run(on_piece=on_piece, save=save), None
        except (ControlError, Interrupted, RunFileError) as error:
            if error.run is None or len(error.run) == 0:
                raise
            return error.run, error


def _report(
    scenario: Scenario,
    run: Run,
    trouble: ControlError | Interrupted | RunFileError | None,
    *,
    save: Path | None,
    html: Path | None,
    json: Path | None,
) -> int:
    """Print the tables, write what was asked for, and return the exit code that the ending
    deserves.
    """
    from harpy_pin.log.measures import STUMBLE, WORDS, measure
    from harpy_pin.scenario.gait_parts import Stand, Walking, gaits_of, why_not

    measured = measure(run)
    measures = measured.as_dict()
    ice = "".join(
        f", {mu:g} from {begin:g} to {end:g} m"
        for begin, end, mu in scenario.ground.friction_strips
    )
    slope = f", slope {math.degrees(scenario.ground.slope):g}°" if scenario.ground.slope else ""
    who = (
        f"{scenario.robot_name}, {scenario.controller.name}, {scenario.gait.name} gait, "
        f"{scenario.plant.name} plant"
    )
    if scenario.gait.name == Stand.name and Walking.name not in gaits_of(scenario.robot):
        who += f" ({why_not(scenario.robot, Walking.name) or 'two, four or six feet walk'})"
    estimated = ", on its estimate" if scenario.state == "estimated" else ""
    title = f"{who}{estimated}, friction {scenario.ground.mu_s:g}{ice}{slope}"
    values = {**measures, "steps": f"{measures['steps']:.1f}"}
    values |= {
        name: ("no", "yes")[value] for name, value in measures.items() if isinstance(value, bool)
    }
    console.print(
        values_table(
            title, {WORDS[name]: value for name, value in values.items() if value == value}
        )
    )
    if json is not None:
        write_json(json, {**measures, "metadata": run.metadata})
    if isinstance(trouble, RunFileError):
        raise trouble
    shown = "the same with --html walk.html"
    if save is not None and not journal_path(save).exists():
        console.print(f"log: {save}", soft_wrap=True)
        shown = f"harpy view {save}"
    if html is not None:
        from harpy_pin.view.page.replay import write_html

        console.print(f"wrote {write_html(run, html)}", soft_wrap=True)
        shown = f"open {html} in a browser"
    say_next(shown)
    if trouble is not None:
        say(trouble)
        return INTERRUPTED if isinstance(trouble, Interrupted) else FELL
    if run.ending != "completed":
        stderr.print(
            f"{run.ending} at t = {run.metadata['end_time']:.3f} s; {measured.causes}",
            soft_wrap=True,
        )
    elif measures["stumbled"]:
        tilt = f"the body tilted by {measures['tilt_max_rad']:.2f} rad, more than {STUMBLE:g}"
        stderr.print(f"completed, but stumbled: {tilt}; this does not count as walking")
    else:
        return 0
    return FELL


def demo(
    html: Annotated[Path, typer.Option(metavar="FILE.html", help="The page to write.")] = Path(
        "harpy_demo.html"
    ),
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Do not open the page in the browser.")
    ] = False,
) -> None:
    """Walk on slippery ground under three controllers.

    The paper's governor, the condensed controller and the whole-body QP side by side, for 4 s at
    friction 0.15.
    """
    check_outputs({"--html": html})
    from harpy_pin.ground.ground import Ground
    from harpy_pin.scenario import Scenario, build
    from harpy_pin.view.identity import name_of
    from harpy_pin.view.page.replay import write_html
    from harpy_pin.view.page.shown import scoreboard

    runs = []
    for controller in ("governed", "condensed", "wbc"):
        scenario = Scenario(controller=controller, ground=Ground(mu_s=SLIPPERY), duration=SHOWN)
        with walking_bar(SHOWN) as on_piece:
            runs.append(build(scenario).run(on_piece=on_piece))
    scores = {score.label: score.values for score in scoreboard(runs)}
    for k, run in enumerate(runs):
        ending, slip, tick = (
            scores[label][k] for label in ("ending", "slip, mm per step", "tick, µs median")
        )
        console.print(
            f"{name_of(run):<{NAME_WIDTH}} {ending:<16} slip {slip:>6} mm per step   tick "
            f"{tick:>3} µs"
        )
    write_html(runs, html)
    console.print(f"wrote {html}")
    say_next(f"harpy walk --friction {SLIPPERY:g} --save walk.npz, then harpy view walk.npz")
    if not no_open:
        webbrowser.open(html.resolve().as_uri())
