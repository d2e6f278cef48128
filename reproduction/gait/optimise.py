"""Search for a planar gait: CMA-ES from many starts, seeded, resumable.

The search is a function of its seed and of the costs found so far, so a file of costs is all it
takes to resume: the candidates are asked for again, and answered with their old costs, before the
first new walk.
"""

import json
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from harpy_pin import __version__, checks
from harpy_pin.errors import HarpyError, RunFileError, install_line, shown
from harpy_pin.files import check_writable, write_json
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from reproduction.gait.planar_gait import OptimisedGait, PlanarGait
from reproduction.gait.planar_model import PlanarModel
from reproduction.gait.search import (
    HEIGHT_MARGIN,
    PITCH_MARGIN,
    SPEED_MARGIN,
    VARIATION_WEIGHT,
    PlanarTask,
)

DRAWS = 60
"""Random gaits of which the best starts a run of CMA-ES."""
WIDE, CLOSE = 0.25, 0.05
"""First standard deviation of CMA-ES in the unit cube: from a random start, and around a given
gait.
"""
SAVE_EVERY = 200
"""Evaluations between two writings of the file to resume from."""


@dataclass(frozen=True)
class SearchProgress:
    """How far a search is."""

    evaluations: int  # walks tried so far
    budget: int  # walks to try
    cost: float  # the least so far
    gait: PlanarGait  # the gait that has it


def optimise_gait(
    robot: Robot,
    *,
    task: PlanarTask | None = None,
    seed: int = 0,
    budget: int = 10_000,
    start: PlanarGait | None = None,
    spread: float = CLOSE,
    resume: str | Path | None = None,
    command: str = "",
    on_progress: Callable[[SearchProgress], None] | None = None,
) -> OptimisedGait:
    """Search for a planar gait.

    Args:
        robot: a biped of Harpy's kind on its free flyer.
        task: what varies and what is minimised; the default task by default.
        seed: of every random number drawn; NumPy's global generator is left alone.
        budget: walks to try in all, those of the resumed search included.
        start: a gait to search around, instead of from random starts all over the bounds; its
            numbers that do not vary are kept where the task fixes none.
        spread: standard deviation of the first candidates around ``start``, as a share of the
            bounds.
        resume: a JSON file, kept up to date during the search; where it exists, the search goes on
            from it.
        command: how the search was asked for, kept in the record.
        on_progress: called after every walk.

    Returns:
        The best gait, with its record. Ctrl-C ends the search early and keeps the best so far
        (``ending`` in the record says so).

    Raises:
        InputError: bad budget or seed.
        HarpyError: the package ``cma`` is not installed.
        RunFileError: the file to resume from is damaged, belongs to another search, or cannot be
            written.
    """
    chosen = task if task is not None else PlanarTask(model=PlanarModel.from_robot(robot))
    budget, seed = checks.whole("budget", budget, low=1), checks.whole("seed", seed)
    if start is not None:
        kept = {name: value for name, value in start.as_dict().items() if name not in chosen.bounds}
        chosen = replace(chosen, fixed={**kept, **chosen.fixed})
    around = chosen.point(start) if start is not None else None
    spread = checks.number("spread", spread, low=0.0, high=1.0, strict=True)
    identity = _identity(chosen, seed, around, spread)
    path = Path(resume) if resume is not None else None
    if path is not None:
        check_writable(path)
    known = _load_costs(path, identity) if path is not None and path.exists() else []
    costs: list[float] = []
    best_cost, best_gait, ending = np.inf, None, "completed"
    candidates = _candidates(len(chosen.bounds), seed, around, spread)
    try:
        x = next(candidates)
        while True:
            gait = chosen.gait(x)
            old = len(costs) < len(known)
            cost = known[len(costs)] if old else chosen.evaluate(gait)
            costs.append(cost)
            if cost < best_cost:
                best_cost, best_gait = cost, gait
            if on_progress is not None and best_gait is not None and not old:
                on_progress(SearchProgress(len(costs), budget, best_cost, best_gait))
            if path is not None and not old and len(costs) % SAVE_EVERY == 0:
                _save_costs(path, identity, costs)
            if len(costs) >= budget:
                break
            x = candidates.send(cost)
    except KeyboardInterrupt:
        ending = "interrupted"
    if path is not None and len(costs) > len(known):
        _save_costs(path, identity, costs)
    if best_gait is None:
        raise KeyboardInterrupt
    record: dict[str, Any] = {
        "command": command,
        "ending": ending,
        "evaluations": len(costs),
        "cost": float(best_cost),
        **{k: v for k, v in identity.items() if k not in ("fixed", "start")},
        "harpy_pin": __version__,
    }
    return OptimisedGait(best_gait, record)


