"""Clarabel: an interior-point method for sparse conic programs; each solve is cold."""

from __future__ import annotations

from typing import ClassVar

import clarabel
import numpy as np
from scipy.sparse import csc_matrix

from harpy_pin.wbc.program import UNBOUNDED, QuadraticProgram
from harpy_pin.wbc.qp_solver import QPSolver, QPStatus

__all__ = ["ClarabelSolver"]

_STATUS = {
    clarabel.SolverStatus.Solved: QPStatus.SOLVED,
    clarabel.SolverStatus.AlmostSolved: QPStatus.MAX_ITERATIONS,
    clarabel.SolverStatus.MaxIterations: QPStatus.MAX_ITERATIONS,
}


class ClarabelSolver(QPSolver):
    """Infinite bounds are left out, so the pattern changes and a solver is made for each program."""

    name: ClassVar[str] = "clarabel"

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        self._settings = clarabel.DefaultSettings()
        self._settings.verbose = False

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        p = program
        above, below = p.upper < UNBOUNDED, p.lower > -UNBOUNDED
        matrix = np.vstack((p.equality, p.inequality[above], -p.inequality[below]))
        value = np.concatenate((p.equality_value, p.upper[above], -p.lower[below]))
        cones = [clarabel.NonnegativeConeT(len(value) - len(p.equality_value))]
        if len(p.equality_value):
            cones.insert(0, clarabel.ZeroConeT(len(p.equality_value)))
        hessian = csc_matrix(np.triu(p.hessian))
        solver = clarabel.DefaultSolver(hessian, p.gradient, csc_matrix(matrix), value, cones, self._settings)
        result = solver.solve()
        self.solution.z[:] = result.x
        self.solution.iterations = result.iterations
        return _STATUS.get(result.status, QPStatus.INFEASIBLE)
