"""The dual active-set method of Goldfarb and Idnani (1983), for strictly convex programs.

It starts from the optimum without constraints and adds the most violated one, with a step along which active
constraints stay active and multipliers keep their signs; a constraint whose multiplier reaches zero on the way is
dropped. The objective grows at every full step, so no active set comes twice and the method ends; where no step is
left, the constraints contradict each other. Rounding may break that argument, so the exchanges are bounded.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import RecordOf, Records, field, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.program import ProgramRecord, QuadraticProgram, row_value
from harpy_pin.wbc.qp_solver import QPSolver, QPStatus

__all__ = ["DualActiveSet"]

EXCHANGES_PER_ROW = 4
"""Bound on the constraints added and dropped, for each constraint of the program."""
MAX_EXCHANGES = 300
"""Bound for large programs: twice the most that walks of G1 need."""
TOLERANCE = 1e-9
"""Violation (N, N·m, m/s²) that counts as none, besides what rounding leaves."""
ROUNDING = 1e-13
"""Relative error of a row's value."""
DEPENDENT = 1e-11
"""Share of a constraint's normal outside the span of the active ones, below which it depends on them."""
SINGLE = {"TOLERANCE": 1e-4, "ROUNDING": 1e-6, "DEPENDENT": 1e-4}
"""Constants that differ in single precision."""

_SOLVED, _EXHAUSTED, _INFEASIBLE = 0, 1, 2
_STATUS = {_SOLVED: QPStatus.SOLVED, _EXHAUSTED: QPStatus.MAX_ITERATIONS, _INFEASIBLE: QPStatus.INFEASIBLE}


class DualRecord(RecordOf):
    """Work space of :class:`DualActiveSet`."""

    # −1 for an inequality at its lower bound, 1 at its upper bound, else 0
    active: NDArray[np.int64] = sized("rows", whole=True)
    scale: Vector = sized("rows")  # 1 / norm of each row of C
    factor: Vector = sized("n", "n")  # L of H = Lᵀ L
    basis: Vector = sized("n", "n")  # Q L⁻ᵀ, Q turning the normals of the active constraints into [R; 0]
    triangle: Vector = sized("n", "n")  # R
    # the active constraints in the order of R: equalities, then n_eq + row
    chosen: NDArray[np.int64] = sized("n", whole=True)
    multiplier: Vector = sized("n + 1")  # of the active constraints, and of the one that comes in
    normal: Vector = sized("n")  # of the constraint that comes in
    turned: Vector = sized("n")  # basis · normal
    pull: Vector = sized("n")  # R⁻¹ of its leading part: how fast the multipliers fall
    limit: int  # exchanges after which a solve gives up


@fixed_arrays("active", "record")
class DualActiveSet(QPSolver):
    """Cold at every tick, and needs no package.

    Attributes:
        active: (rows,) of the last solve: −1 for an inequality at its lower bound, 1 at its upper bound, else 0.
        limit: exchanges after which a solve gives up.
    """

    name: ClassVar[str] = "dual"
    _record_: Records[DualRecord]

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self.limit = min(EXCHANGES_PER_ROW * (n_eq + rows), MAX_EXCHANGES)
        self.record = make_record(DualRecord, {"n": n, "rows": rows}, limit=np.int64(self.limit))
        self.active: Vector = field(self.record, "active")

    def prepare(self, program: QuadraticProgram) -> None:
        """See :meth:`QPSolver.prepare`."""
        super().prepare(program)
        dual_active_set.prepare(program.record, self.record, self.solution.z)

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        outcome, self.solution.iterations = dual_active_set(program._record_, self._record_, self.solution.z)
        return _STATUS[outcome]


@kernel
def dual_active_set(qp: ProgramRecord, w: DualRecord, z: Vector) -> tuple[int, int]:
    """Optimum z; returns the outcome and how many exchanges it took."""
    n, n_eq = qp.gradient.shape[0], qp.equality_value.shape[0]
    _start(qp, w, z)
    size = exchanges = 0
    for c in range(n_eq):
        value = -qp.equality_value[c]
        for i in range(n):
            value += qp.equality[c, i] * z[i]
        sign = -1.0 if value > 0.0 else 1.0
        for i in range(n):
            w.normal[i] = sign * qp.equality[c, i]
        outcome, size, exchanges = _bring_in(w, c, size, n_eq, -abs(value), exchanges, z)
        if outcome == _INFEASIBLE and abs(value) <= _noise(w.normal, qp.equality_value[c], z):
            continue  # redundant
        if outcome != _SOLVED:
            return outcome, exchanges
    while exchanges < w.limit:
        r, side = _most_violated(qp, w, z)
        if side == 0:
            return _SOLVED, exchanges
        for i in range(n):
            w.normal[i] = -side * qp.inequality[r, i]
        slack = row_value(qp, r, z) - qp.lower[r] if side < 0 else qp.upper[r] - row_value(qp, r, z)
        w.active[r] = side
        outcome, size, exchanges = _bring_in(w, n_eq + r, size, n_eq, slack, exchanges, z)
        if outcome != _SOLVED:
            return outcome, exchanges
    return _EXHAUSTED, exchanges


