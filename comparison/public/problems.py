"""Programs of public benchmarks, with their names, in the form of qpsolvers and qpbenchmark.

minimise ½ xᵀP x + qᵀx  subject to  G x ≤ h,  A x = b,  lb ≤ x ≤ ub
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from qpsolvers import Problem
from scipy.io import loadmat
from scipy.io.matlab import MatReadError
from scipy.sparse import csc_matrix

from harpy_pin.errors import InputError
from harpy_pin.model.state import Vector

KEYS = ("P", "q", "G", "h", "A", "b", "lb", "ub")
"""Fields of a program in files."""
MPC_DENSE = ("LIPMWALK", "WHLIPBAL")
"""How the names of the dense programs of mpc_qpbenchmark begin."""
LARGEST = 1000
"""Most variables, and most constraints, of the dense subset of maros_meszaros_qpbenchmark."""
INFINITE = 9e19
"""A bound beyond this is none in the files of maros_meszaros_qpbenchmark."""
EQUAL = 1e-10
"""Bounds that differ by less make an equality there."""


def is_convex(named: tuple[str, Problem]) -> bool:
    """Whether P is positive definite by qpbenchmark's test: every computed eigenvalue is positive."""
    return bool((np.linalg.eigvals(named[1].P) > 0.0).all())


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Whatever goes wrong while a program is read becomes one error that names its file."""
    try:
        yield
    except (OSError, EOFError, RuntimeError, ValueError, TypeError, LookupError, BadZipFile, MatReadError) as error:
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
    """Programs of the dense subset of maros_meszaros_qpbenchmark: l ≤ [C; I] x ≤ u in files of Matlab."""
    for path in sorted(folder.glob("*.mat")):
        with _reading(path):
            file = loadmat(path, variable_names=["P", "q", "A", "l", "u", "n", "m"])
            n, m = int(file["n"].flat[0]), int(file["m"].flat[0])
            small = n <= LARGEST and m <= 3 * LARGEST
            problem = _one_sided(file, n) if small else None
        if problem is not None and _count(problem) <= LARGEST:
            yield path.stem, problem


def _one_sided(file: dict[str, Vector], n: int) -> Problem:
    hessian, rows = (np.asarray(csc_matrix(file[key]).toarray(), dtype=np.float64) for key in ("P", "A"))
    lower, upper = (np.asarray(file[key], dtype=np.float64).ravel() for key in ("l", "u"))
    lower[lower < -INFINITE], upper[upper > INFINITE] = -np.inf, np.inf
    low, high, constraint = lower[:-n], upper[:-n], rows[:-n]
    equal = high - low < EQUAL
    g, h = np.vstack((constraint[~equal], -constraint[~equal])), np.concatenate((high[~equal], -low[~equal]))
    g, h = g[np.isfinite(h)], h[np.isfinite(h)]
    inequalities: dict[str, Any] = {"G": g, "h": h} if h.size else {}
    equalities: dict[str, Any] = {"A": constraint[equal], "b": high[equal]} if equal.any() else {}
    q = np.asarray(file["q"], dtype=np.float64).ravel()
    return Problem(hessian, q, **inequalities, **equalities, lb=lower[-n:], ub=upper[-n:])


def _count(p: Problem) -> int:
    """Constraints as that subset counts them: bounds once."""
    return sum(len(value) for value in (p.h, p.b, p.lb) if value is not None)
