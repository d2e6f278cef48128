"""A dense quadratic program of constant size: ½ zᵀH z + gᵀz, A z = b, l ≤ C z ≤ u."""

from __future__ import annotations

import numpy as np

from harpy_pin import checks
from harpy_pin.compiled import kernel
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.active_set import ProgramRecord, equality_residual, row_value

MAX_SIZE = 10_000
"""Most variables, or rows, of a program."""


@fixed_arrays("equality", "equality_value", "gradient", "hessian", "inequality", "lower", "record", "upper")
class QuadraticProgram(KeepsViews):
    """Arrays of a program, overwritten from tick to tick.

    Args:
        size: number of variables.
        equalities: number of equalities.
        inequalities: number of inequalities that are no bounds.
        bounded: the first so many variables have bounds of their own; they make the first rows of C, the identity.

    Attributes:
        record: all of it, for kernels; the other attributes are views of its fields, see its class.
    """

    _record_: Records[ProgramRecord]
    _hessian_: Vector
    _gradient_: Vector

    def __init__(self, size: int, *, equalities: int, inequalities: int, bounded: int) -> None:
        given = {"size": size, "equalities": equalities, "inequalities": inequalities, "bounded": bounded}
        for name, value in given.items():
            checks.whole(name, value, high=MAX_SIZE)
        rows = bounded + inequalities
        self.bounded = bounded
        constraints = np.eye(rows, size)
        constraints[bounded:] = 0.0
        self.record = make_record(
            ProgramRecord,
            {"size": size, "equalities": equalities, "rows": rows},
            inequality=constraints,
            bounded=np.int64(bounded),
        )
        self.hessian: Vector = field(self.record, "hessian")
        self.gradient: Vector = field(self.record, "gradient")
        self.equality: Vector = field(self.record, "equality")
        self.equality_value: Vector = field(self.record, "equality_value")
        self.inequality: Vector = field(self.record, "inequality")
        self.lower: Vector = field(self.record, "lower")
        self.upper: Vector = field(self.record, "upper")

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
        return float(max(equal.max(initial=0.0), (self.lower - c).max(), (c - self.upper).max(), 0.0))


@kernel
def worst_violation(qp: ProgramRecord, z: Vector) -> float:
    """Largest violation of a constraint by z; inf where something is not a number."""
    for i in range(z.shape[0]):
        if not np.isfinite(z[i]):
            return np.inf
    worst = equality_residual(qp, z)
    for r in range(qp.lower.shape[0]):
        s = row_value(qp, r, z)
        below, above = qp.lower[r] - s, s - qp.upper[r]
        if np.isnan(below) or np.isnan(above):
            return np.inf
        worst = max(worst, below, above)
    return worst
