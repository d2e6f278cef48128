"""The search for the active set of a strictly convex program: the last one, its exchange, then the
dual method.

**Exchange.** The active set seldom changes from tick to tick, and then a solve is one linear
system. With the active constraints guessed, the optimum solves H z + g = Wᵀλ, W z = w. The guess is
right if and only if no other constraint is violated and every multiplier has its sign. If not, one
constraint is exchanged, a few times: the wrong multiplier that is largest, or else the largest
violation. It starts over without any where the active constraints depend on each other.

**Dual method** of Goldfarb and Idnani (1983). It starts from the optimum without constraints and
adds the most violated one, with a step along which active constraints stay active and multipliers
keep their signs; a constraint whose multiplier reaches zero on the way is dropped. The objective
grows at every full step, so no active set comes twice and the method ends; where no step is left,
the constraints contradict each other. Rounding may break that argument, so the exchanges are
bounded.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import ByPrecision, kernel
from harpy_pin.model.cholesky import (
    add_gram,
    factorise,
    solve_factor,
    solve_transposed,
    solve_vector,
)
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector

UNBOUNDED = 1e20
"""A bound of this size or more counts as infinite."""
EXCHANGES = 6
"""Systems solved before the dual method is called: more make the worst ticks longer, fewer G1's
mean tick.
"""
TOLERANCE = ByPrecision(1e-7, single=1e-4)
"""Violation (N, N·m, m/s²) with which a guess still counts as right."""
PULL = ByPrecision(1e-11, single=1e-7)
"""Multiplier of the wrong sign with which a guess still counts as right. Forces of heavy robots
weigh some 1e-8.
"""
VIOLATION = ByPrecision(1e-9, single=1e-4)
"""Violation (N, N·m, m/s²) that the dual method leaves, besides what rounding leaves."""
ROUNDING = ByPrecision(1e-13, single=1e-6)
"""Relative error of a row's value."""
DEPENDENT = ByPrecision(1e-11, single=1e-4)
"""Share of a constraint's normal outside the span of the active ones, below which it depends on
them.
"""
FOUND, EXHAUSTED, CONTRADICTORY = 0, 1, 2
"""How the dual method ends: with the optimum, at its bound, or because constraints contradict each
other.
"""


class ProgramRecord(RecordOf):
    """Arrays of a :class:`~harpy_pin.wbc.program.QuadraticProgram`: ½ zᵀH z + gᵀz, A z = b, l ≤ C z
    ≤ u.
    """

    hessian: Vector = sized("size", "size")  # H, positive definite
    gradient: Vector = sized("size")  # g
    equality: Vector = sized("equalities", "size")  # A
    equality_value: Vector = sized("equalities")  # b
    inequality: Vector  # (bounded + inequalities, n) C
    lower: Vector = sized("rows", fill=-UNBOUNDED)  # l
    upper: Vector = sized("rows", fill=UNBOUNDED)  # u
    bounded: int  # how many variables have bounds


class ActiveSetRecord(RecordOf):
    """Work space of the exchange, and the account of a tick."""

    # −1 for a row at its lower bound, 1 at its upper bound, else 0
    active: NDArray[np.int64] = sized("rows", whole=True)
    chosen: NDArray[np.int64] = sized("rows", whole=True)  # the active rows, packed to the front
    multiplier: Vector = sized("n_eq + rows")  # of the equalities and the active rows
    factor: Vector = sized("n", "n")  # L of H = Lᵀ L
    columns: Vector = sized(
        "n", "n_eq + rows + 1"
    )  # L⁻ᵀ [Aᵀ Wᵀ −g], one column per active constraint
    schur: Vector = sized("n_eq + rows", "n_eq + rows")  # factor of W H⁻¹ Wᵀ
    # exchanges of the dual method that all solves of a tick may take; a system counts as ``SYSTEM``
    budget: int
    most: int  # that it may take in one solve
    left: int = ZERO  # of the budget, in this tick
    systems: int = ZERO  # solved in this tick
    exchanges: int = ZERO  # of the dual method in this tick
    searched: int = ZERO  # how many solves needed that method
    iterations: int = ZERO  # of the last solve
    violation: float = 0.0  # of the last solution


