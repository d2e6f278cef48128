"""quadprog: the dual active-set method of Goldfarb and Idnani, cold at every tick."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import quadprog

from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.qp_solver import QPSolver, QPStatus

__all__ = ["QuadprogSolver"]


class QuadprogSolver(QPSolver):
    """Two-sided rows go in twice."""

    name: ClassVar[str] = "quadprog"

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self._columns = np.zeros((n, n_eq + 2 * rows))
        self._value = np.zeros(n_eq + 2 * rows)

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        p, columns, value = program, self._columns, self._value
        n_eq, rows = len(p.equality_value), len(p.lower)
        columns[:, :n_eq] = p.equality.T
        columns[:, n_eq : n_eq + rows] = p.inequality.T
        np.negative(p.inequality.T, out=columns[:, n_eq + rows :])
        value[:n_eq] = p.equality_value
        value[n_eq : n_eq + rows] = p.lower
        np.negative(p.upper, out=value[n_eq + rows :])
        try:
            z, _, _, iterations, *_ = quadprog.solve_qp(p.hessian, -p.gradient, columns, value, n_eq)
        except ValueError:  # inconsistent constraints, or a Hessian that is not positive definite
            return QPStatus.INFEASIBLE
        self.solution.z[:] = z
        self.solution.iterations = int(iterations[0])
        return QPStatus.SOLVED
