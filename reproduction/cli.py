"""The commands of ``python -m reproduction``: the paper's simulations and claims, and the planar
gait.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from harpy_pin import checks
from harpy_pin.cli.ending import one_line_errors, say, stopping
from harpy_pin.cli.output import BAD_INPUT, INTERRUPTED, Force, console, stderr, values_table
from harpy_pin.cli.walk_options import JsonOption
from harpy_pin.errors import InputError
from harpy_pin.files import OwnFolder, check_outputs, check_writable, write_json

if TYPE_CHECKING:
    from harpy_pin.model.robot import Robot
    from reproduction.gait.optimise import SearchProgress
    from reproduction.gait.planar_gait import OptimisedGait


def paper(
    out: Annotated[
        str,
        typer.Option(metavar="DIR", help="Folder for the report: new, empty, or one of a report."),
    ],
    duration: Annotated[float, typer.Option(help="Length of each 3D walk, s.")] = 10.0,
    force: Force = False,
    json: JsonOption = None,
) -> None:
    """Reproduce the paper: both simulations, every claim with a verdict and a number, and the
    figures.

    Writes DIR/report.html (one self-contained page), DIR/numbers.json and DIR/figures/*.pdf. Exit
    code 0 only if every number was produced.
    """
    checks.ticks(checks.number("duration", duration, low=0.1), 1e-3)
    from harpy_pin.model.loading import load_harpy
    from reproduction.report import numbers_of, reproduce, write_report

    if json is not None:
        check_writable(json)
    folder = OwnFolder(out, force=force)
    with stderr.status("preparing") as status:
        result = reproduce(
            load_harpy(), duration=duration, on_stage=lambda stage: status.update(f"{stage} …")
        )
    table = Table("", "gait", "verdict", "number", title="Claims of the paper")
    for finding in result.findings:
        table.add_row(finding.claim.key, finding.setting, str(finding.verdict), finding.number)
    console.print(table)
    try:
        page = write_report(result, folder)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"interrupted; what '{out}' holds may be of two runs") from None
    console.print(f"report: {page}", markup=False, highlight=False)
    if json is not None:
        from comparison.report.record import origin

        write_json(json, {**numbers_of(result), **origin()})


def vlip(
    governor: Annotated[str, typer.Option(help="Governor: none, paper or margin.")] = "paper",
    evaluate_at: Annotated[
        str,
        typer.Option(
            help="Where the paper's governor evaluates its constraints: measured (state) or "
            "tracked (reference)."
        ),
    ] = "tracked",
    start: Annotated[
        str,
        typer.Option(
            help="Start state: paper (on the target, which violates the constraints) or inside "
            "(the friction cone)."
        ),
    ] = "paper",
    coordinates: Annotated[
        str,
        typer.Option(help="Coordinates of the governed reference: polar (θ, φ, l) or cartesian."),
    ] = "polar",
    mass: Annotated[float, typer.Option(help="Mass, kg.")] = 4.0,
    friction: Annotated[
        float, typer.Option(help="Friction coefficient of the constraints.")
    ] = 0.45,
    duration: Annotated[float, typer.Option(help="Simulated time, s.")] = 4.0,
    dt: Annotated[float, typer.Option(help="Control and integration step, s.")] = 1e-3,
    json: JsonOption = None,
) -> None:
    """Run the paper's first simulation: a point mass on a variable-length leg (VLIP) under its
    thruster law.

    \b
    python -m reproduction vlip --governor none
    python -m reproduction vlip --evaluate-at tracked --start inside
    python -m reproduction vlip --governor margin --start inside
    """
    from harpy_pin.governors.rows import EVALUATE_AT
    from reproduction.vlip_simulation import (
        VLIP_GOVERNORS,
        VlipParameters,
        simulate_vlip,
        vlip_governor,
        vlip_setting,
    )

    checks.one_of("governor", governor, VLIP_GOVERNORS)
    checks.one_of("evaluate_at", evaluate_at, EVALUATE_AT)
    if json is not None:
        check_writable(json)
    given = VlipParameters(
        mass=mass, mu=friction, duration=duration, dt=dt, coordinates=coordinates, start=start
    )
    parameters = vlip_setting(governor, given)
    chosen = vlip_governor(parameters, name=governor, evaluate_at=evaluate_at)
    summary = vars(simulate_vlip(chosen, parameters).summary())
    title = f"VLIP, governor {governor}" + (f" ({evaluate_at})" if governor == "paper" else "")
    console.print(values_table(title, summary))
    if json is not None:
        write_json(json, summary)


def gait(
    search: Annotated[
        str | None,
        typer.Option(
            help="Search for a gait instead: which numbers vary (paper, place, start, middle, "
            "ends, overlap)."
        ),
    ] = None,
    from_walk: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE", help="Search around the hand walk with this share of double support."
        ),
    ] = None,
    start: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.toml", help="Search around this gait, such as one found before."
        ),
    ] = None,
    spread: Annotated[
        float, typer.Option(help="Start spread of the search, as a share of the bounds.")
    ] = 0.05,
    in_space: Annotated[
        float | None,
        typer.Option(
            metavar="WIDTH",
            help="Add the governed walk in space to the cost, with the feet at this distance (m) "
            "from the path.",
        ),
    ] = None,
    friction: Annotated[float, typer.Option(help="Static friction coefficient.")] = 0.25,
    slip_weight: Annotated[
        float, typer.Option(help="Cost of slip, per mm per step beyond 1 mm.")
    ] = 0.05,
    seed: Annotated[int, typer.Option(help="Seed of the search.")] = 1,
    budget: Annotated[int, typer.Option(help="Number of walks to try.")] = 2000,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Save the state of the search in this file, and continue from it if it exists.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Write the gait that was found.")
    ] = None,
    load: Annotated[
        Path | None,
        typer.Option(metavar="FILE.toml", help="Show this gait instead of the packaged one."),
    ] = None,
    stability: Annotated[
        bool, typer.Option(help="Also compute the spectral radius of the Poincaré map.")
    ] = True,
) -> None:
    """Show the optimised planar gait, or search for one.

    \b
    python -m reproduction gait
    python -m reproduction gait --search middle --resume s.json --out found.toml
    """
    checks.number("friction", friction, low=0.0, high=checks.MAX_FRICTION)
    # Also where there is no search: a wrong number is never passed over in silence.
    checks.number("from-walk", from_walk or 0.0, low=0.0, high=0.9)
    checks.number("in-space", in_space or 0.0, low=0.0, high=10.0)
    checks.number("spread", spread, low=1e-6, high=1.0)
    checks.number("slip-weight", slip_weight, low=0.0, high=1e6)
    checks.whole("seed", seed, high=2**32 - 1)
    checks.whole("budget", budget, low=1, high=10**9)
    from harpy_pin.gaits import GaitParameters
    from harpy_pin.model.loading import load_harpy
    from reproduction.gait.optimise import optimise_gait
    from reproduction.gait.planar_gait import PlanarGait, load_gait
    from reproduction.gait.planar_model import PlanarModel
    from reproduction.gait.search import PlanarTask, SpaceCost

    robot = load_harpy()
    if search is None:
        _show_gait(robot, load_gait(load), friction=friction, stability=stability)
        return
    if start is not None and from_walk is not None:
        raise InputError("a search starts around --start or --from-walk, not both", name="start")
    check_outputs({"--resume": resume, "--out": out})
    space = None if in_space is None else SpaceCost(robot=robot, width=in_space, friction=friction)
    task = PlanarTask(
        model=PlanarModel.from_robot(robot),
        search=search,
        friction=(friction,),
        slip_weight=slip_weight,
        extra=space,
        extra_name="" if space is None else space.name,
    )
    around = None if start is None else load_gait(start).gait
    if from_walk is not None:
        around = PlanarGait.from_walk(GaitParameters(double_support=from_walk))
    given = {
        "from-walk": from_walk,
        "start": None if start is None else start.name,
        "spread": None if around is None else spread,
        "in-space": in_space,
        "friction": friction,
        "slip-weight": slip_weight,
    }
    options = [
        f"--{name} {v:g}" if isinstance(v, float) else f"--{name} {v}"
        for name, v in given.items()
        if v is not None
    ]
    command = " ".join(
        [
            "python -m reproduction gait --search",
            search,
            *options,
            f"--seed {seed} --budget {budget}",
        ]
    )
    with _search_bar(budget) as on_progress:
        found = optimise_gait(
            robot,
            task=task,
            seed=seed,
            budget=budget,
            start=around,
            spread=spread,
            resume=resume,
            command=command,
            on_progress=on_progress,
        )
    try:
        if out is not None:
            found.save(out)
            look = f"look at it: python -m reproduction gait --load {out}"
            console.print(f"gait: {out}  ({look})", markup=False, highlight=False)
    finally:
        _show_gait(robot, found, friction=friction, stability=False)
    if found.record.get("ending") == "interrupted":
        kept = [f"'{path}'" for path in (out, resume) if path is not None]
        say(
            f"interrupted; the best gait so far is "
            f"{'in ' + ' and '.join(kept) if kept else 'not kept'}"
        )
        raise typer.Exit(INTERRUPTED)


@contextmanager
def _search_bar(budget: int) -> Iterator[Callable[[SearchProgress], None]]:
    """A progress bar, and the function that moves it."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=stderr, transient=True, disable=not stderr.is_terminal) as bar:
        line = bar.add_task("searching", total=budget)

        def on_progress(progress: SearchProgress) -> None:
            bar.update(
                line,
                completed=progress.evaluations,
                description=f"searching, cost {progress.cost:.3f}",
            )

        yield on_progress


def _show_gait(robot: Robot, found: OptimisedGait, *, friction: float, stability: bool) -> None:
    from harpy_pin.ground.ground import Ground
    from reproduction.gait.periodicity import analyse_periodicity
    from reproduction.gait.planar_model import PlanarModel
    from reproduction.gait.planar_walk import PlanarWalk

    ground = Ground(mu_s=friction)
    model = PlanarModel.from_robot(robot)
    values: dict[str, Any] = asdict(PlanarWalk(model, found.gait, ground=ground).run(30.0))
    if stability and not values["fell"]:
        for name, memory in (
            ("spectral radius", False),
            ("spectral radius, with PID integrals", True),
        ):
            with stderr.status("Poincaré map"):
                periodic = analyse_periodicity(model, found.gait, ground=ground, memory=memory)
            values[name] = (
                f"{periodic.spectral_radius:.3f} ({periodic.spread[0]:.3f} to "
                f"{periodic.spread[1]:.3f})"
            )
    console.print(
        values_table(f"planar walk of 30 s without thrusters, friction {friction:g}", values)
    )
    console.print(f"found by: {found.record.get('command', 'unknown')}", highlight=False)


NAME = "python -m reproduction"

app = typer.Typer(
    name=NAME,
    help="Reproduce the paper of 2021 whose governor the library has: its simulations, its claims, "
    "and its gait.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command in (paper, vlip, gait):
    app.command()(stopping(command))


def main() -> None:
    """Entry point: errors of ours become one line and an exit code."""
    with one_line_errors("reproduction", BAD_INPUT):
        sys.exit(app(prog_name=NAME, standalone_mode=False))
