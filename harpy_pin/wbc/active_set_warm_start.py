"""The solvers of this library: the dual active-set method, and the warm start from the last active
set.

The kernels of both searches are in :mod:`harpy_pin.wbc.active_set`. Where the exchange of
the last active set takes too long, the dual method follows. Both have a bound on their iterations.
Where the dual method fails, too, there is no solution, and a controller holds its last command.

A tick may need up to three solves. For programs of more than some fifty unknowns they share one
bound, ``WORK``.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import kernel
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set import (
    CONTRADICTORY,
    EXCHANGES,
    EXHAUSTED,
    FOUND,
    ActiveSetRecord,
    DualRecord,
    ProgramRecord,
    dual_active_set,
    exchange,
)
from harpy_pin.wbc.program import (
    ACCEPTED,
    QPSolution,
    QPSolver,
    QPStatus,
    QuadraticProgram,
    worst_violation,
)

SOLVED, INACCURATE, MAX_ITERATIONS, INFEASIBLE = (int(status) for status in QPStatus)
WORK = 450 * 59**2
"""Bound of all solves of a tick: exchanges of the dual method times the square of the unknowns. It
is 0.7 ms.
"""
SYSTEM = 4
"""Exchanges of the dual method that count as one system."""
SPARING = 1000
"""Exchanges left to a tick below which it tries the last active set only in its first solve."""
EXCHANGES_PER_ROW = 4
"""Bound on the constraints added and dropped, for each constraint of the program."""
MAX_EXCHANGES = 300
"""Bound for large programs: twice the most that walks of G1 need."""
_STATUS = {
    FOUND: QPStatus.SOLVED,
    EXHAUSTED: QPStatus.MAX_ITERATIONS,
    CONTRADICTORY: QPStatus.INFEASIBLE,
}


@fixed_arrays("active", "record")
class DualActiveSet(QPSolver):
    """Cold at every tick, and needs no package.

    Attributes:
        active: (rows,) of the last solve: −1 for an inequality at its lower bound, 1 at its upper
            bound, else 0.
        limit: exchanges after which a solve gives up.
    """

    name: ClassVar[str] = "dual"
    _record_: Records[DualRecord]

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self.limit = min(EXCHANGES_PER_ROW * (n_eq + rows), MAX_EXCHANGES)
        self.record = make_record(DualRecord, {"n": n, "rows": rows}, limit=np.int64(self.limit))
        self.active: Vector = field(self._record_, "active")

    def prepare(self, program: QuadraticProgram) -> None:
        """See :meth:`QPSolver.prepare`."""
        super().prepare(program)
        dual_active_set.prepare(program._record_, self._record_, self.solution.z)

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        outcome, self.solution.iterations = dual_active_set(
            program._record_, self._record_, self.solution.z
        )
        return _STATUS[outcome]


@fixed_arrays("record")
class WarmStartedActiveSet(QPSolver):
    """Our own search: the last active set and its exchange, then the dual method. It needs no
    package.

    Args:
        program: gives the sizes.

    Attributes:
        dual: the dual method.
    """

    name: ClassVar[str] = "active_set"
    _record_: Records[ActiveSetRecord]

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self.dual = DualActiveSet(program)
        self.record = make_record(
            ActiveSetRecord,
            {"n": n, "n_eq": n_eq, "rows": rows},
            budget=np.int64(WORK // max(n, 1) ** 2),
            most=np.int64(self.dual.limit),
        )
        self._active = field(self._record_, "active")
        self._iterations, self._violation = (
            field(self._record_, "iterations"),
            field(self._record_, "violation"),
        )

    @property
    def searched(self) -> int:
        """How many solves needed the dual method."""
        return int(self._record_["searched"][0])

    def prepare(self, program: QuadraticProgram) -> None:
        """See :meth:`QPSolver.prepare`."""
        self._refuse_other(program)
        start_tick.prepare(self._record_)
        solve_further.prepare(
            program._record_,
            self._record_,
            self.dual._record_,
            self.solution._z_,
            self.dual.solution._z_,
        )

    def reset(self) -> None:
        """See :meth:`QPSolver.reset`."""
        super().reset()
        self._active[:] = 0
        self._record_["searched"] = 0
        self.dual.reset()

    def _swap_active(self, other: NDArray[np.int64]) -> None:
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
        status = solve_further(
            program._record_, record, self.dual._record_, solution._z_, self.dual.solution._z_
        )
        solution.status, solution.iterations = QPStatus(status), int(self._iterations)
        solution.violation = float(self._violation)
        return solution

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        return self.solve(program).status


@kernel
def start_tick(w: ActiveSetRecord) -> None:
    """The solves from here on, up to the next call, share one bound."""
    w.left = w.budget
    w.systems = w.exchanges = 0


@kernel
def solve_further(
    qp: ProgramRecord, w: ActiveSetRecord, dual: DualRecord, z: Vector, found: Vector
) -> int:
    """One more program of a tick, by the last active set and its exchange, then by the dual method.

    ``w`` has the last active set, and bounds and account of the tick; z is the solution, out, and
    ``found`` work space for that of the dual method. Returns a :class:`QPStatus`.
    """
    w.iterations = 0
    if w.left >= min(
        w.budget, SPARING
    ):  # else a search was needed before, so the last active set will not do
        w.iterations, w.violation = exchange(qp, w, z, EXCHANGES)
        w.systems += w.iterations
        if w.iterations <= EXCHANGES:
            return SOLVED
    return _search(qp, w, dual, z, found)


@kernel
def _search(
    qp: ProgramRecord, w: ActiveSetRecord, dual: DualRecord, z: Vector, found: Vector
) -> int:
    """Solve where the last active set and its exchange did not end."""
    sparing, spent = w.left < SPARING, w.iterations
    w.searched += 1
    dual.limit = min(w.most, max(w.left - SYSTEM * spent, 0))
    outcome, exchanges = dual_active_set(qp, dual, found)
    status, violation = _judged(qp, outcome, found)
    w.exchanges += exchanges
    w.left -= SYSTEM * spent + exchanges
    spent += exchanges
    w.active[:] = dual.active
    if status == SOLVED:
        # The system on the active set found is free of the rounding that many small steps gather.
        w.iterations, w.violation = exchange(qp, w, z, 1 if sparing else EXCHANGES)
        w.systems += w.iterations
        w.left -= SYSTEM * w.iterations
        if w.iterations <= EXCHANGES:
            w.iterations += spent
            return SOLVED
    w.iterations, w.violation = spent, violation
    z[:] = found
    if status > INACCURATE:
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