@kernel
def _start(qp: ProgramRecord, w: DualRecord, z: Vector) -> None:
    """No constraint active, z = −H⁻¹ g."""
    n = z.shape[0]
    factorise(qp.hessian, w.factor)
    w.basis[:] = 0.0
    for i in range(n):
        w.basis[i, i] = 1.0
        z[i] = -qp.gradient[i]
    solve_transposed(w.factor, w.basis, n)
    solve_transposed(w.factor, z.reshape((n, 1)), 1)
    solve_factor(w.factor, z.reshape((n, 1)), 1)
    w.active[:] = 0
    for r in range(w.active.shape[0]):
        square = 0.0
        for i in range(n):
            square += qp.inequality[r, i] ** 2
        w.scale[r] = 1.0 / np.sqrt(square) if square > 0.0 else 1.0


@kernel
def _noise(normal: Vector, value: float, z: Vector) -> float:
    """Violation of normal · z = value that may be rounding."""
    size = abs(value)
    for i in range(z.shape[0]):
        size += abs(normal[i] * z[i])
    return TOLERANCE + ROUNDING * size


@kernel
def _most_violated(qp: ProgramRecord, w: DualRecord, z: Vector) -> tuple[int, int]:
    """Row that is violated by the largest distance, and its side; side 0 where none is."""
    worst, row, side = 0.0, 0, 0
    for r in range(w.active.shape[0]):
        if w.active[r] != 0:
            continue
        s = row_value(qp, r, z)
        below, above = qp.lower[r] - s, s - qp.upper[r]
        size = max(below, above)
        if size * w.scale[r] > worst:
            bound = qp.lower[r] if below > above else qp.upper[r]
            if size > _noise(qp.inequality[r], bound, z):
                worst, row, side = size * w.scale[r], r, (-1 if below > above else 1)
    return row, side


@kernel
def _bring_in(
    w: DualRecord, constraint: int, size: int, n_eq: int, slack: float, exchanges: int, z: Vector
) -> tuple[int, int, int]:
    """Make ``w.normal`` · z = value hold, which falls short by −``slack``; drops constraints that block it.

    Returns:
        The outcome, the number of active constraints, and the exchanges so far.
    """
    n = z.shape[0]
    basis, triangle, turned, pull, multiplier = w.basis, w.triangle, w.turned, w.pull, w.multiplier
    gained = 0.0  # multiplier of the constraint that comes in
    while exchanges < w.limit:
        exchanges += 1
        whole, free = 0.0, 0.0
        for k in range(n):
            s = 0.0
            for i in range(n):
                s += basis[k, i] * w.normal[i]
            turned[k] = s
            whole += s * s
            if k >= size:
                free += s * s
        for a in range(size - 1, -1, -1):
            s = turned[a]
            for b in range(a + 1, size):
                s -= triangle[a, b] * pull[b]
            pull[a] = s / triangle[a, a]
        leaves, partial = -1, np.inf
        for a in range(size):
            if w.chosen[a] >= n_eq and pull[a] > 0.0 and multiplier[a] < partial * pull[a]:
                leaves, partial = a, max(multiplier[a] / pull[a], 0.0)
        full = -slack / free if free > DEPENDENT**2 * whole else np.inf
        length = min(partial, full)
        if not length < np.inf:
            return _INFEASIBLE, size, exchanges
        for a in range(size):
            multiplier[a] -= length * pull[a]
        gained += length
        if full < np.inf:
            for k in range(size, n):
                for i in range(n):
                    z[i] += length * turned[k] * basis[k, i]
            slack += length * free
        if full <= partial:
            _add(w, size)
            w.chosen[size], multiplier[size] = constraint, gained
            return _SOLVED, size + 1, exchanges
        w.active[w.chosen[leaves] - n_eq] = 0
        size -= 1
        _drop(w, leaves, size)
    return _EXHAUSTED, size, exchanges


@kernel
def _turn(a: float, b: float) -> tuple[float, float, float]:
    """Cosine and sine of the rotation that takes (a, b) to (length, 0), and the length."""
    length = np.hypot(a, b)
    return (a / length, b / length, length) if length > 0.0 else (1.0, 0.0, 0.0)


@kernel
def _rotate(matrix: Vector, k: int, first: int, c: float, s: float) -> None:
    """Rotate rows k and k + 1 from column ``first`` on."""
    for i in range(first, matrix.shape[1]):
        x, y = matrix[k, i], matrix[k + 1, i]
        matrix[k, i] = c * x + s * y
        matrix[k + 1, i] = c * y - s * x


@kernel
def _add(w: DualRecord, size: int) -> None:
    """The constraint of ``w.turned`` becomes the last column of R."""
    for k in range(w.turned.shape[0] - 2, size - 1, -1):
        c, s, length = _turn(w.turned[k], w.turned[k + 1])
        w.turned[k] = length
        _rotate(w.basis, k, 0, c, s)
    for k in range(size + 1):
        w.triangle[k, size] = w.turned[k]


@kernel
def _drop(w: DualRecord, out: int, size: int) -> None:
    """Column ``out`` leaves R, which keeps ``size`` columns."""
    for a in range(out, size):
        w.chosen[a], w.multiplier[a] = w.chosen[a + 1], w.multiplier[a + 1]
        for k in range(a + 2):
            w.triangle[k, a] = w.triangle[k, a + 1]
    for k in range(out, size):
        c, s, length = _turn(w.triangle[k, k], w.triangle[k + 1, k])
        _rotate(w.triangle, k, k + 1, c, s)
        w.triangle[k, k], w.triangle[k + 1, k] = length, 0.0
        _rotate(w.basis, k, 0, c, s)