class DualRecord(RecordOf):
    """Work space of the dual method."""

    # −1 for an inequality at its lower bound, 1 at its upper bound, else 0
    active: NDArray[np.int64] = sized("rows", whole=True)
    scale: Vector = sized("rows")  # 1 / norm of each row of C
    factor: Vector = sized("n", "n")  # L of H = Lᵀ L
    basis: Vector = sized(
        "n", "n"
    )  # Q L⁻ᵀ, Q turning the normals of the active constraints into [R; 0]
    triangle: Vector = sized("n", "n")  # R
    # the active constraints in the order of R: equalities, then n_eq + row
    chosen: NDArray[np.int64] = sized("n", whole=True)
    multiplier: Vector = sized("n + 1")  # of the active constraints, and of the one that comes in
    normal: Vector = sized("n")  # of the constraint that comes in
    turned: Vector = sized("n")  # basis · normal
    pull: Vector = sized("n")  # R⁻¹ of its leading part: how fast the multipliers fall
    # columns of each row of C from which on, and up to which, there are entries other than zero
    span: NDArray[np.int64] = sized("rows", 2, whole=True)
    limit: int  # exchanges after which a solve gives up


@kernel
def row_value(qp: ProgramRecord, r: int, z: Vector) -> float:
    """Row r of C z; the first rows are the bounded variables themselves."""
    if r < qp.bounded:
        return float(z[r])
    return float(qp.inequality[r] @ z)


@kernel
def equality_residual(qp: ProgramRecord, z: Vector) -> float:
    """Largest |A z − b|; inf where one is not a number."""
    residual = qp.equality @ z - qp.equality_value
    worst = np.max(abs(residual), initial=0.0)
    return np.inf if np.isnan(worst) else worst


@kernel
def exchange(qp: ProgramRecord, w: ActiveSetRecord, z: Vector, most: int) -> tuple[int, float]:
    """Systems solved until the guess was right, at most ``most``, and the violation of z.

    The number is ``EXCHANGES`` + 1 where the guess never was right.
    """
    n, n_eq = qp.gradient.shape[0], qp.equality_value.shape[0]
    factorise(qp.hessian, w.factor)
    again = False
    for attempt in range(1, most + 1):
        count = _choose(w)
        # Too many constraints, or ones that depend on each other: start over with none.
        if n_eq + count > n or not _solve_active(qp, w, count, z):
            w.active[:] = 0
            if again:
                break
            again = True
            continue
        wrong, worst = _correct(qp, w, count, z)
        worst = max(worst, equality_residual(qp, z))
        if worst == np.inf:
            w.active[:] = 0
            break
        if wrong == 0:
            # A nearly singular system may have left the active constraints themselves.
            return (attempt if worst <= 10.0 * TOLERANCE else EXCHANGES + 1), worst
    return EXCHANGES + 1, np.inf


@kernel
def _choose(w: ActiveSetRecord) -> int:
    """Pack the active rows to the front of ``chosen``; returns how many there are."""
    count = 0
    for r in range(w.active.shape[0]):
        if w.active[r] != 0:
            w.chosen[count] = r
            count += 1
    return count


@kernel
def _solve_active(qp: ProgramRecord, w: ActiveSetRecord, count: int, z: Vector) -> bool:
    """Optimum z and multipliers on the chosen constraints; whether z is finite."""
    n, n_eq = qp.gradient.shape[0], qp.equality_value.shape[0]
    m, rows = n_eq + count, w.chosen[:count]
    columns = w.columns
    columns[:, :n_eq] = qp.equality.T
    columns[:, n_eq:m] = qp.inequality[rows].T
    columns[:, m] = -qp.gradient
    solve_transposed(w.factor, columns, m + 1)
    # Multipliers: (W H⁻¹ Wᵀ) λ = w + W H⁻¹ g.
    system, multiplier = w.schur[:m, :m], w.multiplier[:m]
    system[:] = 0.0
    multiplier[:n_eq] = qp.equality_value
    multiplier[n_eq:] = np.where(w.active[rows] < 0, qp.lower[rows], qp.upper[rows])
    add_gram(columns[:, :m], -columns[:, m], system, multiplier)
    factorise(system, system)
    solve_vector(system, multiplier)
    z[:] = columns[:, :m] @ multiplier + columns[:, m]
    solve_factor(w.factor, z.reshape((n, 1)), 1)
    size: float = np.sum(abs(z))
    return size < np.inf


