"""What other people published, through ours: their quadratic programs beside their solvers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from comparison.measure.walking import Progress
from comparison.public.problems import is_convex, mat_problems, npz_problems
from comparison.public.solvers import LEVELS, time_solvers
from comparison.tables import Cell, Table
from harpy_pin.errors import InputError

SOURCES = {"mpc": "qpsolvers/mpc_qpbenchmark", "maros": "qpsolvers/maros_meszaros_qpbenchmark"}
"""Repositories on GitHub whose folder ``data`` is read; their licence is Apache-2.0. Nothing of theirs is part of this
one."""
SETS = {"mpc": "dense programs of mpc_qpbenchmark", "maros": "dense positive definite ones of maros_meszaros"}
_ACCURACY = {"primal_max": "primal residual", "dual_max": "dual residual", "gap_max": "gap"}
_NOTE = (
    "Solved: claimed, with both residuals and the gap below 1e-3, 1e-6 and 1e-9. Residuals, gap and times at the "
    "last of these; residuals and gap are the largest of programs that were claimed. The mean is the shifted "
    "geometric one of qpbenchmark, in which a program without a solution counts 10 s."
)


def measure_public(
    folder: Path, progress: Progress | None = None, *, problems: int = 1000, repetitions: int = 5
) -> dict[str, Any]:
    """Everything that the clones in a folder allow.

    Args:
        folder: with a clone of each repository, under its name.
        progress: called after every program.
        problems: most of each set, which are taken evenly.
        repetitions: how often each is solved.

    Returns:
        For each repository what was found; ``missing`` has the commands that bring the absent ones.

    Raises:
        InputError: no clone is there, or a file in one is not what it should be.
    """
    clones = {name: folder / Path(repository).name for name, repository in SOURCES.items()}
    found = [name for name, clone in clones.items() if (clone / "data").is_dir()]
    missing = [
        f"git clone https://github.com/{repository} '{clones[name]}'"
        for name, repository in SOURCES.items()
        if name not in found
    ]
    if not found:
        message = f"'{folder}' has no clone of {', '.join(SOURCES.values())}; to get them: {' && '.join(missing)}"
        raise InputError(message, name="data", value=folder)
    result: dict[str, Any] = {"missing": missing}
    for name in found:
        path = clones[name] / "data"
        every = list(npz_problems(path) if name == "mpc" else filter(is_convex, mat_problems(path)))
        chosen = every[:: -(-len(every) // problems) or 1]
        result[name] = {"problems": len(chosen), "solvers": time_solvers(chosen, repetitions, progress)}
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
