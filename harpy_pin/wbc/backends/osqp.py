"""OSQP: an operator-splitting method for sparse programs, warm-started; the dense program goes in as it is."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import osqp
from scipy.sparse import csc_matrix

from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.qp_solver import QPSolver, QPStatus

__all__ = ["OSQPSolver"]

_STATUS = {
    osqp.SolverStatus.OSQP_SOLVED: QPStatus.SOLVED,
    osqp.SolverStatus.OSQP_SOLVED_INACCURATE: QPStatus.MAX_ITERATIONS,
    osqp.SolverStatus.OSQP_MAX_ITER_REACHED: QPStatus.MAX_ITERATIONS,
}


class OSQPSolver(QPSolver):
    """Every entry counts as a non-zero: the pattern never changes."""

    name: ClassVar[str] = "osqp"

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self._rows = np.zeros((rows + n_eq, n))
        self._lower, self._upper = np.zeros(rows + n_eq), np.zeros(rows + n_eq)
        self._triangle = np.tril_indices(n)[::-1]  # the upper one, column by column
        self._solver: osqp.OSQP | None = None

    def reset(self) -> None:
        """See :meth:`QPSolver.reset`."""
        super().reset()
        self._solver = None

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        try:
            return self._attempt(program)
        except (osqp.OSQPException, ValueError):  # its factorisation refuses NaN
            self._solver = None
            return QPStatus.INFEASIBLE

    def _attempt(self, program: QuadraticProgram) -> QPStatus:
        p = program
        rows = len(p.lower)
        self._rows[:rows], self._rows[rows:] = p.inequality, p.equality
        self._lower[:rows], self._lower[rows:] = p.lower, p.equality_value
        self._upper[:rows], self._upper[rows:] = p.upper, p.equality_value
        triangle = p.hessian[self._triangle]
        if self._solver is None:
            ones = csc_matrix((np.ones_like(triangle), self._triangle), shape=p.hessian.shape)
            hessian = csc_matrix((triangle, ones.indices, ones.indptr), shape=p.hessian.shape)
            pattern = csc_matrix(np.ones_like(self._rows))
            matrix = csc_matrix((self._rows.T.ravel(), pattern.indices, pattern.indptr), shape=pattern.shape)
            self._solver = osqp.OSQP()
            self._solver.setup(
                hessian,
                p.gradient,
                matrix,
                self._lower,
                self._upper,
                verbose=False,
                eps_abs=1e-6,
                eps_rel=0.0,
                max_iter=20_000,
            )
        else:
            self._solver.update(Px=triangle, Ax=self._rows.T.ravel(), q=p.gradient, l=self._lower, u=self._upper)
        result = self._solver.solve(raise_error=False)
        status = _STATUS.get(result.info.status_val, QPStatus.INFEASIBLE)
        if status is not QPStatus.SOLVED:
            self._solver = None  # a poor warm start must not outlive its tick
        if status is not QPStatus.INFEASIBLE:
            self.solution.z[:] = result.x
        self.solution.iterations = int(result.info.iter)
        return status