@kernel
def _correct(qp: ProgramRecord, w: ActiveSetRecord, count: int, z: Vector) -> tuple[int, float]:
    """Drop the row whose multiplier has the wrong sign by most, or else add the one that is
    violated by most.

    Returns:
        How many rows were wrong, and the largest violation; inf where a bound or row is NaN.
    """
    n_eq, active = qp.equality_value.shape[0], w.active
    wrong, worst = 0, 0.0
    chosen, change, size = 0, 0, 0.0
    for c in range(count):
        r = w.chosen[c]
        pull = active[r] * w.multiplier[n_eq + c]
        if pull > PULL:
            wrong += 1
            if pull > size:
                chosen, change, size = r, -active[r], pull
    drops = wrong > 0
    for r in range(active.shape[0]):
        s = row_value(qp, r, z)
        below, above = qp.lower[r] - s, s - qp.upper[r]
        if np.isnan(below) or np.isnan(above):
            return 1, np.inf
        worst = max(worst, below, above)
        if active[r] == 0 and (below > TOLERANCE or above > TOLERANCE):
            wrong += 1
            if not drops and max(below, above) > size:
                chosen, change, size = r, -1 if below > above else 1, max(below, above)
    if wrong > 0:
        active[chosen] += change
    return wrong, worst


@kernel
def dual_active_set(qp: ProgramRecord, w: DualRecord, z: Vector) -> tuple[int, int]:
    """Optimum z; returns the outcome and how many exchanges it took."""
    n_eq = qp.equality_value.shape[0]
    _start(qp, w, z)
    size = exchanges = 0
    for c in range(n_eq):
        value = qp.equality[c] @ z - qp.equality_value[c]
        w.normal[:] = (-1.0 if value > 0.0 else 1.0) * qp.equality[c]
        outcome, size, exchanges = _bring_in(w, c, size, n_eq, -abs(value), exchanges, z)
        if outcome == CONTRADICTORY and abs(value) <= _noise(w.normal, qp.equality_value[c], z):
            continue  # redundant
        if outcome != FOUND:
            return outcome, exchanges
    while exchanges < w.limit:
        r, side = _most_violated(qp, w, z)
        if side == 0:
            return FOUND, exchanges
        w.normal[:] = -side * qp.inequality[r]
        slack = row_value(qp, r, z) - qp.lower[r] if side < 0 else qp.upper[r] - row_value(qp, r, z)
        w.active[r] = side
        outcome, size, exchanges = _bring_in(w, n_eq + r, size, n_eq, slack, exchanges, z)
        if outcome != FOUND:
            return outcome, exchanges
    return EXHAUSTED, exchanges


@kernel
def _start(qp: ProgramRecord, w: DualRecord, z: Vector) -> None:
    """No constraint active, z = −H⁻¹ g."""
    n = z.shape[0]
    factorise(qp.hessian, w.factor)
    w.basis[:] = np.eye(n)
    z[:] = -qp.gradient
    solve_transposed(w.factor, w.basis, n)
    solve_vector(w.factor, z)
    w.active[:] = 0
    for r in range(w.active.shape[0]):
        begin, end = 0, n
        while begin < end and qp.inequality[r, begin] == 0.0:
            begin += 1
        while begin < end and qp.inequality[r, end - 1] == 0.0:
            end -= 1
        w.span[r, 0], w.span[r, 1] = begin, end
        square = np.sum(qp.inequality[r, begin:end] ** 2)
        w.scale[r] = 1.0 / np.sqrt(square) if square > 0.0 else 1.0


@kernel
def _noise(normal: Vector, value: float, z: Vector) -> float:
    """Violation of normal · z = value that may be rounding."""
    return VIOLATION + ROUNDING * (abs(value) + np.sum(abs(normal * z)))


