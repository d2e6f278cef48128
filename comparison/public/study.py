"""What other people published, through ours: their quadratic programs beside their solvers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparison.measure.walking import Progress
from comparison.public.problems import is_convex, mat_problems, npz_problems
from comparison.public.solvers import LEVELS, time_solvers
from comparison.public.sources import find_sources, how_to_get
from comparison.tables import Cell, Table
from harpy_pin import checks

SETS = {"mpc": "dense programs of mpc_qpbenchmark", "maros": "dense positive definite ones of maros_meszaros"}
_ACCURACY = {"primal_max": "primal residual", "dual_max": "dual residual", "gap_max": "gap"}
_NOTE = (
    "Solved: claimed, with both residuals and the gap below 1e-3, 1e-6 and 1e-9. Residuals, gap and times at the "
    "last of these; residuals and gap are the largest of programs that were claimed. The mean is the shifted "
    "geometric one of qpbenchmark, in which a program without a solution counts 10 s."
)


@dataclass(frozen=True, kw_only=True)
class PublicSettings:
    """How much is measured: most programs of each set, which are taken evenly, and how often each is solved."""

    problems: int = 1000
    repetitions: int = 5

    def __post_init__(self) -> None:
        checks.whole("problems", self.problems, low=1)
        checks.whole("repetitions", self.repetitions, low=1)

    @classmethod
    def quick(cls) -> PublicSettings:
        """A few programs: to see whether it works."""
        return cls(problems=6, repetitions=1)


def measure_public(settings: PublicSettings, folder: Path, progress: Progress | None = None) -> dict[str, Any]:
    """Everything that the clones in a folder allow.

    Args:
        settings: how much.
        folder: with a clone of each repository, under its name.
        progress: told after every program.

    Returns:
        For each repository what was found; ``missing`` has the commands that bring the absent ones.

    Raises:
        InputError: no clone is there, or a file in one is not what it should be.
    """
    found, missing = find_sources(folder)
    result: dict[str, Any] = {"missing": how_to_get(missing, folder)}
    for name, path in found.items():
        problems = list(npz_problems(path) if name == "mpc" else filter(is_convex, mat_problems(path)))
        problems = problems[:: -(-len(problems) // settings.problems) or 1]
        result[name] = {"problems": len(problems), "solvers": time_solvers(problems, settings.repetitions, progress)}
    return result


def public_tables(result: dict[str, Any]) -> list[Table]:
    """The tables of :func:`measure_public`."""
    tables = []
    for name in (name for name in SETS if name in result):
        entry, high, cells = result[name], list(LEVELS)[-1], list[Cell]()
        best = min(row[high]["shifted_mean_us"] for row in entry["solvers"].values())
        for solver, levels in entry["solvers"].items():
            row = levels[high]
            cells += [Cell(solver, f"solved, {level}", levels[level]["solved_percent"], "%") for level in LEVELS]
            cells += [Cell(solver, text, row[key]) for key, text in _ACCURACY.items()]
            cells.append(Cell(solver, "median", row["median_us"], "µs"))
            cells.append(Cell(solver, "mean time, to the best", row["shifted_mean_us"] / best))
        tables.append(Table(f"public_{name}", f"{entry['problems']} {SETS[name]}", tuple(cells), _NOTE))
    if result["missing"]:
        cells = [Cell(f"missing {k}", "to get it", text) for k, text in enumerate(result["missing"], start=1)]
        tables.append(Table("public_missing", "Repositories that are not there", tuple(cells)))
    return tables
