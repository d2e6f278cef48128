"""Warm start from the last active set: it seldom changes from tick to tick, and then a solve is one linear system.

With the active constraints guessed, the optimum solves H z + g = Wᵀλ, W z = w. The guess is right if and only if no
other constraint is violated and every multiplier has its sign; z is then the optimum of the strictly convex program. If
not, the wrong constraints are exchanged, a few times all at once and then one by one, the last first (block principal
pivoting; with single exchanges in a fixed order it ends for any strictly convex program whose active constraints are
independent). Exchanges all at once may add constraints that depend on each other, as the faces of one pyramid do: then
it starts over without any, one by one. Where that takes too long, the dual active-set method follows
(:mod:`harpy_pin.wbc.dual`), and where rounding makes that fail, a further solver. Each has a bound on its iterations.
No further solver is asked where the dual method used up its exchanges, or where the numbers are those of no robot: then
there is no solution, and a controller holds its last command.

A tick may need up to three solves. For programs of more than some fifty unknowns they share one bound, ``WORK``.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed, solve_vector
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import ZERO, RecordOf, Records, field, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.dual import DualActiveSet, DualRecord, dual_active_set
from harpy_pin.wbc.program import ProgramRecord, QuadraticProgram, equality_residual, row_value, worst_violation
from harpy_pin.wbc.qp_solver import ACCEPTED, QPSolution, QPSolver, QPStatus

__all__ = ["WarmStartedActiveSet"]

BLOCKS = 4
"""Systems after which constraints are exchanged one by one."""
SOLVED, INACCURATE, MAX_ITERATIONS, INFEASIBLE = (int(status) for status in QPStatus)
ASK = 4
"""What :func:`solve_further` says where another solver may help."""
EXCHANGES = 20
"""Systems solved before the dual method is called."""
WORK = 450 * 59**2
"""Bound of all solves of a tick: exchanges of the dual method times the square of the unknowns. It is 1.4 ms."""
SYSTEM = 4
"""Exchanges of the dual method that take as long as one system."""
FALLBACK = 2
"""Exchanges of the dual method that take as long as one iteration of the further solver."""
SPARING = 1000
"""Exchanges left to a tick below which it tries the last active set only in its first solve."""
LARGEST_GRADIENT = 1e9
"""Entry of a gradient beyond which no robot is meant, and no other solver is asked. That of a walk is below 1e5."""
TOLERANCE = 1e-7
"""Violation (N, N·m, m/s²) with which a guess still counts as right."""
PULL = 1e-9
"""Multiplier of the wrong sign with which a guess still counts as right. Forces of heavy robots weigh some 1e-8."""
SINGLE = {"TOLERANCE": 1e-4, "PULL": 1e-7}
"""In single precision: forces of hundreds of newtons are known to some 1e-5 N."""


class ActiveSetRecord(RecordOf):
    """Work space of :class:`WarmStartedActiveSet`."""

    # −1 for a row at its lower bound, 1 at its upper bound, else 0
    active: NDArray[np.int64] = sized("rows", whole=True)
    chosen: NDArray[np.int64] = sized("rows", whole=True)  # the active rows, packed to the front
    multiplier: Vector = sized("n_eq + rows")  # of the equalities and the active rows
    factor: Vector = sized("n", "n")  # L of H = Lᵀ L
    columns: Vector = sized("n", "n_eq + rows + 1")  # L⁻ᵀ [Aᵀ Wᵀ −g], one column per active constraint
    schur: Vector = sized("n_eq + rows", "n_eq + rows")  # factor of W H⁻¹ Wᵀ
    budget: int  # exchanges of the dual method that all solves of a tick may take; a system counts as ``SYSTEM``
    most: int  # that it may take in one solve
    left: int = ZERO  # of the budget, in this tick
    systems: int = ZERO  # solved in this tick
    exchanges: int = ZERO  # of the dual method in this tick
    searched: int = ZERO  # how many solves needed that method
    iterations: int = ZERO  # of the last solve
    violation: float = 0.0  # of the last solution


@fixed_arrays("record")
class WarmStartedActiveSet(QPSolver):
    """Tries the last active set, then the dual method, then another solver.

    Args:
        program: gives the sizes.
        fallback: is called where both end without a solution.

    Attributes:
        dual: the dual method.
        fallback_solves: how many solves needed the fallback.
    """

    name: ClassVar[str] = "reuse"
    _record_: Records[ActiveSetRecord]

    def __init__(self, program: QuadraticProgram, fallback: QPSolver) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self.fallback = fallback
        self.dual = DualActiveSet(program)
        self.fallback_solves = 0
        self.record = make_record(
            ActiveSetRecord,
            {"n": n, "n_eq": n_eq, "rows": rows},
            budget=np.int64(WORK // max(n, 1) ** 2),
            most=np.int64(self.dual.limit),
        )
        self._active = field(self.record, "active")
        self._iterations, self._violation = field(self.record, "iterations"), field(self.record, "violation")

    @property
    def searched(self) -> int:
        """How many solves needed the dual method."""
        return int(self.record["searched"][0])

    def prepare(self, program: QuadraticProgram) -> None:
        """See :meth:`QPSolver.prepare`."""
        self._refuse_other(program)
        start_tick.prepare(self.record)
        solve_further.prepare(program.record, self.record, self.dual.record, self.solution.z, self.dual.solution.z)
        self.fallback.prepare(program)
        _guess.prepare(program.record, self.record, self.solution.z)

    def reset(self) -> None:
        """See :meth:`QPSolver.reset`."""
        super().reset()
        self._active[:] = 0
        self.record["searched"] = self.fallback_solves = 0
        self.dual.reset()
        self.fallback.reset()

    def swap_active(self, other: NDArray[np.int64]) -> None:
        """Take up another program of this size: exchange the active rows with ``other`` (rows,)."""
        self._active[:], other[:] = other.copy(), self._active.copy()

    def solve(self, program: QuadraticProgram) -> QPSolution:
        """See :meth:`QPSolver.solve`."""
        start_tick(self._record_)
        return self.solve_further(program)

    def solve_further(self, program: QuadraticProgram) -> QPSolution:
        """Solve one more program of the same tick: both share one bound."""
        self._refuse_other(program)
        solution, record = self.solution, self._record_
        status = solve_further(program._record_, record, self.dual._record_, solution.z, self.dual.solution.z)
        solution.iterations, solution.violation = int(self._iterations), float(self._violation)
        if status != ASK:
            solution.status = QPStatus(status)
            return solution
        self.fallback_solves += 1
        self.fallback.reset()  # what it remembers is many ticks old
        found = self.fallback.solve(program)
        record["left"] -= FALLBACK * found.iterations
        if found.usable:
            _guess(program.record, self.record, found.z)
        else:
            self._active[:] = 0
        solution.z[:] = found.z
        solution.status, solution.violation = found.status, found.violation
        solution.iterations += found.iterations
        return solution

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        return self.solve(program).status


@kernel
def start_tick(w: ActiveSetRecord) -> None:
    """The solves from here on, up to the next call, share one bound."""
    w.left = w.budget
    w.systems = w.exchanges = 0


@kernel
def solve_further(qp: ProgramRecord, w: ActiveSetRecord, dual: DualRecord, z: Vector, found: Vector) -> int:
    """One more program of a tick, by the last active set and its exchange, then by the dual method.

    XX
            w: the last active set; bounds and account of the tick.
            dual: work space of the dual method.
            z: solution, out.
            found: work space for that of the dual method.

        Returns:
            A :class:`QPStatus`; ``ASK`` where none was found and another solver may help.
    """
    w.iterations = 0
    if w.left >= min(w.budget, SPARING):  # else a search was needed before, so the last active set will not do
        w.iterations, w.violation = exchange(qp, w, z, EXCHANGES)
        w.systems += w.iterations
        if w.iterations <= EXCHANGES:
            return SOLVED
    return _search(qp, w, dual, z, found)


@kernel
def _search(qp: ProgramRecord, w: ActiveSetRecord, dual: DualRecord, z: Vector, found: Vector) -> int:
    """Solve where the last active set and its exchange did not end."""
    sparing, spent = w.left < SPARING, w.iterations
    w.searched += 1
    dual.limit = min(w.most, max(w.left - SYSTEM * spent, 0))
    outcome, exchanges = dual_active_set(qp, dual, found)
    status, violation = _judged(qp, outcome, found)
    w.exchanges += exchanges
    w.left -= SYSTEM * spent + exchanges
    spent += exchanges
    for c in range(w.active.shape[0]):
        w.active[c] = dual.active[c]
    if status == SOLVED:
        # The system on the active set found is free of the rounding that many small steps gather.
        w.iterations, w.violation = exchange(qp, w, z, 1 if sparing else EXCHANGES)
        w.systems += w.iterations
        w.left -= SYSTEM * w.iterations
        if w.iterations <= EXCHANGES:
            w.iterations += spent
            return SOLVED
    w.iterations, w.violation = spent, violation
    for c in range(z.shape[0]):
        z[c] = found[c]
    if status > INACCURATE:
        if (status != INFEASIBLE or violation == np.inf) and exchanges < dual.limit and _is_of_a_robot(qp):
            return ASK
        w.active[:] = 0
    return status


@kernel
def _judged(qp: ProgramRecord, outcome: int, z: Vector) -> tuple[int, float]:
    """Status and violation of what the dual method found, as :meth:`QPSolver.solve` has them."""
    violation = worst_violation(qp, z)
    status = INFEASIBLE
    if violation < np.inf and outcome < 2:
        if outcome == 0:
            status = SOLVED if violation <= ACCEPTED else MAX_ITERATIONS
        else:
            status = INACCURATE if violation <= ACCEPTED else MAX_ITERATIONS
    return status, violation


@kernel
def _is_of_a_robot(qp: ProgramRecord) -> bool:
    """Whether the gradient is one that a robot may have."""
    fits = True
    for c in range(qp.gradient.shape[0]):
        fits = fits and abs(qp.gradient[c]) < LARGEST_GRADIENT
    return fits


@kernel
def exchange(qp: ProgramRecord, w: ActiveSetRecord, z: Vector, most: int) -> tuple[int, float]:
    """Systems solved until the guess was right, at most ``most``, and the violation of z.

    The number is ``EXCHANGES`` + 1 where the guess never was right.
    """
    n, n_eq = qp.gradient.shape[0], qp.equality_value.shape[0]
    factorise(qp.hessian, w.factor)
    singly = False
    for attempt in range(1, most + 1):
        count = _choose(w)
        # Too many constraints, or ones that depend on each other: start over with none, one by one.
        if n_eq + count > n or not _solve_active(qp, w, count, z):
            w.active[:] = 0
            if singly:
                break
            singly = True
            continue
        wrong, worst = _correct(qp, w, count, z, attempt <= BLOCKS and not singly)
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
    m = n_eq + count
    columns = w.columns
    for i in range(n):
        for c in range(n_eq):
            columns[i, c] = qp.equality[c, i]
        for c in range(count):
            columns[i, n_eq + c] = qp.inequality[w.chosen[c], i]
        columns[i, m] = -qp.gradient[i]
    solve_transposed(w.factor, columns, m + 1)
    # Multipliers: (W H⁻¹ Wᵀ) λ = w + W H⁻¹ g.
    system, multiplier = w.schur[:m, :m], w.multiplier[:m]
    system[:] = 0.0
    for c in range(n_eq):
        multiplier[c] = qp.equality_value[c]
    for c in range(count):
        r = w.chosen[c]
        multiplier[n_eq + c] = qp.lower[r] if w.active[r] < 0 else qp.upper[r]
    for i in range(n):
        for a in range(m):
            x = columns[i, a]
            if x != 0.0:
                multiplier[a] -= x * columns[i, m]
                for b in range(a + 1):
                    system[a, b] += x * columns[i, b]
    factorise(system, system)
    solve_vector(system, multiplier)
    for i in range(n):
        s = columns[i, m]
        for a in range(m):
            s += columns[i, a] * multiplier[a]
        z[i] = s
    solve_factor(w.factor, z.reshape((n, 1)), 1)
    regular = True
    for i in range(n):
        regular = regular and np.isfinite(z[i])
    return regular


@kernel
def _correct(qp: ProgramRecord, w: ActiveSetRecord, count: int, z: Vector, block: bool) -> tuple[int, float]:
    """Drop rows with multipliers of the wrong sign, add violated ones: all of them (``block``) or the last.

    Returns:
        How many rows were wrong, and the largest violation; inf where a bound or row is NaN.
    """
    n_eq, active = qp.equality_value.shape[0], w.active
    wrong, worst = 0, 0.0
    last, change = 0, 0
    for c in range(count):
        r = w.chosen[c]
        if active[r] * w.multiplier[n_eq + c] > PULL:
            wrong += 1
            last, change = r, -active[r]
            if block:
                active[r] = 0
    for r in range(active.shape[0]):
        s = row_value(qp, r, z)
        below, above = qp.lower[r] - s, s - qp.upper[r]
        if np.isnan(below) or np.isnan(above):
            return 1, np.inf
        worst = max(worst, below, above)
        if active[r] == 0 and (below > TOLERANCE or above > TOLERANCE):
            wrong += 1
            side = -1 if below > above else 1
            if r >= last:
                last, change = r, side
            if block:
                active[r] = side
    if wrong > 0 and not block:
        active[last] += change
    return wrong, worst


@kernel
def _guess(qp: ProgramRecord, w: ActiveSetRecord, z: Vector) -> None:
    """Rows that a solution touches."""
    for r in range(qp.lower.shape[0]):
        s = row_value(qp, r, z)
        near = 1e-5 * max(1.0, abs(s))
        w.active[r] = -1 if s - qp.lower[r] < near else (1 if qp.upper[r] - s < near else 0)
