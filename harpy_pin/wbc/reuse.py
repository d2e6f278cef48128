"""Reuse of the last active set: from tick to tick it seldom changes, and then one linear system is the whole solve.

With the active constraints guessed, the optimum solves H z + g = Wᵀλ, W z = w. The guess is right if and only if no
other constraint is violated and every multiplier has its sign: then z *is* the optimum of a strictly convex program,
whoever guessed. If not, the wrong constraints are exchanged, a few times all at once and then one by one, the last
first (block principal pivoting; with single exchanges in a fixed order it ends for any strictly convex program whose
active constraints are independent). Exchanges all at once may bring in constraints that depend on each other, as the
faces of one pyramid do: then it starts over with none, one by one. Where that takes too long, another solver is asked.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numba import njit

from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed, solve_vector
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.solver import QPSolution, QPSolver, QPStatus

__all__ = ["ReusedActiveSet"]

BLOCKS = 4
"""Systems after which constraints are exchanged one by one."""
EXCHANGES = 20
"""Systems solved before the other solver is asked."""
TOLERANCE = 1e-7
"""Violation (N, N·m, m/s²) and wrong-signed multiplier with which a guess still counts as right."""


class ReusedActiveSet(QPSolver):
    """Tries the last active set, and falls back on another solver.

    Args:
        program: gives the sizes.
        fallback: solves what the guess does not.

    Attributes:
        asked: how many solves the fallback was asked for.
    """

    name: ClassVar[str] = "reuse"

    def __init__(self, program: QuadraticProgram, fallback: QPSolver) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self.fallback = fallback
        self.asked = 0
        self._active = np.zeros(rows, dtype=np.int8)
        self._factor = np.zeros((n, n))
        self._columns = np.zeros((n, n_eq + rows + 1))
        self._schur = np.zeros((n_eq + rows, n_eq + rows))

    def reset(self) -> None:
        """See :meth:`QPSolver.reset`."""
        super().reset()
        self._active[:] = 0
        self.asked = 0
        self.fallback.reset()

    def solve(self, program: QuadraticProgram) -> QPSolution:
        """See :meth:`QPSolver.solve`."""
        solution = self.solution
        solution.status = self._solve(program)
        if solution.status is QPStatus.SOLVED:
            return solution
        self.asked += 1
        found = self.fallback.solve(program)
        solution.z[:] = found.z
        solution.status, solution.violation = found.status, found.violation
        solution.iterations += found.iterations
        if found.usable:
            _guess(program.inequality, program.lower, program.upper, program.bounded, found.z, self._active)
        else:
            self._active[:] = 0
        return solution

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        p, solution = program, self.solution
        solution.iterations, solution.violation = _exchange(
            p.hessian,
            p.gradient,
            p.equality,
            p.equality_value,
            p.inequality,
            p.lower,
            p.upper,
            p.bounded,
            self._active,
            self._factor,
            self._columns,
            self._schur,
            solution.z,
        )
        return QPStatus.SOLVED if solution.iterations <= EXCHANGES else QPStatus.MAX_ITERATIONS


@njit(cache=True)
def _exchange(  # type: ignore[no-untyped-def]
    hessian,
    gradient,
    equality,
    equality_value,
    inequality,
    lower,
    upper,
    bounded,
    active,
    factor,
    columns,
    schur,
    z,
):
    """Systems solved until the guess was right (one more than allowed if it never was), and the violation of z.

    ``active`` holds −1 for a row at its lower bound, 1 at its upper bound, else 0.
    """
    n, n_eq, rows = gradient.shape[0], equality_value.shape[0], lower.shape[0]
    factorise(hessian, factor)
    value = np.empty(n)
    chosen = np.empty(rows, dtype=np.int64)
    singly = False
    for attempt in range(1, EXCHANGES + 1):
        block = attempt <= BLOCKS and not singly
        # L⁻ᵀ [Aᵀ Wᵀ −g], one column per active constraint.
        count = 0
        for r in range(rows):
            if active[r] != 0:
                chosen[count] = r
                count += 1
        m = n_eq + count
        if m > n:
            active[:] = 0
            if singly:
                return EXCHANGES + 1, np.inf
            singly = True
            continue
        for i in range(n):
            for c in range(n_eq):
                columns[i, c] = equality[c, i]
            for c in range(count):
                columns[i, n_eq + c] = inequality[chosen[c], i]
            columns[i, m] = -gradient[i]
        solve_transposed(factor, columns, m + 1)
        # Multipliers: (W H⁻¹ Wᵀ) λ = w + W H⁻¹ g.
        system = schur[:m, :m]
        system[:] = 0.0
        multiplier = value[:m]
        for c in range(n_eq):
            multiplier[c] = equality_value[c]
        for c in range(count):
            r = chosen[c]
            multiplier[n_eq + c] = lower[r] if active[r] < 0 else upper[r]
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
        solve_factor(factor, z.reshape((n, 1)), 1)
        regular = True
        for i in range(n):
            regular = regular and np.isfinite(z[i])
        if not regular:
            active[:] = 0
            if singly:
                return EXCHANGES + 1, np.inf
            singly = True
            continue
        # Drop what pulls the wrong way, add what is violated.
        wrong, worst = 0, 0.0
        last, change = 0, 0
        for c in range(count):
            r = chosen[c]
            if active[r] * multiplier[n_eq + c] > TOLERANCE:
                wrong += 1
                last, change = r, -active[r]
                if block:
                    active[r] = 0
        for r in range(rows):
            s = 0.0
            if r < bounded:
                s = z[r]
            else:
                for i in range(n):
                    s += inequality[r, i] * z[i]
            below, above = lower[r] - s, s - upper[r]
            if np.isnan(below) or np.isnan(above):
                active[:] = 0
                return EXCHANGES + 1, np.inf
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
        for c in range(n_eq):
            s = -equality_value[c]
            for i in range(n):
                s += equality[c, i] * z[i]
            if np.isnan(s):
                active[:] = 0
                return EXCHANGES + 1, np.inf
            worst = max(worst, abs(s))
        if wrong == 0:
            # A nearly singular system may have left the active constraints themselves.
            return (attempt if worst <= 10.0 * TOLERANCE else EXCHANGES + 1), worst
    return EXCHANGES + 1, np.inf


@njit(cache=True)
def _guess(inequality, lower, upper, bounded, z, active):  # type: ignore[no-untyped-def]
    """Rows that a solution touches."""
    for r in range(lower.shape[0]):
        s = 0.0
        if r < bounded:
            s = z[r]
        else:
            for i in range(z.shape[0]):
                s += inequality[r, i] * z[i]
        near = 1e-5 * max(1.0, abs(s))
        active[r] = -1 if s - lower[r] < near else (1 if upper[r] - s < near else 0)
