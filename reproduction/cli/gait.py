"""The command ``python -m reproduction gait``: print a gait, judge it, or search for one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harpy_pin import checks
from harpy_pin.cli.ending import say
from harpy_pin.cli.output import INTERRUPTED, console, stderr, values_table
from harpy_pin.errors import InputError
from harpy_pin.files import check_outputs

if TYPE_CHECKING:
    from harpy_pin.model.robot import Robot
    from reproduction.gait.gait_file import OptimisedGait
    from reproduction.gait.optimise import SearchProgress

__all__ = ["gait"]


def gait(
    search: Annotated[
        str | None,
        typer.Option(
            help="Search for a gait instead: which numbers vary (paper, place, start, middle, ends, overlap)."
        ),
    ] = None,
    from_walk: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Search around the hand walk with this share of double support."),
    ] = None,
    start: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Search around this gait, such as one found before.")
    ] = None,
    spread: Annotated[float, typer.Option(help="Start spread of the search, as a share of the bounds.")] = 0.05,
    in_space: Annotated[
        float | None,
        typer.Option(
            metavar="WIDTH",
            help="Add the governed walk in space to the cost, with the feet at this distance (m) from the path.",
        ),
    ] = None,
    friction: Annotated[float, typer.Option(help="Static friction coefficient.")] = 0.25,
    slip_weight: Annotated[float, typer.Option(help="Cost of slip, per mm per step beyond 1 mm.")] = 0.05,
    seed: Annotated[int, typer.Option(help="Seed of the search.")] = 1,
    budget: Annotated[int, typer.Option(help="Number of walks to try.")] = 2000,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Save the state of the search in this file, and continue from it if it exists."
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE.toml", help="Write the gait that was found.")] = None,
    load: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Show this gait instead of the packaged one.")
    ] = None,
    stability: Annotated[bool, typer.Option(help="Also compute the spectral radius of the Poincaré map.")] = True,
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
    from harpy_pin.model.robot import load_harpy
    from reproduction.gait import PlanarTask, optimise_gait
    from reproduction.gait.gait_file import load_gait
    from reproduction.gait.planar_gait import PlanarGait
    from reproduction.gait.planar_model import PlanarModel
    from reproduction.gait.search import SpaceCost

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
        f"--{name} {v:g}" if isinstance(v, float) else f"--{name} {v}" for name, v in given.items() if v is not None
    ]
    command = " ".join(["python -m reproduction gait --search", search, *options, f"--seed {seed} --budget {budget}"])
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
        say(f"interrupted; the best gait so far is {'in ' + ' and '.join(kept) if kept else 'not kept'}")
        raise typer.Exit(INTERRUPTED)


@contextmanager
def _search_bar(budget: int) -> Iterator[Callable[[SearchProgress], None]]:
    """A progress bar, and the function that moves it."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=stderr, transient=True, disable=not stderr.is_terminal) as bar:
        line = bar.add_task("searching", total=budget)

        def on_progress(progress: SearchProgress) -> None:
            bar.update(line, completed=progress.evaluations, description=f"searching, cost {progress.cost:.3f}")

        yield on_progress


def _show_gait(robot: Robot, found: OptimisedGait, *, friction: float, stability: bool) -> None:
    from harpy_pin.ground.ground import Ground
    from reproduction.gait import analyse_periodicity
    from reproduction.gait.planar_model import PlanarModel
    from reproduction.gait.planar_walk import PlanarWalk

    ground = Ground(mu_s=friction)
    model = PlanarModel.from_robot(robot)
    values: dict[str, Any] = asdict(PlanarWalk(model, found.gait, ground=ground).run(30.0))
    if stability and not values["fell"]:
        for name, memory in (("spectral radius", False), ("spectral radius, with PID integrals", True)):
            with stderr.status("Poincaré map"):
                periodic = analyse_periodicity(model, found.gait, ground=ground, memory=memory)
            values[name] = f"{periodic.spectral_radius:.3f} ({periodic.spread[0]:.3f} to {periodic.spread[1]:.3f})"
    console.print(values_table(f"planar walk of 30 s without thrusters, friction {friction:g}", values))
    console.print(f"found by: {found.record.get('command', 'unknown')}", highlight=False)
