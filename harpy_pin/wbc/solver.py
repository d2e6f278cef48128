"""ProxQP behind the whole-body problem: one persistent, warm-started solver whose status is always looked at."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import proxsuite

from harpy_pin import checks
from harpy_pin.state import Vector
from harpy_pin.wbc.problem import WholeBodyProblem

__all__ = ["QPSolution", "QPStatus", "WarmProxQP"]

_proxqp = proxsuite.proxqp


class QPStatus(IntEnum):
    """Outcome of a solve."""

    SOLVED = 0
    INACCURATE = 1
    """The iterations ran out, but the constraints hold to the accepted residual."""
    MAX_ITERATIONS = 2
    INFEASIBLE = 3
    """Primal or dual infeasible."""


_STATUS = {
    _proxqp.QPSolverOutput.PROXQP_SOLVED: QPStatus.SOLVED,
    _proxqp.QPSolverOutput.PROXQP_MAX_ITER_REACHED: QPStatus.MAX_ITERATIONS,
}


@dataclass(slots=True)
class QPSolution:
    """Result of a solve; overwritten by the next.

    Attributes:
        z: (n,) primal solution; meaningful if :attr:`usable`.
        status: how it ended.
        iterations: of the solver.
        primal_residual: largest violation of a constraint.
        dual_residual: largest violation of stationarity.
    """

    z: Vector
    status: QPStatus = QPStatus.MAX_ITERATIONS
    iterations: int = 0
    primal_residual: float = np.inf
    dual_residual: float = np.inf

    @property
    def usable(self) -> bool:
        """Whether ``z`` satisfies the constraints."""
        return self.status <= QPStatus.INACCURATE


class WarmProxQP:
    """A dense ProxQP that lives as long as the problem's sizes.

    Args:
        problem: gives the sizes; may be built later.
        tolerance: absolute residual of constraints and stationarity at which a solve ends.
        gap: absolute duality gap at which a solve ends. Without it ProxQP calls points solved whose residuals are
            small but whose multipliers do not match the active constraints.
        accept: primal residual with which an unfinished solve still counts as usable.
        max_iterations: of the outer loop.
    """

    def __init__(
        self,
        problem: WholeBodyProblem,
        *,
        tolerance: float = 1e-6,
        gap: float = 1e-5,
        accept: float = 1e-2,
        max_iterations: int = 200,
    ) -> None:
        n, n_eq, n_in = len(problem.gradient), len(problem.equality_value), len(problem.lower)
        self._qp = _proxqp.dense.QP(n, n_eq, n_in)
        settings = self._qp.settings
        settings.eps_abs = checks.number("tolerance", tolerance, low=0.0, strict=True)
        settings.eps_rel = 0.0
        settings.check_duality_gap = True
        settings.eps_duality_gap_abs = checks.number("gap", gap, low=0.0, strict=True)
        settings.eps_duality_gap_rel = 0.0
        settings.max_iter = max_iterations
        settings.initial_guess = _proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self._accept = checks.number("accept", accept, low=0.0)
        self._started = False
        self.solution = QPSolution(np.zeros(n))

    def reset(self) -> None:
        """Forget the warm start."""
        self._started = False

    def solve(self, problem: WholeBodyProblem) -> QPSolution:
        """Solve the problem as it is built, from the last solution; once more from scratch if that fails.

        Returns:
            The solution, the object :attr:`solution` itself.
        """
        warm = self._started
        self._solve(problem)
        if warm and not self.solution.usable:
            self._solve(problem)
        return self.solution

    def _solve(self, problem: WholeBodyProblem) -> None:
        qp, p, solution = self._qp, problem, self.solution
        arguments = (p.hessian, p.gradient, p.equality, p.equality_value, p.inequality, p.lower, p.upper)
        if self._started:
            qp.update(*arguments)
        else:
            qp.cleanup()
            qp.init(*arguments)
            self._started = True
        qp.solve()
        info = qp.results.info
        solution.status = _STATUS.get(info.status, QPStatus.INFEASIBLE)
        solution.iterations = info.iter
        solution.primal_residual = info.pri_res
        solution.dual_residual = info.dua_res
        solution.z[:] = qp.results.x
        if solution.status is QPStatus.MAX_ITERATIONS and info.pri_res <= self._accept:
            solution.status = QPStatus.INACCURATE
        if not np.isfinite(solution.z).all():
            solution.status = QPStatus.INFEASIBLE
        if not solution.usable:
            self._started = False  # a poor warm start must not outlive its tick
