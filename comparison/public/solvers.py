"""Solvers on programs of other people, to qpbenchmark's tolerances: how many they solve, and how
fast.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import qpsolvers
from qpsolvers import Problem, Solution
from scipy.sparse import csc_matrix

from comparison.measure.timing import without_gc
from comparison.measure.walking import Progress, silent
from harpy_pin.model.record import field
from harpy_pin.wbc.active_set_warm_start import EXCHANGES_PER_ROW, DualActiveSet
from harpy_pin.wbc.condensed.active_set import UNBOUNDED
from harpy_pin.wbc.program import QPStatus, QuadraticProgram

KEYS = ("P", "q", "G", "h", "A", "b", "lb", "ub")
"""Fields of a program, of qpsolvers and in files."""
LEVELS = {"low": 1e-3, "mid": 1e-6, "high": 1e-9}
"""Bound on both residuals and on the gap, at each of qpbenchmark's accuracies."""
TIME_LIMIT, SHIFT = 10.0, 10.0
"""Time that a program without a solution counts, s, and shift of the geometric mean of times, s:
qpbenchmark's.
"""

Contender = Callable[[Problem, float], tuple[Callable[[], Any], Callable[[Any], Solution]]]
"""Of a program and an accuracy: what is timed, and what makes a solution of its result."""


def settings_of(solver: str, eps: float) -> dict[str, Any]:
    """Options by which qpbenchmark 2.7 asks a solver for an accuracy (``SolverSettings``,
    ``TestSet``).
    """
    gap = {"check_duality_gap": True, "eps_duality_gap_abs": eps, "eps_duality_gap_rel": 0.0}
    return {
        "clarabel": {"tol_feas": eps, "tol_gap_abs": eps, "tol_gap_rel": 0.0},
        "daqp": {"primal_tol": eps, "dual_tol": eps},
        "piqp": {"eps_abs": eps, "eps_rel": 0.0, **gap},
        "proxqp": {"eps_abs": eps, "eps_rel": 0.0, **gap},
        "quadprog": {},
    }[solver]


def through_qpsolvers(solver: str) -> Contender:
    """A solver as qpbenchmark calls it; the conversion to sparse matrices is not timed there
    either.
    """

    def contender(p: Problem, eps: float) -> tuple[Callable[[], Any], Callable[[Any], Solution]]:
        arrays = {key: getattr(p, key) for key in KEYS}
        if solver == "clarabel":
            arrays |= {
                key: csc_matrix(arrays[key]) for key in ("P", "G", "A") if arrays[key] is not None
            }
        problem, options = qpsolvers.Problem(**arrays), settings_of(solver, eps)
        return lambda: qpsolvers.solve_problem(
            problem, solver=solver, **options
        ), lambda solution: solution

    return contender


def daqp_alone(p: Problem, eps: float) -> tuple[Callable[[], Any], Callable[[Any], Solution]]:
    """DAQP without what qpsolvers does before and after; its arrays are made beforehand."""
    import daqp

    n, absent = len(p.q), np.zeros(0)
    box = 0 if p.lb is None and p.ub is None else n
    h, b = (absent if value is None else value for value in (p.h, p.b))
    end = box + len(h)
    upper, lower = np.concatenate((np.full(box, 1e30), h, b)), np.full(end + len(b), -1e30)
    if p.ub is not None:
        upper[:box] = p.ub
    if p.lb is not None:
        lower[:box] = p.lb
    lower[end:] = b
    rows = np.vstack([matrix for matrix in (p.G, p.A) if matrix is not None] or [np.zeros((0, n))])
    sense = np.zeros(len(upper), dtype=np.int32)
    sense[end:] = 5  # equality

    def read(result: Any) -> Solution:
        x, _, flag, info = result
        lam = info["lam"]
        return Solution(
            p, found=flag > 0, x=x, y=lam[end:], z=lam[box:end], z_box=lam[:box] if box else None
        )

    return lambda: daqp.solve(
        p.P, p.q, rows, upper, lower, sense, primal_tol=eps, dual_tol=eps
    ), read


def dual_made(p: Problem, eps: float) -> tuple[Callable[[], Any], Callable[[Any], Solution]]:
    """Ours as qpsolvers calls a solver: all memory is made for this program. It is exact and takes
    no tolerance.
    """
    return lambda: solve_with_dual(p), lambda solution: solution


def dual_kept(p: Problem, eps: float) -> tuple[Callable[[], Any], Callable[[Any], Solution]]:
    """Ours as a controller calls it: memory is there, the arrays are filled and the program is
    solved.
    """
    program, solver = _make(p)

    def solve() -> bool:
        _fill(p, program)
        return solver.solve(program).status is QPStatus.SOLVED

    return (
        solve,
        lambda solved: _solution(p, program, solver) if solved else Solution(p, found=False),
    )


def solve_with_dual(p: Problem) -> Solution:
    """Our dual method on a program, its memory made for it."""
    solve, read = dual_kept(p, 0.0)
    return read(solve())


def _make(p: Problem) -> tuple[QuadraticProgram, DualActiveSet]:
    equalities, rows = (0 if value is None else len(value) for value in (p.b, p.h))
    bounded = 0 if p.lb is None and p.ub is None else len(p.q)
    program = QuadraticProgram(len(p.q), equalities=equalities, inequalities=rows, bounded=bounded)
    solver = DualActiveSet(program)
    # The bound that keeps a tick short is too low for programs with hundreds of active constraints.
    solver.limit = EXCHANGES_PER_ROW * (equalities + rows + bounded)
    solver._record_["limit"] = solver.limit
    return program, solver