def _candidates(
    dimension: int, seed: int, around: Vector | None, spread: float
) -> Generator[Vector, float, None]:
    """Points of the unit cube to try, for ever; each is to be answered with its cost.

    Each run of CMA-ES starts wide at the best of some random draws, or close around a point and
    then around the best point so far.
    """
    cma = _cma()
    rng = np.random.default_rng(seed)

    def normal(*shape: int) -> Vector:
        return rng.standard_normal(shape)

    restart, best, centre = 0, np.inf, around
    while True:
        if around is None:
            draws = rng.uniform(size=(DRAWS, dimension))
            costs = []
            for draw in draws:
                costs.append((yield draw))
            centre = draws[int(np.argmin(costs))]
        options = {
            "bounds": [0.0, 1.0],
            "seed": np.nan,  # leaves the global generator alone
            "randn": normal,
            "verbose": -9,
            "popsize": (4 + int(3.0 * np.log(dimension))) * (1 if restart % 2 == 0 else 3),
            "tolfun": 1e-3,
            "tolstagnation": 60,
            "maxiter": 600,
        }
        strategy = cma.CMAEvolutionStrategy(centre, WIDE if around is None else spread, options)
        while not strategy.stop():
            points = strategy.ask()
            answers = []
            for point in points:
                answers.append((yield point))
                if around is not None and answers[-1] < best:
                    best, centre = answers[-1], np.clip(point, 0.005, 0.995)
            strategy.tell(points, answers)
        restart += 1


def _cma() -> Any:
    """The library of the search, imported when it is needed."""
    try:
        import cma
    except ImportError as error:
        raise HarpyError(
            f"the search for a gait needs the package 'cma': {install_line('gait')}"
        ) from error
    return cma


def _identity(task: PlanarTask, seed: int, around: Vector | None, spread: float) -> dict[str, Any]:
    """What a resumed search must have in common with the one that wrote the file."""
    return {
        "search": task.search,
        "seed": seed,
        "fixed": dict(task.fixed),
        "trial_duration": task.duration,
        "friction": list(task.friction),
        "speed_margin": SPEED_MARGIN,
        "height_margin": HEIGHT_MARGIN,
        "pitch_margin": PITCH_MARGIN,
        "slip_weight": task.slip_weight,
        "variation_weight": VARIATION_WEIGHT,
        "extra": task.extra_name,
        "spread": spread,
        "start": None if around is None else around.tolist(),
        "cma": str(_cma().__version__),
    }


def _save_costs(path: Path, identity: dict[str, Any], costs: list[float]) -> None:
    write_json(path, {**identity, "costs": costs})


def _load_costs(path: Path, identity: dict[str, Any]) -> list[float]:
    """Costs found so far."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        costs = [float(cost) for cost in content.pop("costs")]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise RunFileError(f"'{path}' is damaged or no search to resume", path=path) from error
    different = [name for name, value in identity.items() if content.get(name) != value]
    if different:
        name = different[0]
        raise RunFileError(
            f"'{path}' belongs to another search: its {name} is {shown(content.get(name))}, "
            f"desired {identity[name]!r}",
            path=path,
        )
    return costs
