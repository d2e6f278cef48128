"""Public benchmarks: programs that other people published, read from clones that the user made, by
all solvers.

minimise ½ xᵀP x + qᵀx  subject to  G x ≤ h,  A x = b,  lb ≤ x ≤ ub
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from qpsolvers import Problem
from scipy.io import loadmat
from scipy.io.matlab import MatReadError
from scipy.sparse import csc_matrix

from comparison.measure.walking import Progress, silent
from comparison.public.solvers import KEYS, LEVELS, time_solvers
from comparison.tables import Cell, Table
from harpy_pin.errors import InputError
from harpy_pin.model.state import Vector

MPC_DENSE = ("LIPMWALK", "WHLIPBAL")
"""How the names of the dense programs of mpc_qpbenchmark begin."""
LARGEST = 1000
"""Most variables, and most constraints, of the dense subset of maros_meszaros_qpbenchmark."""
INFINITE = 9e19
"""A bound beyond this is none in the files of maros_meszaros_qpbenchmark."""
EQUAL = 1e-10
"""Bounds that differ by less make an equality there."""


def is_convex(named: tuple[str, Problem]) -> bool:
    """Whether P is positive definite by qpbenchmark's test: every computed eigenvalue is
    positive.
    """
    return bool((np.linalg.eigvals(named[1].P) > 0.0).all())


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Whatever goes wrong while a program is read becomes one error that names its file."""
    try:
        yield
    except (
        OSError,
        EOFError,
        RuntimeError,
        ValueError,
        TypeError,
        LookupError,
        BadZipFile,
        MatReadError,
    ) as error:
        raise InputError(f"'{path}' is no program: {error}", name="data", value=path) from error


def npz_problems(folder: Path) -> Iterator[tuple[str, Problem]]:
    """The dense programs of mpc_qpbenchmark in a folder, in files of NumPy as qpsolvers saves them.

    What a program lacks is a pickled None there: it is recognised and never unpickled.
    """
    for path in sorted(folder.glob("*.npz")):
        if path.name.startswith(MPC_DENSE):
            with _reading(path), np.load(path, allow_pickle=False) as file:
                arrays: dict[str, Any] = {key: _array(file, key) for key in KEYS}
            yield path.stem, Problem(**arrays)


def _array(file: np.lib.npyio.NpzFile, key: str) -> Vector | None:
    try:
        return np.asarray(file[key], dtype=np.float64)
    except ValueError:  # an array of objects
        if key in ("P", "q"):
            raise
        return None


def mat_problems(folder: Path) -> Iterator[tuple[str, Problem]]:
    """Programs of the dense subset of maros_meszaros_qpbenchmark: l ≤ [C; I] x ≤ u in files of
    Matlab.
    """
    for path in sorted(folder.glob("*.mat")):
        with _reading(path):
            file = loadmat(path, variable_names=["P", "q", "A", "l", "u", "n", "m"])
            n, m = int(file["n"].flat[0]), int(file["m"].flat[0])
            problem = _one_sided(file, n) if n <= LARGEST and m <= 3 * LARGEST else None
        if problem is not None:
            rows = (
                problem.h,
                problem.b,
                problem.lb,
            )  # constraints as that subset counts them: bounds once
            if sum(len(value) for value in rows if value is not None) <= LARGEST:
                yield path.stem, problem


def _one_sided(file: dict[str, Vector], n: int) -> Problem:
    hessian, rows = (
        np.asarray(csc_matrix(file[key]).toarray(), dtype=np.float64) for key in ("P", "A")
    )
    lower, upper = (np.asarray(file[key], dtype=np.float64).ravel() for key in ("l", "u"))
    lower[lower < -INFINITE], upper[upper > INFINITE] = -np.inf, np.inf
    low, high, constraint = lower[:-n], upper[:-n], rows[:-n]
    equal = high - low < EQUAL
    g, h = (
        np.vstack((constraint[~equal], -constraint[~equal])),
        np.concatenate((high[~equal], -low[~equal])),
    )
    g, h = g[np.isfinite(h)], h[np.isfinite(h)]
    inequalities: dict[str, Any] = {"G": g, "h": h} if h.size else {}
    equalities: dict[str, Any] = {"A": constraint[equal], "b": high[equal]} if equal.any() else {}
    q = np.asarray(file["q"], dtype=np.float64).ravel()
    return Problem(hessian, q, **inequalities, **equalities, lb=lower[-n:], ub=upper[-n:])


