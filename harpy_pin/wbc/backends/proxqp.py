"""ProxQP, dense: one persistent, warm-started object."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import proxsuite

from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.qp_solver import QPSolver, QPStatus

__all__ = ["ProxQPSolver"]

_proxqp = proxsuite.proxqp
_STATUS = {
    _proxqp.QPSolverOutput.PROXQP_SOLVED: QPStatus.SOLVED,
    _proxqp.QPSolverOutput.PROXQP_MAX_ITER_REACHED: QPStatus.MAX_ITERATIONS,
}


class ProxQPSolver(QPSolver):
    """A failed warm start is tried again cold, and never outlives its tick.

    Args:
        program: gives the sizes.
        tolerance: absolute residual of constraints and stationarity at which a solve ends. The objective is flat in
            some directions: at 1e-6 the torques of some random states are newton metres away from the optimum, at
            1e-8 within 1 mN·m.
        gap: absolute duality gap at which a solve ends; None does not ask for any. Without it ProxQP calls points
            solved whose residuals are small but whose multipliers do not match the active constraints.
        max_iterations: of the outer loop. Feasible programs need less than 50 steps of both loops together; an
            infeasible one may never end by itself.
        inner_iterations: of each inner loop.
    """

    name: ClassVar[str] = "proxqp"

    def __init__(
        self,
        program: QuadraticProgram,
        *,
        tolerance: float = 1e-8,
        gap: float | None = 1e-7,
        max_iterations: int = 50,
        inner_iterations: int = 5,
    ) -> None:
        super().__init__(program)
        self._qp = _proxqp.dense.QP(*program.shape)
        settings = self._qp.settings
        settings.eps_abs = tolerance
        settings.eps_rel = 0.0
        settings.check_duality_gap = gap is not None
        if gap is not None:
            settings.eps_duality_gap_abs = gap
            settings.eps_duality_gap_rel = 0.0
        settings.max_iter, settings.max_iter_in = max_iterations, inner_iterations
        settings.initial_guess = _proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self._started = False

    def reset(self) -> None:
        """See :meth:`QPSolver.reset`."""
        super().reset()
        self._started = False

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        warm = self._started
        status = self._attempt(program)
        if warm and status is not QPStatus.SOLVED:
            status = self._attempt(program)
        return status

    def _attempt(self, program: QuadraticProgram) -> QPStatus:
        qp, p = self._qp, program
        arguments = (p.hessian, p.gradient, p.equality, p.equality_value, p.inequality, p.lower, p.upper)
        if self._started:
            qp.update(*arguments)
        else:
            qp.cleanup()
            qp.init(*arguments)
        qp.solve()
        results = qp.results
        self.solution.z[:] = results.x
        self.solution.iterations = results.info.iter
        status = _STATUS.get(results.info.status, QPStatus.INFEASIBLE)
        if status is QPStatus.SOLVED and not np.isfinite(results.x).all():
            status = QPStatus.INFEASIBLE
        self._started = status is QPStatus.SOLVED
        return status