@kernel
def _most_violated(qp: ProgramRecord, w: DualRecord, z: Vector) -> tuple[int, int]:
    """Row that is violated by the largest distance, and its side; side 0 where none is."""
    worst, row, side = 0.0, 0, 0
    for r in range(w.active.shape[0]):
        if w.active[r] != 0:
            continue
        begin, end = w.span[r, 0], w.span[r, 1]
        s = qp.inequality[r, begin:end] @ z[begin:end]
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
    """Make ``w.normal`` · z = value hold, which falls short by −``slack``; drops constraints that
    block it.

    Returns:
        The outcome, the number of active constraints, and the exchanges so far.
    """
    n = z.shape[0]
    basis, triangle, turned, pull, multiplier = w.basis, w.triangle, w.turned, w.pull, w.multiplier
    gained, first = (
        0.0,
        size,
    )  # multiplier of the constraint that comes in; where the inequalities begin
    while first > 0 and w.chosen[first - 1] >= n_eq:
        first -= 1
    begin, end = 0, n  # rows of the basis that are new
    while exchanges < w.limit:
        exchanges += 1
        turned[begin:end] = 0.0
        for i in range(n):
            if w.normal[i] != 0.0:
                turned[begin:end] += basis[begin:end, i] * w.normal[i]
        free = np.sum(turned[size:] ** 2)
        whole = np.sum(turned[:size] ** 2) + free
        for a in range(size - 1, first - 1, -1):
            pull[a] = (turned[a] - triangle[a, a + 1 : size] @ pull[a + 1 : size]) / triangle[a, a]
        leaves, partial = -1, np.inf
        for a in range(first, size):
            if pull[a] > 0.0 and multiplier[a] < partial * pull[a]:
                leaves, partial = a, max(multiplier[a] / pull[a], 0.0)
        full = -slack / free if free > DEPENDENT**2 * whole else np.inf
        length = min(partial, full)
        if not length < np.inf:
            return CONTRADICTORY, size, exchanges
        multiplier[first:size] -= length * pull[first:size]
        gained += length
        if full < np.inf:
            for k in range(size, n):
                z += length * turned[k] * basis[k]
            slack += length * free
        if full <= partial:
            _add(w, size)
            w.chosen[size], multiplier[size] = constraint, gained
            return FOUND, size + 1, exchanges
        w.active[w.chosen[leaves] - n_eq] = 0
        size -= 1
        _drop(w, leaves, size)
        begin, end = leaves, size + 1
    return EXHAUSTED, size, exchanges


@kernel
def _turn(a: float, b: float) -> tuple[float, float, float]:
    """Cosine and sine of the rotation that takes (a, b) to (length, 0), and the length."""
    length = np.hypot(a, b)
    return (a / length, b / length, length) if length > 0.0 else (1.0, 0.0, 0.0)


@kernel
def _rotate(matrix: Vector, k: int, first: int, c: float, s: float) -> None:
    """Rotate rows k and k + 1 from column ``first`` on."""
    x, y = matrix[k] + 0.0, matrix[k + 1] + 0.0
    matrix[k, first:] = c * x[first:] + s * y[first:]
    matrix[k + 1, first:] = c * y[first:] - s * x[first:]


@kernel
def _add(w: DualRecord, size: int) -> None:
    """The constraint of ``w.turned`` becomes the last column of R."""
    for k in range(w.turned.shape[0] - 2, size - 1, -1):
        c, s, length = _turn(w.turned[k], w.turned[k + 1])
        w.turned[k] = length
        _rotate(w.basis, k, 0, c, s)
    w.triangle[: size + 1, size] = w.turned[: size + 1]


@kernel
def _drop(w: DualRecord, out: int, size: int) -> None:
    """Column ``out`` leaves R, which keeps ``size`` columns."""
    for a in range(out, size):
        w.chosen[a], w.multiplier[a] = w.chosen[a + 1], w.multiplier[a + 1]
        w.triangle[: a + 2, a] = w.triangle[: a + 2, a + 1] + 0.0
    for k in range(out, size):
        c, s, length = _turn(w.triangle[k, k], w.triangle[k + 1, k])
        _rotate(w.triangle, k, k + 1, c, s)
        w.triangle[k, k], w.triangle[k + 1, k] = length, 0.0
        _rotate(w.basis, k, 0, c, s)
