"""Programs in the form of qpsolvers and qpbenchmark, and how good a solution of them is.

minimise ½ xᵀP x + qᵀx  subject to  G x ≤ h,  A x = b,  lb ≤ x ≤ ub
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
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


@dataclass(frozen=True)
class Problem:
    """A dense program; what it lacks is None."""

    name: str
    P: Vector
    q: Vector
    G: Vector | None = None
    h: Vector | None = None
    A: Vector | None = None
    b: Vector | None = None
    lb: Vector | None = None
    ub: Vector | None = None


@dataclass(frozen=True)
class Answer:
    """Variables x; multipliers y of equalities, z of inequalities, and z_box of bounds, negative at lower ones."""

    x: Vector
    y: Vector | None
    z: Vector | None
    z_box: Vector | None


def residuals(p: Problem, answer: Answer) -> tuple[float, float, float]:
    """Primal residual, dual residual and duality gap, as qpbenchmark defines them.

    They are max(‖A x − b‖∞, [G x − h]⁺, [lb − x]⁺, [x − ub]⁺), ‖P x + q + Aᵀy + Gᵀz + z_box‖∞ and
    |xᵀP x + qᵀx + bᵀy + hᵀz + lbᵀz_box⁻ + ubᵀz_box⁺| with infinite bounds left out: README of qpbenchmark 2.7,
    "Metrics", and Caron, "Optimality conditions and numerical tolerances in QP solvers" (2022). They are infinite where
    a multiplier is absent.
    """
    x, primal, dual = answer.x, 0.0, p.P @ answer.x + p.q
    gap = float(x @ p.P @ x + p.q @ x)
    for rows, value, multiplier, equal in ((p.A, p.b, answer.y, True), (p.G, p.h, answer.z, False)):
        if rows is None or value is None:
            continue
        if multiplier is None:
            return np.inf, np.inf, np.inf
        excess = rows @ x - value
        primal = max(primal, float((np.abs(excess) if equal else excess).max(initial=0.0)))
        dual = dual + rows.T @ multiplier
        gap += float(value @ multiplier)
    if p.lb is not None or p.ub is not None:
        if answer.z_box is None:
            return np.inf, np.inf, np.inf
        dual = dual + answer.z_box
    for bound, sign in ((p.lb, -1.0), (p.ub, 1.0)):
        if bound is not None and answer.z_box is not None:
            primal = max(primal, float((sign * (x - bound)).max()))
            finite = np.isfinite(bound)
            pull = np.maximum(sign * answer.z_box, 0.0)
            gap += float(sign * bound[finite] @ pull[finite])
    return primal, float(np.abs(dual).max()), abs(gap)


def is_convex(p: Problem) -> bool:
    """Whether P is positive definite by qpbenchmark's test: every computed eigenvalue is positive."""
    return bool((np.linalg.eigvals(p.P) > 0.0).all())


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Whatever goes wrong while a program is read becomes one error that names its file."""
    try:
        yield
    except (OSError, EOFError, RuntimeError, ValueError, TypeError, LookupError, BadZipFile, MatReadError) as error:
        raise InputError(f"'{path}' is no program: {error}", name="data", value=path) from error


def npz_problems(folder: Path) -> Iterator[Problem]:
    """The dense programs of mpc_qpbenchmark in a folder, in files of NumPy as qpsolvers saves them.

    What a program lacks is a pickled None there: it is recognised and never unpickled.
    """
    for path in sorted(folder.glob("*.npz")):
        if path.name.startswith(MPC_DENSE):
            with _reading(path), np.load(path, allow_pickle=False) as file:
                arrays: dict[str, Any] = {key: _array(file, key) for key in KEYS}
            yield Problem(path.stem, **arrays)


def _array(file: np.lib.npyio.NpzFile, key: str) -> Vector | None:
    try:
        return np.asarray(file[key], dtype=np.float64)
    except ValueError:  # an array of objects
        if key in ("P", "q"):
            raise
        return None


def mat_problems(folder: Path) -> Iterator[Problem]:
    """Programs of the dense subset of maros_meszaros_qpbenchmark: l ≤ [C; I] x ≤ u in files of Matlab."""
    for path in sorted(folder.glob("*.mat")):
        with _reading(path):
            file = loadmat(path, variable_names=["P", "q", "A", "l", "u", "n", "m"])
            n, m = int(file["n"].flat[0]), int(file["m"].flat[0])
            small = n <= LARGEST and m <= 3 * LARGEST
            problem = _one_sided(path.stem, file, n) if small else None
        if problem is not None and _count(problem) <= LARGEST:
            yield problem


def _one_sided(name: str, file: dict[str, Vector], n: int) -> Problem:
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
    return Problem(name, hessian, q, **inequalities, **equalities, lb=lower[-n:], ub=upper[-n:])


def _count(p: Problem) -> int:
    """Constraints as that subset counts them: bounds once."""
    return sum(len(value) for value in (p.h, p.b, p.lb) if value is not None)
