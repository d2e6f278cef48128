"""PIQP, dense: a proximal interior-point method; each solve is cold, its memory is kept."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import piqp

from harpy_pin.wbc.program import UNBOUNDED, QuadraticProgram
from harpy_pin.wbc.qp_solver import QPSolver, QPStatus

__all__ = ["PIQPSolver"]

_STATUS = {piqp.PIQP_SOLVED: QPStatus.SOLVED, piqp.PIQP_MAX_ITER_REACHED: QPStatus.MAX_ITERATIONS}
_INFINITE = 1e30


class PIQPSolver(QPSolver):
    """The matrices go in column by column, as PIQP keeps them."""

    name: ClassVar[str] = "piqp"

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self._solver = piqp.DenseSolver()
        self._solver.settings.eps_abs = 1e-7
        self._solver.settings.eps_rel = 0.0
        self._solver.settings.eps_duality_gap_abs = 1e-6
        self._solver.settings.eps_duality_gap_rel = 0.0
        self._rows = np.zeros((rows - program.bounded, n), order="F")
        self._equality = np.zeros((n_eq, n), order="F")
        self._box = np.zeros((2, n))
        self._box[0], self._box[1] = -_INFINITE, _INFINITE
        self._started = False

    def reset(self) -> None:
        """See :meth:`QPSolver.reset`."""
        super().reset()
        self._started = False

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        p, bounded = program, program.bounded
        self._rows[:], self._equality[:] = p.inequality[bounded:], p.equality
        lower = np.where(p.lower <= -UNBOUNDED, -_INFINITE, p.lower)
        upper = np.where(p.upper >= UNBOUNDED, _INFINITE, p.upper)
        self._box[0, :bounded], self._box[1, :bounded] = lower[:bounded], upper[:bounded]
        call = self._solver.update if self._started else self._solver.setup
        equalities = (self._equality, p.equality_value) if len(p.equality_value) else (None, None)
        # H is symmetric: its transpose is the same matrix, stored by columns.
        call(p.hessian.T, p.gradient, *equalities, self._rows, lower[bounded:], upper[bounded:], *self._box)
        self._started = True
        status = self._solver.solve()
        self.solution.z[:] = self._solver.result.x
        self.solution.iterations = self._solver.result.info.iter
        return _STATUS.get(status, QPStatus.INFEASIBLE)
