"""DAQP, PIQP, OSQP, Clarabel and quadprog as solvers of the whole-body QP.

They serve the comparison, which must not slow them down. Through qpsolvers, to the same accuracy on
the same 500 programs, their median solve took longer: PIQP 1.5 to 1.7 times, Clarabel 1.2 to 1.4
times, quadprog 1.6 to 2.2 times, OSQP 2.7 to 8 times (over three formulations). So each has a
class here.
"""

from typing import Any, ClassVar

import numpy as np
from scipy.sparse import csc_matrix

from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set import UNBOUNDED
from harpy_pin.wbc.program import QPStatus, QuadraticProgram
from harpy_pin.wbc.solvers import SOLVERS, PackageSolver

__all__ = ["SOLVERS", "ClarabelSolver", "DAQPSolver", "OSQPSolver", "PIQPSolver", "QuadprogSolver"]

OUTCOMES = {
    **dict.fromkeys(("PIQP_SOLVED", "OSQP_SOLVED", "Solved"), QPStatus.SOLVED),
    **dict.fromkeys(("PIQP_MAX_ITER_REACHED", "OSQP_MAX_ITER_REACHED"), QPStatus.MAX_ITERATIONS),
    **dict.fromkeys(
        ("OSQP_SOLVED_INACCURATE", "MaxIterations", "AlmostSolved"), QPStatus.MAX_ITERATIONS
    ),
}
"""What the packages' outcomes mean, by their names; all others are without a solution."""


class _Solver(PackageSolver):
    """A solver whose outcomes are among :data:`OUTCOMES`."""

    def _finished(self, z: Vector, iterations: int, outcome: object) -> QPStatus:
        """Keep what a solve has found, and say in our words how it ended."""
        self.solution.z[:], self.solution.iterations = z, int(iterations)
        return OUTCOMES.get(str(outcome).rpartition(".")[2], QPStatus.INFEASIBLE)


class DAQPSolver(PackageSolver):
    """DAQP, a dual active-set method: few constraints are active, and finding them is faster than a
    warm start.
    """

    name: ClassVar[str] = "daqp"
    package: ClassVar[str] = "daqp"

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self._sense = np.zeros(rows + n_eq, dtype=np.int32)
        self._sense[rows:] = 5  # equalities
        self._rows = np.zeros((rows - program.bounded + n_eq, n))
        self._lower, self._upper = np.zeros(rows + n_eq), np.zeros(rows + n_eq)

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        p = program
        if len(p.equality_value):
            rows, general = len(p.lower), len(p.lower) - p.bounded
            self._rows[:general], self._rows[general:] = p.inequality[p.bounded :], p.equality
            self._lower[:rows], self._lower[rows:] = p.lower, p.equality_value
            self._upper[:rows], self._upper[rows:] = p.upper, p.equality_value
            problem = (self._rows, self._upper, self._lower)
        else:
            problem = (p.inequality[p.bounded :], p.upper, p.lower)
        # Ticks of walks need tens of iterations.
        z, _, flag, info = self.library.solve(
            p.hessian, p.gradient, *problem, self._sense.copy(), iter_limit=1000
        )
        self.solution.z[:], self.solution.iterations = z, int(info["iterations"])
        return (
            QPStatus.SOLVED
            if flag > 0
            else (QPStatus.MAX_ITERATIONS if flag == -4 else QPStatus.INFEASIBLE)
        )


class PIQPSolver(_Solver):
    """PIQP, dense: a proximal interior-point method, cold, which keeps its memory. Matrices go in
    by columns.
    """

    name: ClassVar[str] = "piqp"
    package: ClassVar[str] = "piqp"

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self._solver = self.library.DenseSolver()
        settings = self._solver.settings
        settings.eps_abs, settings.eps_rel = 1e-7, 0.0
        settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = 1e-6, 0.0
        self._rows = np.zeros((rows - program.bounded, n), order="F")
        self._equality = np.zeros((n_eq, n), order="F")
        self._box = np.full((2, n), 1e30) * np.array([[-1.0], [1.0]])

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        p, bounded = program, program.bounded
        self._rows[:], self._equality[:] = p.inequality[bounded:], p.equality
        lower = np.where(p.lower <= -UNBOUNDED, -1e30, p.lower)
        upper = np.where(p.upper >= UNBOUNDED, 1e30, p.upper)
        self._box[0, :bounded], self._box[1, :bounded] = lower[:bounded], upper[:bounded]
        free = (lower[bounded:] == -1e30) & (
            upper[bounded:] == 1e30
        )  # PIQP would do the same, and print that it does
        self._rows[free], lower[bounded:][free], upper[bounded:][free] = 0.0, -1.0, 1.0
        call = self._solver.update if self._started else self._solver.setup
        equalities = (self._equality, p.equality_value) if len(p.equality_value) else (None, None)
        # H is symmetric: its transpose is the same matrix, stored by columns.
        call(
            p.hessian.T,
            p.gradient,
            *equalities,
            self._rows,
            lower[bounded:],
            upper[bounded:],
            *self._box,
        )
        self._started = True
        outcome = self._solver.solve()
        return self._finished(self._solver.result.x, self._solver.result.info.iter, outcome)


