"""The command ``python -m reproduction gait``: print a gait, judge it, or search for one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harpy_pin import checks
from harpy_pin.cli.ending import say
from harpy_pin.cli.output import INTERRUPTED, console, stderr, values_table
from harpy_pin.errors import InputError
from harpy_pin.files import check_outputs
from reproduction.cli.grouped import grouped

if TYPE_CHECKING:
    from harpy_pin.model.robot import Robot
    from reproduction.gait import PlanarTask
    from reproduction.gait.gait_file import OptimisedGait
    from reproduction.gait.optimise import SearchProgress
    from reproduction.gait.planar_gait import PlanarGait

__all__ = ["gait"]


ORDER = (
    *("search", "from_walk", "start", "spread", "in_space", "friction", "slip_weight"),
    *("seed", "budget", "resume", "out", "load", "stability"),
)
"""The options as the help lists them."""


@dataclass(frozen=True, kw_only=True)
class WalkOptions:
    """Which walk is shown, and how."""

    friction: Annotated[float, typer.Option(help="Static friction coefficient.")] = 0.25
    load: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Show this gait instead of the packaged one.")
    ] = None
    stability: Annotated[bool, typer.Option(help="Also compute the spectral radius of the Poincaré map.")] = True


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """What is searched for, around what, and for how long."""

    search: Annotated[
        str | None,
        typer.Option(
            help="Search for a gait instead: which numbers vary (paper, place, start, middle, ends, overlap)."
        ),
    ] = None
    from_walk: Annotated[
        float | None,
        typer.Option(metavar="SHARE", help="Search around the hand walk with this share of double support."),
    ] = None
    start: Annotated[
        Path | None, typer.Option(metavar="FILE.toml", help="Search around this gait, such as one found before.")
    ] = None
    spread: Annotated[float, typer.Option(help="Start spread of the search, as a share of the bounds.")] = 0.05
    in_space: Annotated[
        float | None,
        typer.Option(
            metavar="WIDTH",
            help="Add the governed walk in space to the cost, with the feet at this distance (m) from the path.",
        ),
    ] = None
    slip_weight: Annotated[float, typer.Option(help="Cost of slip, per mm per step beyond 1 mm.")] = 0.05
    seed: Annotated[int, typer.Option(help="Seed of the search.")] = 1
    budget: Annotated[int, typer.Option(help="Number of walks to try.")] = 2000
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Save the state of the search in this file, and continue from it if it exists."
        ),
    ] = None
    out: Annotated[Path | None, typer.Option(metavar="FILE.toml", help="Write the gait that was found.")] = None

    def check(self) -> None:
        """Refuse numbers out of their domains."""
        checks.number("from-walk", 0.0 if self.from_walk is None else self.from_walk, low=0.0, high=0.9)
        checks.number("in-space", 0.0 if self.in_space is None else self.in_space, low=0.0, high=10.0)
        checks.number("spread", self.spread, low=1e-6, high=1.0)
        checks.number("slip-weight", self.slip_weight, low=0.0, high=1e6)
        checks.whole("seed", self.seed, high=2**32 - 1)
        checks.whole("budget", self.budget, low=1, high=10**9)

    def task(self, robot: Robot, friction: float) -> PlanarTask:
        """What the search minimises, at this friction coefficient."""
        from reproduction.gait import PlanarTask
        from reproduction.gait.planar_model import PlanarModel
        from reproduction.gait.search import SpaceCost

        space = None if self.in_space is None else SpaceCost(robot=robot, width=self.in_space, friction=friction)
        return PlanarTask(
            model=PlanarModel.from_robot(robot),
            search=str(self.search),
            friction=(friction,),
            slip_weight=self.slip_weight,
            extra=space,
            extra_name="" if space is None else space.name,
        )

    def around(self) -> PlanarGait | None:
        """The gait to search around; none for random starts."""
        from harpy_pin.gaits import GaitParameters
        from reproduction.gait.gait_file import load_gait
        from reproduction.gait.planar_gait import PlanarGait

        if self.from_walk is not None:
            return PlanarGait.from_walk(GaitParameters(double_support=self.from_walk))
        return None if self.start is None else load_gait(self.start).gait

    def command(self, friction: float) -> str:
        """The command with its options, for the record of the gait."""
        anywhere = self.from_walk is None and self.start is None
        given = {
            "from-walk": self.from_walk,
            "start": None if self.start is None else self.start.name,
            "spread": None if anywhere else self.spread,
            "in-space": self.in_space,
            "friction": friction,
            "slip-weight": self.slip_weight,
            "seed": self.seed,
            "budget": self.budget,
        }
        options = [
            f"--{name} {value:g}" if isinstance(value, float) else f"--{name} {value}"
            for name, value in given.items()
            if value is not None
        ]
        return " ".join(["python -m reproduction gait", f"--search {self.search}", *options])


@grouped(ORDER)
def gait(*, walk: WalkOptions, search: SearchOptions) -> None:
    """Show the optimised planar gait, or search for one.

    \b
    python -m reproduction gait
    python -m reproduction gait --search middle --resume s.json --out found.toml
    """
    from harpy_pin.model.robot import load_harpy
    from reproduction.gait.gait_file import load_gait

    checks.number("friction", walk.friction, low=0.0, high=checks.MAX_FRICTION)
    search.check()  # also where there is no search: a wrong number is never passed over in silence
    robot = load_harpy()
    if search.search is None:
        _show_gait(robot, load_gait(walk.load), friction=walk.friction, stability=walk.stability)
        return
    found = _search(robot, search, walk.friction)
    try:
        if search.out is not None:
            found.save(search.out)
            look = f"look at it: python -m reproduction gait --load {search.out}"
            console.print(f"gait: {search.out}  ({look})", markup=False, highlight=False)
    finally:
        _show_gait(robot, found, friction=walk.friction, stability=False)
    if found.record.get("ending") == "interrupted":
        kept = [f"'{path}'" for path in (search.out, search.resume) if path is not None]
        say(f"interrupted; the best gait so far is {'in ' + ' and '.join(kept) if kept else 'not kept'}")
        raise typer.Exit(INTERRUPTED)


def _search(robot: Robot, options: SearchOptions, friction: float) -> OptimisedGait:
    """The best gait of a search."""
    from reproduction.gait import optimise_gait

    if options.start is not None and options.from_walk is not None:
        raise InputError("a search starts around --start or --from-walk, not both", name="start")
    check_outputs({"--resume": options.resume, "--out": options.out})
    task, around = options.task(robot, friction), options.around()
    with _search_bar(options.budget) as on_progress:
        return optimise_gait(
            robot,
            task=task,
            seed=options.seed,
            budget=options.budget,
            start=around,
            spread=options.spread,
            resume=options.resume,
            command=options.command(friction),
            on_progress=on_progress,
        )


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
    from dataclasses import asdict

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
