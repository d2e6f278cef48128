"""Every solver by its name behind one small interface."""

from __future__ import annotations

from importlib import import_module
from typing import Any, ClassVar

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, install_line
from harpy_pin.kernels import diagonal, kernel
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import RecordOf, Records, field, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set import UNBOUNDED, ProgramRecord
from harpy_pin.wbc.active_set_warm_start import WarmStartedActiveSet
from harpy_pin.wbc.program import QPSolver, QPStatus, QuadraticProgram

MAX_STEPS = 1_000_000
"""Largest bound on the iterations of a solver."""

LARGEST = 1e8
"""Largest entry on the diagonal of the Hessian that ProxQP gets: beyond it rounding is larger than
the tolerance.
"""


class PackageSolver(QPSolver):
    """A solver of another package; each solve is cold unless its class says otherwise."""

    package: ClassVar[str]  # name of the package
    library: ClassVar[Any]  # the package itself
    _started = False  # whether the next solve begins where the last one ended

    def __init__(self, program: QuadraticProgram) -> None:
        super().__init__(program)
        self._rebuild()

    def _rebuild(self) -> None:
        type(self).library = import_module(self.package)

    def reset(self) -> None:
        """See :meth:`QPSolver.reset`."""
        super().reset()
        self._started = False


class ScaledProgramRecord(RecordOf):
    """A program as ProxQP gets it: a larger objective with the same optimum, and one-sided rows as
    upper bounds.
    """

    hessian: Vector = sized("size", "size")  # H times the scale
    gradient: Vector = sized("size")  # g times the scale
    inequality: Vector = sized("rows", "size")  # C
    lower: Vector = sized("rows")  # l
    upper: Vector = sized("rows")  # u


@kernel
def write_scaled(qp: ProgramRecord, scale: float, w: ScaledProgramRecord) -> None:
    """Fill in a program; rows with a lower bound alone become −C z ≤ −l."""
    largest = np.max(diagonal(qp.hessian))
    if scale * largest > LARGEST:
        scale = LARGEST / largest
    w.gradient[:] = scale * qp.gradient
    w.hessian[:] = scale * qp.hessian
    turn = (qp.upper >= UNBOUNDED) & (qp.lower > -UNBOUNDED)
    w.inequality[:] = np.where(turn, -1.0, 1.0)[:, None] * qp.inequality
    w.lower[:] = np.where(turn, -UNBOUNDED, qp.lower)
    w.upper[:] = np.where(turn, -qp.lower, qp.upper)