def _fill(p: Problem, program: QuadraticProgram) -> None:
    bounded = program.bounded
    program.hessian[:], program.gradient[:] = p.P, p.q
    if p.A is not None:
        program.equality[:], program.equality_value[:] = p.A, p.b
    if p.G is not None:
        program.inequality[bounded:], program.upper[bounded:] = p.G, p.h
    if p.lb is not None:
        np.maximum(p.lb, -UNBOUNDED, out=program.lower[:bounded])
    if p.ub is not None:
        np.minimum(p.ub, UNBOUNDED, out=program.upper[:bounded])


def _solution(p: Problem, program: QuadraticProgram, solver: DualActiveSet) -> Solution:
    """The solution, with multipliers in the form and the signs of qpsolvers."""
    n_eq, bounded, x = len(program.equality_value), program.bounded, solver.solution.z.copy()
    rows = np.zeros(len(solver.active))
    for constraint, pull in zip(
        field(solver.record, "chosen"), field(solver.record, "multiplier"), strict=False
    ):
        if constraint >= n_eq and solver.active[constraint - n_eq] and not rows[constraint - n_eq]:
            rows[constraint - n_eq] = solver.active[constraint - n_eq] * pull
    y = np.zeros(0)
    if n_eq:  # the method keeps neither the sign of an equality nor one that is redundant
        rest = program.hessian @ x + program.gradient + program.inequality.T @ rows
        y = np.asarray(np.linalg.lstsq(program.equality.T, -rest, rcond=None)[0], dtype=np.float64)
    return Solution(
        p, found=True, x=x, y=y, z=rows[bounded:], z_box=rows[:bounded] if bounded else None
    )


SOLVERS: dict[str, Contender] = {
    "dual (ours)": dual_made,
    "dual (ours), memory kept": dual_kept,
    **{
        name: through_qpsolvers(name) for name in ("daqp", "quadprog", "piqp", "proxqp", "clarabel")
    },
    "daqp, without qpsolvers": daqp_alone,
}
"""What is compared, by the name that readers see."""


class _Row(NamedTuple):
    """A program under one solver: whether a solution is claimed, the median time, s, residuals and
    gap.
    """

    name: str
    claimed: bool
    time: float
    residuals: tuple[float, float, float]


def time_solvers(
    problems: Sequence[tuple[str, Problem]], repetitions: int, progress: Progress = silent
) -> dict[str, dict[str, Any]]:
    """All solvers on all programs to all accuracies, one after the other on each program.

    Returns:
        For each solver and accuracy the share of programs that it says it solved and whose
        residuals and gap are below the tolerance, the names of the others, the largest residuals
        and gap among those it says it solved, the median time of a program and the shifted
        geometric mean of the times, µs.
    """
    kept: dict[tuple[str, str], list[_Row]] = {
        (name, level): [] for name in SOLVERS for level in LEVELS
    }
    with warnings.catch_warnings(), without_gc():
        warnings.simplefilter("ignore")
        for done, (name, p) in enumerate(problems, start=1):
            for level, eps in LEVELS.items():
                for solver, contender in SOLVERS.items():
                    kept[solver, level].append(_solved(name, *contender(p, eps), repetitions))
            progress(done, len(problems))
    return {
        name: {level: _summary(kept[name, level], eps) for level, eps in LEVELS.items()}
        for name in SOLVERS
    }


def _solved(
    name: str, solve: Callable[[], Any], read: Callable[[Any], Solution], repetitions: int
) -> _Row:
    """A row for a program; a first, untimed call warms up."""
    with suppress(Exception):  # as in qpbenchmark: a solver that raises has found nothing
        solution, times = read(solve()), []
        for _ in range(repetitions if solution.found else 0):
            begin = perf_counter()
            solve()
            times.append(perf_counter() - begin)
        if times:
            residuals = (
                solution.primal_residual(),
                solution.dual_residual(),
                solution.duality_gap(),
            )
            return _Row(name, True, float(np.median(times)), residuals)
    return _Row(name, False, TIME_LIMIT, (np.inf, np.inf, np.inf))


def _summary(rows: Sequence[_Row], eps: float) -> dict[str, Any]:
    found = [row for row in rows if row.claimed]
    unsolved = [row.name for row in rows if not (row.claimed and max(row.residuals) < eps)]
    # http://plato.asu.edu/ftp/shgeom.html
    shifted = float(np.exp(np.mean(np.log([row.time + SHIFT for row in rows]))) - SHIFT)
    worst = np.array([row.residuals for row in found]).max(axis=0) if found else np.full(3, np.nan)
    return {
        "solved_percent": 100.0 * (1.0 - len(unsolved) / len(rows)),
        "claimed_percent": 100.0 * len(found) / len(rows),
        "unsolved": unsolved,
        **dict(zip(("primal_max", "dual_max", "gap_max"), worst.tolist(), strict=True)),
        "median_us": 1e6 * float(np.median([row.time for row in found])) if found else None,
        "shifted_mean_us": 1e6 * shifted,
    }