SOURCES = {"mpc": "qpsolvers/mpc_qpbenchmark", "maros": "qpsolvers/maros_meszaros_qpbenchmark"}
"""Repositories on GitHub whose folder ``data`` is read; their licence is Apache-2.0. Nothing of
theirs is part of this one.
"""
SETS = {
    "mpc": "dense programs of mpc_qpbenchmark",
    "maros": "dense positive definite ones of maros_meszaros",
}
_ACCURACY = {"primal_max": "primal residual", "dual_max": "dual residual", "gap_max": "gap"}
_NOTE = (
    "Solved: claimed, with both residuals and the gap below 1e-3, 1e-6 and 1e-9. Residuals, gap "
    "and times at the "
    "last of these; residuals and gap are the largest of programs that were claimed. The mean is "
    "the shifted "
    "geometric one of qpbenchmark, in which a program without a solution counts 10 s."
)


def measure_public(
    folder: Path, progress: Progress = silent, *, problems: int = 1000, repetitions: int = 5
) -> dict[str, Any]:
    """Everything that the clones in a folder allow.

    Args:
        folder: with a clone of each repository, under its name.
        progress: called after every program.
        problems: most of each set, which are taken evenly.
        repetitions: how often each is solved.

    Returns:
        For each repository what was found; ``missing`` has the commands that bring the absent ones.
    """
    clones = {name: folder / Path(repository).name for name, repository in SOURCES.items()}
    found = [name for name, clone in clones.items() if (clone / "data").is_dir()]
    absent = [name for name in SOURCES if name not in found]
    missing = [f"git clone https://github.com/{SOURCES[name]} '{clones[name]}'" for name in absent]
    if not found:
        message = (
            f"'{folder}' has no clone of {', '.join(SOURCES.values())}; to get them: "
            f"{' && '.join(missing)}"
        )
        raise InputError(message, name="data", value=folder)
    result: dict[str, Any] = {"missing": missing}
    for name in found:
        path = clones[name] / "data"
        every = list(npz_problems(path) if name == "mpc" else filter(is_convex, mat_problems(path)))
        chosen = every[:: -(-len(every) // problems) or 1]
        result[name] = {
            "problems": len(chosen),
            "solvers": time_solvers(chosen, repetitions, progress),
        }
    return result


def public_tables(result: Mapping[str, Any]) -> list[Table]:
    """The tables of :func:`measure_public`."""
    tables = []
    for name in (name for name in SETS if name in result):
        entry, high, cells = result[name], list(LEVELS)[-1], list[Cell]()
        best = min(row[high]["shifted_mean_us"] for row in entry["solvers"].values())
        for solver, levels in entry["solvers"].items():
            row = levels[high]
            cells += [
                Cell(solver, f"solved, {level}", levels[level]["solved_percent"], "%")
                for level in LEVELS
            ]
            cells += [Cell(solver, text, row[key]) for key, text in _ACCURACY.items()]
            cells.append(Cell(solver, "median", row["median_us"], "µs"))
            cells.append(Cell(solver, "mean time, to the best", row["shifted_mean_us"] / best))
        tables.append(
            Table(f"public_{name}", f"{entry['problems']} {SETS[name]}", tuple(cells), _NOTE)
        )
    if result["missing"]:
        cells = [
            Cell(f"missing {k}", "to get it", text)
            for k, text in enumerate(result["missing"], start=1)
        ]
        tables.append(Table("public_missing", "Repositories that are not there", tuple(cells)))
    return tables
