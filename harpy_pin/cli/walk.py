"""The command ``harpy walk``: its options make a scenario, which is walked, measured and reported."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from harpy_pin import checks
from harpy_pin.cli import walk_options
from harpy_pin.cli.ending import say
from harpy_pin.cli.grouped import grouped
from harpy_pin.cli.output import FELL, INTERRUPTED, console, measures_table, profile_table, stderr, walking_bar
from harpy_pin.errors import ControlError, InputError, Interrupted, RunFileError
from harpy_pin.files import Shield, check_outputs, journal_path, write_json

if TYPE_CHECKING:
    from harpy_pin.log.run import Run
    from harpy_pin.scenario import Scenario
    from harpy_pin.simulation.profile import Profile

__all__ = ["walk"]


@grouped(walk_options.ORDER)
def walk(
    *,
    given: Sequence[str],
    simulation: walk_options.SimulationOptions,
    controller: walk_options.ControllerOptions,
    gait: walk_options.GaitOptions,
    ground: walk_options.GroundOptions,
    plant: walk_options.PlantOptions,
    disturbances: walk_options.DisturbanceOptions,
    output: walk_options.OutputOptions,
) -> None:
    """Simulate a walk of the full robot, and print its measures.

    Exit code 0 if the robot walked to the end, 1 if it fell or stumbled, 130 on Ctrl-C, 143 on SIGTERM (the log is
    kept). With --save the log is written to disk during the walk: if the process dies, harpy view reads FILE.npz.part.

    \b
    harpy walk --friction 0.8 --duration 6 --save a.npz
    harpy walk --controller wbc --friction 0.25
    harpy walk --governor paper --friction 0.25
    harpy walk --command "0.3 0 0; 4s 0.3 0 0.5; 7s 0 0 0" --duration 9
    harpy walk --govern-command --friction 0.03
    harpy walk --slope 10
    harpy walk --ice 0.6:1.2:0.15 --estimate-friction
    harpy walk --push 2.0:0,5,0 --noise 0.5 --delay 0.001
    harpy walk --governor paper --legs feedforward --delay 0.002
    harpy walk --plant mujoco --plant-preset stiff
    harpy walk --robot go2 --command "0.5 0 0; 3s 0 0 0.5"
    harpy walk --robot anymal_c --schedule crawl --friction 0.3
    harpy walk --again a.npz
    harpy walk --profile
    """
    journal = None if output.save is None else journal_path(output.save)
    check_outputs({"--json": output.json}, inputs={"--again": output.again, "the journal of --save": journal})
    check_outputs({"--save": output.save, "--json": output.json})
    from harpy_pin.model.catalogue import check_robot_name, known_name
    from harpy_pin.scenario import Scenario
    from harpy_pin.simulation.ground import CONES

    checks.one_of("friction cone", ground.cone, CONES)
    robot = known_name(simulation.robot)
    check_robot_name(robot)
    if output.again is not None:
        scenario = _scenario_of(output.again, given)
    else:
        gait_part = gait.part(robot)
        scenario = Scenario(
            controller=controller.part(given),
            gait=gait_part,
            ground=ground.part(robot, walks=gait_part["name"] == "walking"),
            plant=plant.part(),
            disturbances=disturbances.part(),
            **asdict(simulation),
        )
    run, times, trouble = _run(scenario, profile=output.profile, save=output.save)
    # Once it is interrupted, what is left to be written is: the next Ctrl-C waits.
    with Shield(saving=isinstance(trouble, Interrupted)) as shield:
        code = _report(scenario, run, times, trouble, save=output.save, json=output.json)
        shield.late = None
    if code:
        raise typer.Exit(code)


def _scenario_of(path: Path, given: Sequence[str]) -> Scenario:
    """The scenario of a log; options that say something of it are refused."""
    from harpy_pin.log.run import Run
    from harpy_pin.scenario import Scenario

    others = [name for name in given if name not in {entry.name for entry in fields(walk_options.OutputOptions)}]
    if others:
        options = ", ".join(f"--{name.replace('_', '-')}" for name in others)
        raise InputError(f"--again walks the scenario of its file: leave out {options}", name="again")
    return Scenario.of(Run.load(path))


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
    slope = f", slope {math.degrees(scenario.ground.slope):g}°" if scenario.ground.slope else ""
    speed = getattr(scenario.gait, "speed", None)
    pace = scenario.gait.name if speed is None else f"{speed:g} m/s"
    if scenario.robot != "harpy":
        pace = f"{scenario.robot}, {pace}"
    title = f"{scenario.controller.name}, friction {scenario.ground.mu_s:g}{ice}{slope}, {pace}{engine}"
    console.print(measures_table(title, measures, thrusters=run["thrust"].size > 0))
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
