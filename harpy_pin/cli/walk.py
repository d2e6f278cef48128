"""The command ``harpy walk``: its options are a scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harpy_pin import checks
from harpy_pin.cli.ending import say
from harpy_pin.cli.output import (
    FELL,
    INTERRUPTED,
    JsonOption,
    UrdfOption,
    console,
    measures_table,
    profile_table,
    stderr,
    walking_bar,
)
from harpy_pin.deprecated import new_value
from harpy_pin.errors import ControlError, InputError, Interrupted, RunFileError
from harpy_pin.files import Shield, check_outputs, journal_path, write_json

if TYPE_CHECKING:
    from harpy_pin.log.run import Run
    from harpy_pin.scenario import Part, Scenario
    from harpy_pin.simulation.profile import Profile
    from harpy_pin.simulation.push import Push

__all__ = ["read_command", "walk"]

NOT_OF_THE_SCENARIO = ("again", "save", "json", "profile")
"""Options that say what to do with the walk, not what it is."""
OF_THE_GOVERNED = ("governor", "evaluate_at", "legs", "limits", "thrust")
"""Options that only the governed controller has: with one of them it walks, if no other controller is named."""


def walk(
    context: typer.Context,
    robot: Annotated[
        str, typer.Option(help="harpy, or a robot that `harpy robots` lists: it walks, stands, or hovers.")
    ] = "harpy",
    controller: Annotated[
        str | None,
        typer.Option(
            help="condensed (whole-body QP in the contact forces), wbc (whole-body QP), or governed (joint PID).  "
            "[default: condensed; governed with one of its options]",
            show_default=False,
        ),
    ] = None,
    governor: Annotated[
        str | None,
        typer.Option(
            help="Governor of the governed controller: none, paper, cone, or filter.  [default: paper]",
            show_default=False,
        ),
    ] = None,
    evaluate_at: Annotated[
        str | None,
        typer.Option(
            "--evaluate-at",
            "--reading",
            help="Where the paper's governor evaluates its constraints: measured (state) or tracked (reference).  "
            "[default: measured]",
            show_default=False,
        ),
    ] = None,
    legs: Annotated[
        str,
        typer.Option(
            help="Leg control of the governed controller: pid (the paper's), or feedforward (survives 3 ms of delay)."
        ),
    ] = "pid",
    friction: Annotated[float, typer.Option(help="Static friction coefficient; sliding friction is 0.9 of it.")] = 0.8,
    ice: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FROM:TO:MU", help="A strip of ground from x to x, m, with another static friction; repeatable."
        ),
    ] = None,
    assumed_friction: Annotated[
        float | None, typer.Option(help="Friction coefficient the controller assumes; the ground's by default.")
    ] = None,
    gait: Annotated[
        str | None,
        typer.Option(help="hand (few parameters, tuned), optimised (found in the plane), paper-curves, or commanded."),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Speed forward, m/s; at 0 the robot stands.  [default: 0.3; 0.15 on flat feet]", show_default=False
        ),
    ] = None,
    command: Annotated[
        str | None,
        typer.Option(
            metavar="VX VY W; Ts VX VY W",
            help="Velocity from each time on: forward, sideways (m/s), turning (rad/s); wbc and condensed.",
        ),
    ] = None,
    schedule: Annotated[
        str | None,
        typer.Option(help="Of the gait walking: trot, crawl, pace or bound on four feet; walk or step on two."),
    ] = None,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 6.0,
    dt: Annotated[float, typer.Option(help="Physics step, s.")] = 5e-4,
    limits: Annotated[
        bool,
        typer.Option(
            "--limits",
            help="Clip the governed controller to the motors' and thrusters' limits (the others always respect them).",
        ),
    ] = False,
    thrust: Annotated[
        bool, typer.Option("--thrust/--no-thrust", help="Whether the governed controller has its thrusters.")
    ] = True,
    govern_command: Annotated[
        bool,
        typer.Option(
            "--govern-command",
            help="wbc and condensed: shift footholds and slow down where the ground is too slippery for that velocity.",
        ),
    ] = False,
    estimate_friction: Annotated[
        bool,
        typer.Option(
            "--estimate-friction", help="Estimate the friction from measured forces and slip, below what is assumed."
        ),
    ] = False,
    cone: Annotated[str, typer.Option(help="Friction cone: circular, or per_axis as in the paper.")] = "circular",
    stiffness: Annotated[
        float | None,
        typer.Option(
            help="Stiffness of the ground, N/m, with the paper's damping ratio.  [default: 8000; another robot that "
            "walks: its weight over 2 mm; that stands: so much that it sinks in by 5 mm]",
            show_default=False,
        ),
    ] = None,
    assumed_stiffness: Annotated[
        float | None, typer.Option(help="Stiffness that the walk is made for, N/m; the ground's by default.")
    ] = None,
    plant: Annotated[
        str, typer.Option(help="Physics engine: compliant (the library's own) or mujoco (an extra).")
    ] = "compliant",
    plant_preset: Annotated[
        str | None,
        typer.Option(help="MuJoCo's contact relative to the ground: soft (the same; default), overdamped, or stiff."),
    ] = None,
    push: Annotated[
        list[str] | None,
        typer.Option(metavar="TIME:X,Y,Z", help="Push the body at this time, s, by an impulse, N·s; repeatable."),
    ] = None,
    mass_error: Annotated[
        float,
        typer.Option(help="Relative error of the body's mass: 0.2 means 20 % heavier than the controller assumes."),
    ] = 0.0,
    noise: Annotated[
        float,
        typer.Option(
            metavar="SCALE",
            help="Measurement noise as a multiple of: joints 0.5 mrad, 20 mrad/s; body 2 mm, 2 mrad, 10 mm/s, "
            "5 mrad/s; foot forces 0.5 N.",
        ),
    ] = 0.0,
    delay: Annotated[float, typer.Option(help="Delay of the controller's measurements, s; whole milliseconds.")] = 0.0,
    perturbation: Annotated[
        float, typer.Option(help="Standard deviation of a random change of the start velocity, m/s and rad/s.")
    ] = 0.0,
    seed: Annotated[int, typer.Option(help="Seed of the perturbation and the noise.")] = 0,
    urdf: UrdfOption = None,
    again: Annotated[
        Path | None, typer.Option(metavar="RUN.npz", help="Walk the scenario of this log again, with no other options.")
    ] = None,
    save: Annotated[Path | None, typer.Option(metavar="FILE.npz", help="Write the log of the run.")] = None,
    json: JsonOption = None,
    profile: Annotated[bool, typer.Option("--profile", help="Also show where the time goes.")] = False,
) -> None:
    """Simulate a walk of the full robot on compliant ground, and print its measures.

    Exit code 0 if the robot walked to the end, 1 if it fell or stumbled, 130 on Ctrl-C, 143 on SIGTERM (the log is
    kept). With --save the log is written to disk during the walk: if the process dies, harpy view reads FILE.npz.part.

    \b
    harpy walk --friction 0.8 --duration 6 --save a.npz
    harpy walk --controller wbc --friction 0.25
    harpy walk --governor paper --friction 0.25
    harpy walk --command "0.3 0 0; 4s 0.3 0 0.5; 7s 0 0 0" --duration 9
    harpy walk --govern-command --friction 0.03
    harpy walk --ice 0.6:1.2:0.15 --estimate-friction
    harpy walk --push 2.0:0,5,0 --noise 0.5 --delay 0.001
    harpy walk --governor paper --legs feedforward --delay 0.002
    harpy walk --plant mujoco --plant-preset stiff
    harpy walk --robot go2 --command "0.5 0 0; 3s 0 0 0.5"
    harpy walk --robot anymal_c --schedule crawl --friction 0.3
    harpy walk --again a.npz
    harpy walk --profile
    """
    journal = None if save is None else journal_path(save)
    check_outputs({"--json": json}, inputs={"--again": again, "the journal of --save": journal})
    check_outputs({"--save": save, "--json": json})
    from harpy_pin.model.catalogue import CATALOGUE, known_name
    from harpy_pin.scenario import PLANT_PARTS, Disturbances, Scenario
    from harpy_pin.simulation.ground import CONES, Ground
    from harpy_pin.simulation.sensors import Noise

    checks.one_of("friction cone", cone, CONES)
    robot = known_name(robot)
    checks.one_of("robot", robot, ("harpy", *CATALOGUE))
    if again is not None:
        scenario = _scenario_of(again, context)
    else:
        switches = {"govern_command": govern_command, "estimate_friction": estimate_friction}
        controller_part = _controller_part(
            controller or ("governed" if _given(context, OF_THE_GOVERNED) else "condensed"),
            assumed_friction=assumed_friction,
            governor=governor,
            evaluate_at=evaluate_at,
            limits=limits or None,
            thrust=None if thrust else False,
            parameters={"legs": legs} if _given(context, ["legs"]) else {},
            switches=switches,
        )
        gait_part = _gait_part(robot, gait, speed, command, schedule=schedule, assumed_stiffness=assumed_stiffness)
        scenario = Scenario(
            robot=robot,
            gait=gait_part,
            controller=controller_part,
            ground=Ground(
                stiffness=_stiffness(robot, gait_part["name"] == "walking") if stiffness is None else stiffness,
                mu_s=friction,
                cone="per_axis" if cone == "per_axis" else "circular",
                friction_strips=tuple(sorted(_read_strip(text) for text in ice or ())),
            ),
            plant=_part("plant", PLANT_PARTS, plant, {"plant-preset": ("preset", plant_preset)}),
            disturbances=Disturbances(
                pushes=tuple(_read_push(text) for text in push or ()),
                noise=Noise.typical(noise),
                delay=delay,
                mass_error=mass_error,
                start_velocity=_draw_start(perturbation, seed),
                seed=seed,
            ),
            duration=duration,
            dt=dt,
            urdf=urdf,
        )
    run, times, trouble = _run(scenario, profile=profile, save=save)
    # Once it is interrupted, what is left to be written is: the next Ctrl-C waits.
    with Shield(saving=isinstance(trouble, Interrupted)) as shield:
        code = _report(scenario, run, times, trouble, save=save, json=json)
        shield.late = None
    if code:
        raise typer.Exit(code)


def _stiffness(robot: str, walks: bool) -> float:
    """Of the ground under a robot, N/m: Harpy's is the paper's; other robots have what fits their weight."""
    from harpy_pin.model.robot import load_robot
    from harpy_pin.simulation.resting import resting_stiffness, walking_stiffness

    if robot == "harpy":
        return 8000.0
    return walking_stiffness(load_robot(robot)) if walks else resting_stiffness(load_robot(robot))


def _part(
    what: str, kinds: Mapping[str, type[Part]], name: str, options: Mapping[str, tuple[str, object]]
) -> dict[str, object]:
    """A part of the scenario from the options that were given.

    Args:
        what: the part is.
        kinds: class of each name.
        name: of the part.
        options: the setting that each option stands for, and its value; none where it was not given.

    Raises:
        InputError: an unknown name, or an option that the part does not have.
    """
    checks.one_of(what, name, kinds)
    given = {option: (key, value) for option, (key, value) in options.items() if value is not None}
    has = {entry.name for entry in fields(kinds[name])}
    for option, (key, _) in given.items():
        if key not in has:
            raise InputError(f"--{option} is not for the {what} '{name}'", name=option)
    return {"name": name, **dict(given.values())}


def _controller_part(
    name: str,
    *,
    assumed_friction: float | None,
    governor: str | None,
    evaluate_at: str | None,
    limits: bool | None,
    thrust: bool | None,
    parameters: dict[str, object],
    switches: Mapping[str, bool],
) -> dict[str, object]:
    """The controller from its options."""
    from harpy_pin.scenario import CONTROLLER_PARTS

    name = new_value("controller", name)
    if assumed_friction is not None:
        checks.number("assumed_friction", assumed_friction, low=0.0, high=checks.MAX_FRICTION)
    if switches["govern_command"] and name == "governed":
        raise InputError("--govern-command is for the controllers 'wbc' and 'condensed'", name="govern_command")
    if governor == "none" and name != "governed":
        governor = None  # which is what the others have
    options: dict[str, tuple[str, object]] = {
        "assumed-friction": ("mu", assumed_friction),
        "governor": ("governor", governor),
        "evaluate-at": ("evaluate_at", evaluate_at),
        "limits": ("limits", limits),
        "no-thrust": ("thrust", thrust),
    }
    given = parameters | {key: True for key, on in switches.items() if on}
    return _part("controller", CONTROLLER_PARTS, name, options) | {"parameters": given}


def _gait_part(
    robot: str,
    name: str | None,
    speed: float | None,
    command: str | None,
    *,
    schedule: str | None,
    assumed_stiffness: float | None,
) -> dict[str, object]:
    """The gait from its options."""
    from harpy_pin.scenario import GAIT_PARTS, gaits_of

    if name is None:
        name = "commanded" if command is not None and robot == "harpy" else gaits_of(robot)[0]
    velocity: object = None if command is None else read_command(command)
    if name in ("commanded", "walking") and command is None and speed is not None:
        velocity, speed = (speed, 0.0, 0.0), None
    options = {
        "speed": ("speed", speed),
        "command": ("velocity", velocity),
        "schedule": ("schedule", schedule),
        "assumed-stiffness": ("stiffness", assumed_stiffness),
    }
    return _part("gait", GAIT_PARTS, name, options)


def _scenario_of(path: Path, context: typer.Context) -> Scenario:
    """The scenario of a log; options that say something of it are refused."""
    from harpy_pin.log.run import Run
    from harpy_pin.scenario import Scenario

    given = _given(context, [name for name in context.params if name not in NOT_OF_THE_SCENARIO])
    if given:
        options = ", ".join(f"--{name.replace('_', '-')}" for name in given)
        raise InputError(f"--again walks the scenario of its file: leave out {options}", name="again")
    return Scenario.of(Run.load(path))


def _given(context: typer.Context, names: Sequence[str]) -> list[str]:
    """Which of these parameters were given on the command line."""
    default = ("DEFAULT", "DEFAULT_MAP")
    return [name for name in names if getattr(context.get_parameter_source(name), "name", "DEFAULT") not in default]


def _draw_start(perturbation: float, seed: int) -> tuple[float, ...]:
    """A random change of the start velocity."""
    import numpy as np

    spread = checks.number("perturbation", perturbation, low=0.0, high=100.0)
    if spread == 0.0:
        return (0.0,) * 6
    return tuple((spread * np.random.default_rng(checks.whole("seed", seed)).standard_normal(6)).tolist())


def _read_push(text: str) -> Push:
    """A push from ``TIME:X,Y,Z``."""
    from harpy_pin.simulation.push import Push

    time, _, impulse = text.partition(":")
    try:
        x, y, z = (float(part) for part in impulse.split(","))
        return Push(float(time), (x, y, z))
    except InputError:
        raise
    except ValueError:
        raise InputError(f"a push must look like TIME:X,Y,Z (s and N·s), got '{text}'", name="push") from None


def read_command(text: str) -> tuple[tuple[float, float, float, float], ...]:
    """The rows of a velocity command from ``VX VY W; Ts VX VY W; ...``; the first one may leave its time out."""
    rows: list[tuple[float, float, float, float]] = []
    for part in text.split(";"):
        words = part.split()
        if len(words) == 3 and not rows:
            words = ["0s", *words]
        try:
            if not words[0].endswith("s"):
                raise ValueError
            t, forward, sideways, turning = float(words[0][:-1]), *(float(word) for word in words[1:])
        except (IndexError, ValueError):
            message = f"a command must look like 'VX VY W; Ts VX VY W' (m/s, m/s, rad/s), got '{part.strip()}'"
            raise InputError(message, name="command", value=text) from None
        rows.append((t, forward, sideways, turning))
    return tuple(rows)


def _read_strip(text: str) -> tuple[float, float, float]:
    """A strip of ground from ``FROM:TO:MU``."""
    try:
        begin, end, mu = (float(part) for part in text.split(":"))
    except ValueError:
        raise InputError(f"ice must look like FROM:TO:MU (m, m and a coefficient), got '{text}'", name="ice") from None
    return begin, end, mu


def _run(
    scenario: Scenario, *, profile: bool, save: Path | None
) -> tuple[Run, Profile | None, ControlError | Interrupted | RunFileError | None]:
    """The run of a scenario, where its time went if that was asked for, and what ended or befell it."""
    from harpy_pin.scenario import build
    from harpy_pin.simulation.profile import Profiler

    built = build(scenario)
    trouble: ControlError | Interrupted | RunFileError | None = None
    with (
        walking_bar(scenario.duration) as on_piece,
        Profiler(built.simulator) if profile else nullcontext() as profiler,
    ):
        try:
            run = built.run(on_piece=on_piece, save=save)
        except (ControlError, Interrupted, RunFileError) as error:
            if error.run is None or len(error.run) == 0:
                raise
            run, trouble = error.run, error
    return run, None if profiler is None else profiler.profile(run), trouble


def _report(
    scenario: Scenario,
    run: Run,
    profile: Profile | None,
    trouble: ControlError | Interrupted | RunFileError | None,
    *,
    save: Path | None,
    json: Path | None,
) -> int:
    """Print the tables, write what was asked for, and return the exit code that the ending deserves."""
    from harpy_pin.log.measures import STUMBLE, measure

    measures = measure(run).as_dict()
    engine = "" if scenario.plant.name == "compliant" else ", MuJoCo"
    ice = "".join(f", {mu:g} from {begin:g} to {end:g} m" for begin, end, mu in scenario.ground.friction_strips)
    speed = getattr(scenario.gait, "speed", None)
    pace = scenario.gait.name if speed is None else f"{speed:g} m/s"
    if scenario.robot != "harpy":
        pace = f"{scenario.robot}, {pace}"
    title = f"{scenario.controller.name}, friction {scenario.ground.mu_s:g}{ice}, {pace}{engine}"
    console.print(measures_table(title, measures))
    if profile is not None:
        console.print(profile_table(profile))
    if json is not None:
        times = {} if profile is None else {"profile": profile.as_dict()}
        write_json(json, {**measures, "metadata": run.metadata, **times})
    if isinstance(trouble, RunFileError):
        raise trouble
    if save is not None and not journal_path(save).exists():
        console.print(f"log: {save}  (replay: harpy view {save})", markup=False, highlight=False)
    if trouble is not None:
        say(trouble)
        return INTERRUPTED if isinstance(trouble, Interrupted) else FELL
    if run.ending == "completed" and measures["stumbled"]:
        tilt = f"the body tilted by {measures['tilt_max_rad']:.2f} rad, more than {STUMBLE:g}"
        stderr.print(f"completed, but stumbled: {tilt}; this does not count as walking", markup=False)
        return FELL
    if run.ending != "completed":
        stderr.print(f"{run.ending} at t = {run.metadata['end_time']:.3f} s", markup=False)
        return FELL
    return 0