@fixed_arrays("record")
class ProxQPSolver(PackageSolver):
    """ProxQP, dense: one object that lasts, warm-started from its last result.

    A warm start that fails is tried again cold, and never outlives its tick.

    What follows was tried with ProxQP 0.8.0 on 18,000 programs of pushed walks of Harpy in each
    formulation, at friction 0.15 to 0.6, on walks with motors at their limits, and on G1, Talos,
    Go2 and Solo12 as they stand and are pushed; against exact active-set methods. Taken is what was
    fastest with torques within 1 mN·m of the optimum.

    - **Scale of the objective.** ProxQP adds its proximal term, ``rho`` = 1e-6, to a Hessian whose
      smallest eigenvalue is 3e-4 for Harpy and 1e-8 for Talos. There it does not end: all of
      Talos's and G1's programs went to the dual method. With a weight of 1,000 on the body none
      did, and Harpy's solves take as long or less. A smaller ``rho`` instead leaves errors of 0.01
      to 0.1 N·m. A common factor on all weights changes nothing.
    - **Rounding.** The gradient of the scaled objective adds up terms of 1e10 where G1 stands on
      stiff legs. Rounding alone is then above the tolerance, and 144 of 150 programs did not end.
      So no entry becomes larger than 1e8. With a relative tolerance of 1e-14 instead they end, too,
      but rare ticks of Solo12 are 0.2 N away from the optimum.
    - **Unit of the weights.** The scale counts from the body's weight. From the largest, 12 for
      Harpy, its solves took 1.1 times as long.
    - **Gap and tolerance.** The objective is flat in some directions: without a gap, or with
      residuals ten times as large, rare ticks are 0.005 to 1 N·m away from the optimum. Without a
      gap ProxQP calls points solved whose multipliers do not belong to the active constraints.
    - **No Ruiz scaling** (``compute_preconditioner``). Without it a solve takes 0.85 of the time
      and ends nearer to the optimum. With it made anew for every program
      (``update_preconditioner``) it takes 3.5 times as long.
    - **Rows as upper bounds.** With lower ones the worst programs take six times as many
      iterations, and ProxQP never sees that they are infeasible.
    - **Backend.** ``PrimalDualLDLT`` is what ``Automatic`` chooses for 12 unknowns and more.
    - **No box interface.** Bounds as rows take 2 µs less than as ``box_constraints``.
    - **Warm start.** With the last penalties a solve takes as long as with the initial ones
      (``COLD_START_WITH_PREVIOUS_RESULT``), in fewer iterations. Without a guess it takes two to
      three times as long.
    - **Left at their defaults:** ``mu_in``, ``mu_eq`` (of a tenth to a thousandth the faster ones
      end newtons away from the optimum), the updates of the penalties, and the merit function
      (``PDAL`` takes 1.1 times as long).
    - **Formulation.** ``input_space`` takes 0.65 of the time of ``full``, which has the same
      optimum.

    ``solve_in_parallel`` and ``solve_no_gil`` serve batches. A tick has one program.

    Args:
        program: gives the sizes.
        scale: weight that counts as one, in the scaled objective, where its Hessian is small
            enough.
        tolerance: absolute residual of the constraints, in their units, and of the stationarity of
            the scaled program, at which a solve ends.
        gap: absolute duality gap of the scaled program at which a solve ends; None does not ask for
            any.
        max_iterations: of the outer loop; an infeasible program may never end by itself.
        inner_iterations: of each inner loop. Feasible programs of walks need less than 100 steps of
            both together.
    """

    _rebuilt = ("_qp",)
    name: ClassVar[str] = "proxqp"
    package: ClassVar[str] = "proxsuite"
    _record_: Records[ScaledProgramRecord]

    def __init__(
        self,
        program: QuadraticProgram,
        *,
        scale: float = 1e3,
        tolerance: float = 1e-8,
        gap: float | None = 1e-6,
        max_iterations: int = 20,
        inner_iterations: int = 20,
    ) -> None:
        self._shape = n, _, rows = checks.instance("program", program, QuadraticProgram).shape
        self._settings = (
            checks.number("tolerance", tolerance, low=0.0, strict=True),
            None if gap is None else checks.number("gap", gap, low=0.0, strict=True),
            checks.whole("max_iterations", max_iterations, low=1, high=MAX_STEPS),
            checks.whole("inner_iterations", inner_iterations, low=1, high=MAX_STEPS),
        )
        super().__init__(program)
        self.scale = checks.number("scale", scale, low=0.0, strict=True)
        self.record = make_record(ScaledProgramRecord, {"size": n, "rows": rows})
        self._objective = tuple(field(self._record_, name) for name in ("hessian", "gradient"))
        self._rows = tuple(field(self._record_, name) for name in ("inequality", "lower", "upper"))

    def _rebuild(self) -> None:
        """A new object, which starts cold: a copy of ProxQP's own lacks its work space, and
        crashes.
        """
        super()._rebuild()
        proxqp, dense = self.library.proxqp, self.library.proxqp.dense
        self._qp = dense.QP(*self._shape, dense_backend=dense.DenseBackend.PrimalDualLDLT)
        settings, (tolerance, gap, *most) = self._qp.settings, self._settings
        settings.eps_abs, settings.eps_rel = tolerance, 0.0
        settings.check_duality_gap = gap is not None
        if gap is not None:
            settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = gap, 0.0
        settings.max_iter, settings.max_iter_in = most
        settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self._started = False

    def prepare(self, program: QuadraticProgram) -> None:
        """See :meth:`QPSolver.prepare`."""
        super().prepare(program)
        write_scaled.prepare(program._record_, self.scale / program.weight_unit, self._record_)

    def _solve(self, program: QuadraticProgram) -> QPStatus:
        write_scaled(program._record_, self.scale / program.weight_unit, self._record_)
        warm = self._started and self.solution.status is QPStatus.SOLVED
        self._started = True
        status = self._attempt(program, warm=warm)
        return (
            self._attempt(program, warm=False) if warm and status is not QPStatus.SOLVED else status
        )

    def _attempt(self, program: QuadraticProgram, *, warm: bool) -> QPStatus:
        qp, proxqp = self._qp, self.library.proxqp
        arguments = (*self._objective, program._equality_, program._equality_value_, *self._rows)
        if warm:
            qp.update(*arguments)
        else:
            qp.cleanup()
            qp.init(*arguments, compute_preconditioner=False)
        qp.solve()
        results, info = qp.results, qp.results.info
        self.solution._z_[:], self.solution.iterations = results.x, info.iter
        if info.status is proxqp.PROXQP_SOLVED:
            return QPStatus.SOLVED
        return (
            QPStatus.MAX_ITERATIONS
            if info.status is proxqp.PROXQP_MAX_ITER_REACHED
            else QPStatus.INFEASIBLE
        )


SOLVERS: dict[str, type[QPSolver] | None] = {
    "proxqp": ProxQPSolver,
    "active_set": WarmStartedActiveSet,
    **dict.fromkeys(("daqp", "piqp", "osqp", "clarabel", "quadprog")),
}
"""Class of each solver; ``active_set`` is this library's own search. None stands for those of
:mod:`harpy_pin.contrib.solvers`, which is imported where one is asked for.
"""


@checked
def make_solver(name: str, program: QuadraticProgram) -> QPSolver:
    """A solver for programs of one size.

    Args:
        name: one of :data:`SOLVERS`.
        program: gives the sizes.

    Raises:
        InputError: unknown name, or a solver that is not installed.
    """
    checks.one_of("solver", name, SOLVERS)
    try:
        kind = SOLVERS[name] or import_module("harpy_pin.contrib.solvers").SOLVERS[name]
        solver: QPSolver = kind(program)
    except ImportError as error:
        raise InputError(
            f"no {name} ({error}): {install_line('compare')}", name="solver", value=name
        ) from error
    return solver