class OSQPSolver(_Solver):
    """OSQP: an operator-splitting method for sparse programs, warm-started; the dense program goes
    in as it is.

    Every entry counts as a non-zero, so that the pattern never changes.
    """

    name: ClassVar[str] = "osqp"
    package: ClassVar[str] = "osqp"

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self._rows = np.zeros((rows + n_eq, n))
        self._lower, self._upper = np.zeros(rows + n_eq), np.zeros(rows + n_eq)
        self._triangle = np.tril_indices(n)[::-1]  # the upper one, column by column
        self._solver: Any = None

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        try:
            warm, status = self._started, self._attempt(program)
            return (
                self._attempt(program) if warm and not self._started else status
            )  # its step size fitted the last one
        except (self.library.OSQPException, ValueError):  # its factorisation refuses NaN
            self._started = False
            return QPStatus.INFEASIBLE

    def _attempt(self, program: QuadraticProgram) -> QPStatus:
        p = program
        rows = len(p.lower)
        self._rows[:rows], self._rows[rows:] = p.inequality, p.equality
        self._lower[:rows], self._lower[rows:] = p.lower, p.equality_value
        self._upper[:rows], self._upper[rows:] = p.upper, p.equality_value
        triangle, bounds = p.hessian[self._triangle], (self._lower, self._upper)
        if self._started:
            self._solver.update(
                Px=triangle, Ax=self._rows.T.ravel(), q=p.gradient, l=self._lower, u=self._upper
            )
        else:
            ones = csc_matrix((np.ones_like(triangle), self._triangle), shape=p.hessian.shape)
            hessian = csc_matrix((triangle, ones.indices, ones.indptr), shape=p.hessian.shape)
            pattern = csc_matrix(np.ones_like(self._rows))
            matrix = csc_matrix(
                (self._rows.T.ravel(), pattern.indices, pattern.indptr), shape=pattern.shape
            )
            self._solver = self.library.OSQP()
            settings = {"verbose": False, "eps_abs": 1e-6, "eps_rel": 0.0, "max_iter": 20_000}
            self._solver.setup(hessian, p.gradient, matrix, *bounds, **settings)
        result = self._solver.solve(raise_error=False)
        outcome = self.library.SolverStatus(result.info.status_val).name
        z = result.x if outcome in OUTCOMES else np.full(p.gradient.shape, np.nan)
        status = self._finished(z, result.info.iter, outcome)
        self._started = status is QPStatus.SOLVED  # a poor warm start must not outlive its tick
        return status


class ClarabelSolver(_Solver):
    """Clarabel: an interior-point method for sparse conic programs.

    Infinite bounds are left out, so that the pattern changes and a solver is made for each program.
    """

    name: ClassVar[str] = "clarabel"
    package: ClassVar[str] = "clarabel"

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        p, clarabel = program, self.library
        above, below = p.upper < UNBOUNDED, p.lower > -UNBOUNDED
        matrix = np.vstack((p.equality, p.inequality[above], -p.inequality[below]))
        value = np.concatenate((p.equality_value, p.upper[above], -p.lower[below]))
        cones = [clarabel.NonnegativeConeT(len(value) - len(p.equality_value))]
        if len(p.equality_value):
            cones.insert(0, clarabel.ZeroConeT(len(p.equality_value)))
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        hessian = csc_matrix(np.triu(p.hessian))
        result = clarabel.DefaultSolver(
            hessian, p.gradient, csc_matrix(matrix), value, cones, settings
        ).solve()
        return self._finished(result.x, result.iterations, result.status)


class QuadprogSolver(_Solver):
    """quadprog: the dual active-set method of Goldfarb and Idnani. Two-sided rows go in twice."""

    name: ClassVar[str] = "quadprog"
    package: ClassVar[str] = "quadprog"

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        n, n_eq, rows = program.shape
        self._columns, self._value = np.zeros((n, n_eq + 2 * rows)), np.zeros(n_eq + 2 * rows)

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        p, columns, value = program, self._columns, self._value
        n_eq, rows = len(p.equality_value), len(p.lower)
        columns[:, :n_eq], columns[:, n_eq : n_eq + rows] = p.equality.T, p.inequality.T
        np.negative(p.inequality.T, out=columns[:, n_eq + rows :])
        value[:n_eq], value[n_eq : n_eq + rows] = p.equality_value, p.lower
        np.negative(p.upper, out=value[n_eq + rows :])
        try:
            z, _, _, iterations, *_ = self.library.solve_qp(
                p.hessian, -p.gradient, columns, value, n_eq
            )
        except ValueError:  # inconsistent constraints, or a Hessian that is not positive definite
            return QPStatus.INFEASIBLE
        return self._finished(z, iterations[0], "Solved")


KINDS = (DAQPSolver, PIQPSolver, OSQPSolver, ClarabelSolver, QuadprogSolver)
SOLVERS |= {kind.name: kind for kind in KINDS}
