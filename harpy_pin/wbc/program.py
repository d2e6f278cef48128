"""A dense quadratic program of constant size, ½ zᵀH z + gᵀz, A z = b, l ≤ C z ≤ u, its solutions
and solvers.

Every solution has a status, which callers have to check.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.kernels import kernel
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set import ProgramRecord, equality_residual, row_value

MAX_SIZE = 10_000
"""Most variables, or rows, of a program."""


@fixed_arrays(
    "equality", "equality_value", "gradient", "hessian", "inequality", "lower", "record", "upper"
)
class QuadraticProgram(KeepsViews):
    """Arrays of a program, overwritten from tick to tick.

    Args:
        size: number of variables.
        equalities: number of equalities.
        inequalities: number of inequalities that are no bounds.
        bounded: the first so many variables have bounds of their own; they make the first rows of
            C, the identity.
        weight_unit: weight that counts as one in the objective; ProxQP scales the objective by it.

    Attributes:
        record: all of it, for kernels; the other attributes are views of its fields, see its class.
    """

    _record_: Records[ProgramRecord]
    _hessian_: Vector
    _gradient_: Vector
    _equality_: Vector
    _equality_value_: Vector

    def __init__(
        self,
        size: int,
        *,
        equalities: int,
        inequalities: int,
        bounded: int,
        weight_unit: float = 1.0,
    ) -> None:
        given = {
            "size": size,
            "equalities": equalities,
            "inequalities": inequalities,
            "bounded": bounded,
        }
        for name, value in given.items():
            checks.whole(name, value, high=MAX_SIZE)
        rows = bounded + inequalities
        self.bounded = bounded
        self.weight_unit = checks.number("weight_unit", weight_unit, low=0.0, strict=True)
        constraints = np.eye(rows, size)
        constraints[bounded:] = 0.0
        self.record = make_record(
            ProgramRecord,
            {"size": size, "equalities": equalities, "rows": rows},
            inequality=constraints,
            bounded=np.int64(bounded),
        )
        self.hessian: Vector = field(self._record_, "hessian")
        self.gradient: Vector = field(self._record_, "gradient")
        self.equality: Vector = field(self._record_, "equality")
        self.equality_value: Vector = field(self._record_, "equality_value")
        self.inequality: Vector = field(self._record_, "inequality")
        self.lower: Vector = field(self._record_, "lower")
        self.upper: Vector = field(self._record_, "upper")

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of variables, equalities and inequalities (bounds included)."""
        return len(self.gradient), len(self.equality_value), len(self.lower)

    def objective(self, z: Vector) -> float:
        """½ zᵀH z + gᵀz.

        Args:
            z: (n,) variables.
        """
        z = checks.array("z", z, len(self.gradient))
        return float(0.5 * z @ self.hessian @ z + self.gradient @ z)

    def violation(self, z: Vector) -> float:
        """Largest violation of a constraint, in the constraint's unit (N, N·m, m/s²).

        Args:
            z: (n,) variables.
        """
        c = self.inequality @ checks.array("z", z, len(self.gradient))
        equal = np.abs(self.equality @ z - self.equality_value)
        return float(
            max(equal.max(initial=0.0), (self.lower - c).max(), (c - self.upper).max(), 0.0)
        )


@kernel
def worst_violation(qp: ProgramRecord, z: Vector) -> float:
    """Largest violation of a constraint by z; inf where something is not a number."""
    if not np.all(np.isfinite(z)):
        return np.inf
    worst = equality_residual(qp, z)
    for r in range(qp.lower.shape[0]):
        s = row_value(qp, r, z)
        below, above = qp.lower[r] - s, s - qp.upper[r]
        if np.isnan(below) or np.isnan(above):
            return np.inf
        worst = max(worst, below, above)
    return worst


ACCEPTED = 1e-2
"""Violation (N, N·m, m/s²) with which an unfinished solve still counts as usable."""


class QPStatus(IntEnum):
    """Outcome of a solve."""

    SOLVED = 0
    INACCURATE = 1
    """The solver did not finish, but the constraints hold to the accepted violation."""
    MAX_ITERATIONS = 2
    INFEASIBLE = 3
    """Primal or dual infeasible, or not finite."""


@fixed_arrays("z")
@dataclass
class QPSolution(KeepsViews):
    """Result of a solve; overwritten by the next.

    Attributes:
        z: (n,) primal solution; meaningful if :attr:`usable`.
        status: how it ended.
        iterations: of the solver, in its own unit.
        violation: largest violation of a constraint by z, in the constraint's unit (N, N·m, m/s²).
    """

    z: Vector
    status: QPStatus = QPStatus.MAX_ITERATIONS
    iterations: int = 0
    violation: float = np.inf
    if TYPE_CHECKING:

        @property
        def _z_(self) -> Vector: ...

    @property
    def usable(self) -> bool:
        """Whether ``z`` satisfies the constraints."""
        return self.status <= QPStatus.INACCURATE


class QPSolver(KeepsViews, ABC):
    """A solver for programs of one size, which keeps its memory and its warm start between solves.

    Args:
        program: gives the sizes; may be filled later.

    Attributes:
        solution: of the last solve.
    """

    name: ClassVar[str]

    def __init__(self, program: QuadraticProgram) -> None:
        self.solution = QPSolution(
            np.zeros(checks.instance("program", program, QuadraticProgram).shape[0])
        )
        self._layout = program._record_.dtype

    def prepare(self, program: QuadraticProgram) -> None:
        """Begin to compile what solving a program of this size needs.

        Args:
            program: an example.

        Raises:
            InputError: it has other sizes.
        """
        self._refuse_other(program)
        worst_violation.prepare(program._record_, self.solution.z)

    def reset(self) -> None:
        """Forget the last solution: the next solve starts cold."""
        self.solution.status = QPStatus.MAX_ITERATIONS

    def solve(self, program: QuadraticProgram) -> QPSolution:
        """Solve a program, from the last solution where the solver can.

        Args:
            program: filled, and of the sizes that the solver was made for.

        Returns:
            The solution, the object :attr:`solution` itself. Its violation is measured here, not
            taken from the solver.

        Raises:
            InputError: the program has other sizes.
        """
        self._refuse_other(program)
        solution = self.solution
        solution.status = self._solve(program)
        solution.violation = violation = worst_violation(program._record_, solution.z)
        if not violation < np.inf:
            solution.status = QPStatus.INFEASIBLE
        elif solution.status is QPStatus.MAX_ITERATIONS and violation <= ACCEPTED:
            solution.status = QPStatus.INACCURATE
        elif solution.status is QPStatus.SOLVED and violation > ACCEPTED:
            solution.status = QPStatus.MAX_ITERATIONS
        return solution

    def _refuse_other(self, program: QuadraticProgram) -> None:
        """Refuse a program of other sizes: kernels would go past their arrays."""
        record = getattr(program, "_record_", None)
        if record is None or record.dtype != self._layout:
            message = (
                f"program must be one of the sizes that the solver was made for, got "
                f"{shown(program)}"
            )
            raise InputError(message, name="program", value=program)

    @abstractmethod
    def _solve(self, program: QuadraticProgram) -> QPStatus:
        """Fill ``z`` and ``iterations`` of the solution."""
