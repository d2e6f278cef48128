"""The ``harpy`` command."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from harpy_pin import __version__, checks
from harpy_pin.cli.gait import gait
from harpy_pin.cli.governors import governors
from harpy_pin.cli.output import INTERRUPTED, console, profile_table, stderr, values_table
from harpy_pin.errors import ControlError, HarpyError, InputError
from harpy_pin.files import check_writable, write_json

if TYPE_CHECKING:
    from harpy_pin.model.robot import Robot
    from harpy_pin.model.state import State
    from harpy_pin.plant.profile import Profile
    from harpy_pin.plant.run import Run

FELL = 1
BAD_INPUT = 2

app = typer.Typer(
    name="harpy",
    help="Walk the thruster-assisted biped Harpy under a reference governor or a QP whole-body controller.",
    epilog="Start with:  harpy walk --save walk.npz  and then  harpy view walk.npz",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
UrdfOption = Annotated[
    Path | None, typer.Option("--urdf", metavar="FILE", help="A variant of Harpy's URDF; the packaged one by default.")
]
JsonOption = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write the numbers as JSON.")]


app.command()(gait)
app.command()(governors)


def main() -> None:
    """Entry point: errors of ours become one line and an exit code."""
    try:
        app()
    except HarpyError as error:
        # Plain text: a message may hold brackets, which markup would swallow.
        print(f"harpy: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(BAD_INPUT)


@app.command()
def walk(
    controller: Annotated[
        str, typer.Option(help="governed (gait + governor + PID + thrust) or wbc (whole-body QP).")
    ] = "governed",
    governor: Annotated[
        str, typer.Option(help="Of the governed controller: none, paper, contact (the true force), ...")
    ] = "paper",
    reading: Annotated[
        str,
        typer.Option(
            help="Where the paper's governor evaluates its constraints: measured (state) or tracked (reference)."
        ),
    ] = "measured",
    friction: Annotated[float, typer.Option(help="Static friction coefficient; sliding friction is 0.9 of it.")] = 0.8,
    gait: Annotated[
        str, typer.Option(help="hand (few parameters, tuned), optimised (found in the plane), or paper-curves.")
    ] = "hand",
    speed: Annotated[float, typer.Option(help="Along x, m/s; 0 stands on both feet.")] = 0.3,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 6.0,
    dt: Annotated[float, typer.Option(help="Physics step, s.")] = 5e-4,
    limits: Annotated[
        bool,
        typer.Option(
            "--limits", help="Clip the governed controller to the motors' and thrusters' limits (wbc: always)."
        ),
    ] = False,
    thrust: Annotated[
        bool, typer.Option("--thrust/--no-thrust", help="Whether the governed controller has its thrusters.")
    ] = True,
    cone: Annotated[str, typer.Option(help="Friction law: circular, or per_axis as in the paper.")] = "circular",
    perturbation: Annotated[
        float, typer.Option(help="Standard deviation of a random change of the start velocity, m/s and rad/s.")
    ] = 0.0,
    seed: Annotated[int, typer.Option(help="Of the perturbation.")] = 0,
    urdf: UrdfOption = None,
    save: Annotated[Path | None, typer.Option(metavar="FILE.npz", help="Write the log of the run.")] = None,
    json: JsonOption = None,
    profile: Annotated[bool, typer.Option("--profile", help="Also show where the time goes.")] = False,
) -> None:
    """Walk the full robot on compliant ground and measure how well.

    Exit code 0 if the robot walked to the end, 1 if it fell, 130 on Ctrl-C (the log up to there is kept).

    \b
    harpy walk --friction 0.8 --duration 6 --save a.npz
    harpy walk --controller wbc --friction 0.25
    harpy walk --governor none --speed 0
    harpy walk --profile
    """
    checks.number("duration", duration, low=0.0, strict=True)
    for path in (save, json):
        if path is not None:
            check_writable(path)
    run, times = _walk(
        controller=controller,
        governor=governor,
        reading=reading,
        friction=friction,
        gait=gait,
        speed=speed,
        duration=duration,
        dt=dt,
        limits=limits,
        thrust=thrust,
        cone=cone,
        perturbation=perturbation,
        seed=seed,
        urdf=urdf,
        profile=profile,
    )
    _report(run, times, save=save, json=json)


def _walk(
    *,
    controller: str,
    governor: str,
    reading: str,
    friction: float,
    gait: str,
    speed: float,
    duration: float,
    dt: float,
    limits: bool,
    thrust: bool,
    cone: str,
    perturbation: float,
    seed: int,
    urdf: Path | None,
    profile: bool,
) -> tuple[Run, Profile | None]:
    """The run of the options of ``harpy walk``, and where its time went if that was asked for."""
    import numpy as np

    from harpy_pin.control import make_controller
    from harpy_pin.gait import named_gait
    from harpy_pin.model.robot import load_harpy
    from harpy_pin.plant.ground import CONES, Ground
    from harpy_pin.plant.profile import Profiler
    from harpy_pin.plant.simulator import Simulator

    if cone not in CONES:
        raise InputError.unknown("friction cone", cone, CONES)
    robot = load_harpy(urdf)
    ground = Ground(mu_s=friction, cone="per_axis" if cone == "per_axis" else "circular")
    walking = named_gait(robot, gait, speed=speed)
    chosen = make_controller(
        controller, walking, mu=friction, governor=governor, reading=reading, limits=limits, thrust=thrust
    )
    simulator = Simulator(robot, ground, dt=dt)
    q, v = walking.initial_state(sink=simulator.static_sink)
    spread = checks.number("perturbation", perturbation, low=0.0)
    v[:6] += spread * np.random.default_rng(seed).standard_normal(6)
    simulator.reset(q, v)
    metadata = {
        "seed": seed,
        "perturbation": perturbation,
        "speed": speed,
        "friction": friction,
        "gait": gait,
        "name": controller,
    }
    run: Run
    with _progress(duration) as on_tick, Profiler(simulator) if profile else nullcontext() as profiler:
        try:
            run = simulator.run(chosen, duration, metadata=metadata, on_tick=on_tick)
        except ControlError as error:
            if error.run is None or len(error.run) == 0:
                raise
            stderr.print(f"harpy: {error}", markup=False)
            run = error.run
    return run, None if profiler is None else profiler.profile(run)


def _report(run: Run, profile: Profile | None, *, save: Path | None, json: Path | None) -> None:
    """Save what was asked for, print the tables, and leave with the exit code that the ending deserves."""
    from harpy_pin.plant.measures import measure

    if len(run) == 0:
        raise InputError(f"the run ended before its first tick: {run.ending}")
    if save is not None:
        run.save(save)
    measures = measure(run).as_dict()
    if json is not None:
        times = {} if profile is None else {"profile": profile.as_dict()}
        write_json(json, {**measures, "metadata": run.metadata, **times})
    title = f"{run.metadata['name']}, friction {run.metadata['friction']:g}, {run.metadata['speed']:g} m/s"
    console.print(values_table(title, measures))
    if profile is not None:
        console.print(profile_table(profile))
    if save is not None:
        console.print(f"log: {save}  (replay: harpy view {save})", markup=False, highlight=False)
    if run.ending == "interrupted":
        stderr.print(f"interrupted at t = {run['t'][-1]:.3f} s")
        raise typer.Exit(INTERRUPTED)
    if run.ending != "completed":
        stderr.print(f"{run.ending} at t = {run.metadata['end_time']:.3f} s", markup=False)
        raise typer.Exit(FELL)


@app.command()
def vlip(
    governor: Annotated[str, typer.Option(help="none, paper, cone or margin.")] = "paper",
    reading: Annotated[str, typer.Option(help="Of the paper's governor: measured or tracked.")] = "tracked",
    start: Annotated[
        str, typer.Option(help="paper (on the target, in violation) or inside (the friction cone).")
    ] = "paper",
    coordinates: Annotated[
        str, typer.Option(help="Of the governed reference: polar (θ, φ, l) or cartesian.")
    ] = "polar",
    mass: Annotated[float, typer.Option(help="kg.")] = 4.0,
    friction: Annotated[float, typer.Option(help="Friction coefficient of the constraints.")] = 0.45,
    duration: Annotated[float, typer.Option(help="s.")] = 4.0,
    dt: Annotated[float, typer.Option(help="Control and integration step, s.")] = 1e-3,
    json: JsonOption = None,
) -> None:
    """Run the paper's first simulation: a point mass on a variable-length leg (VLIP) under its thruster law.

    \b
    harpy vlip --governor none
    harpy vlip --reading tracked --start inside
    harpy vlip --governor cone --start inside
    """
    from harpy_pin.governor.reduced.rows import READINGS
    from harpy_pin.paper.vlip_simulation import (
        COORDINATES,
        STARTS,
        VLIP_GOVERNORS,
        VlipParameters,
        simulate_vlip,
        vlip_governor,
        vlip_setting,
    )

    for kind, name, valid in (
        ("governor", governor, VLIP_GOVERNORS),
        ("reading", reading, READINGS),
        ("start", start, STARTS),
        ("coordinates", coordinates, COORDINATES),
    ):
        if name not in valid:
            raise InputError.unknown(kind, name, valid)
    if json is not None:
        check_writable(json)
    parameters = VlipParameters(
        mass=mass,
        mu=friction,
        duration=duration,
        dt=dt,
        coordinates="polar" if coordinates == "polar" else "cartesian",
        start="inside" if start == "inside" else "paper",
    )
    parameters = vlip_setting(governor, parameters)
    chosen = vlip_governor(parameters, name=governor, reading="tracked" if reading == "tracked" else "measured")
    summary = simulate_vlip(chosen, parameters).summary().as_dict()
    if json is not None:
        write_json(json, summary)
    title = f"VLIP, governor {governor}" + (f" ({reading})" if governor == "paper" else "")
    console.print(values_table(title, summary))


@app.command()
def view(
    run: Annotated[Path, typer.Argument(metavar="RUN.npz", help="A log written by harpy walk --save.")],
    html: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Write one self-contained page instead of serving it live.")
    ] = None,
    urdf: UrdfOption = None,
) -> None:
    """Replay a run in the browser: robot, contact forces, friction cones, thrust, target and applied reference.

    \b
    harpy view walk.npz
    harpy view walk.npz --html walk.html
    """
    if html is not None:
        check_writable(html)
    from harpy_pin.model.robot import load_harpy
    from harpy_pin.plant.run import Run
    from harpy_pin.view.page.replay import show, write_html

    log = Run.load(run)
    robot = load_harpy(urdf)
    if html is None:
        show(log, robot).wait()
        return
    write_html(log, robot, html)
    console.print(f"wrote {html}", markup=False, highlight=False)


@app.command()
def paper(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for the report; made if it is not there.")],
    duration: Annotated[float, typer.Option(help="Of each 3D walk, s.")] = 10.0,
) -> None:
    """Reproduce the paper: both simulations, every claim with a verdict and its number, the figures.

    Writes DIR/report.html (one self-contained page), DIR/numbers.json and DIR/figures/*.pdf. Exit code 0 only if every
    number was produced.
    """
    checks.number("duration", duration, low=0.1)
    from harpy_pin.model.robot import load_harpy
    from harpy_pin.paper.report import prepare_folder, reproduce, write_report

    prepare_folder(out)
    with stderr.status("preparing") as status:
        result = reproduce(load_harpy(), duration=duration, on_stage=lambda stage: status.update(f"{stage} …"))
        page = write_report(result, out)
    table = Table("", "gait", "verdict", "number", title="Claims of the paper")
    for finding in result.findings:
        table.add_row(finding.claim.key, finding.setting, str(finding.verdict), finding.number)
    console.print(table)
    console.print(f"report: {page}", markup=False, highlight=False)


@app.command()
def info(urdf: UrdfOption = None) -> None:
    """Print the robot's masses, joints and limits, and the versions in use."""
    from harpy_pin.model.robot import load_harpy
    from harpy_pin.plant.run import describe_versions

    robot = load_harpy(urdf)
    console.print(_robot_table(robot))
    table = Table("package", "version")
    for name, version in {**describe_versions(), "harpy-pin": __version__}.items():
        table.add_row(name, version)
    console.print(table)


def _robot_table(robot: Robot) -> Table:
    model = robot.model
    table = Table(
        "joint",
        "lower rad",
        "upper rad",
        "torque N·m",
        "armature kg·m²",
        title=f"{robot.name}: {robot.mass:.3f} kg, nq {model.nq}, nv {model.nv}",
        caption=f"feet {', '.join(robot.feet)}; thrusters {', '.join(robot.thrusters)}, {robot.thrust_limit:g} N each",
    )
    rows = zip(robot.joints, robot.joint_lower, robot.joint_upper, robot.torque_limit, model.armature[6:], strict=True)
    for name, lower, upper, torque, armature in rows:
        table.add_row(name, f"{lower:.2f}", f"{upper:.2f}", f"{torque:.1f}", f"{armature:g}")
    return table


@contextmanager
def _progress(duration: float) -> Iterator[Callable[[State], None]]:
    """A progress bar over simulated time, on a terminal only."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.2f} s"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=stderr, transient=True, disable=not stderr.is_terminal) as bar:
        task = bar.add_task("preparing (the first run compiles)", total=duration)
        calls = 0

        def on_tick(state: State) -> None:
            nonlocal calls
            calls += 1
            if calls == 2:
                bar.update(task, description="walking")
            if calls % 100 == 0:
                bar.update(task, completed=state.t)

        yield on_tick


if __name__ == "__main__":
    main()
