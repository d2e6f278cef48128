"""Constraint rows h(x, w) ≥ 0 with their Jacobians ∂h/∂w.

Rows are objects of their own: a governor works on any that offer :class:`ConstraintRows`. Those of
the paper are the friction pyramid and the least normal force of the reduced-order model.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Protocol

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.governors.point_mass import Law, PointMassRecord, axial_force, model_record
from harpy_pin.governors.thrust import CentreGains
from harpy_pin.kernels import kernel
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Records, fields, make_record
from harpy_pin.model.state import Vector

EVALUATE_AT = ("measured", "tracked")


class ConstraintRows(Protocol):
    """Rows h(x, w) ≥ 0 that a governor can enforce.

    Attributes:
        names: one name per row.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """One name per row; a plain attribute will do."""
        ...

    def evaluate(self, x: Vector, w: Vector, h: Vector, jacobian: Vector) -> None:
        """Fill in the rows.

        Args:
            x: (9,) measured [c; ċ; u].
            w: (n,) reference.
            h: (rows,) out, the constraints; positive is satisfied.
            jacobian: (rows, n) out, ∂h/∂w.
        """
        ...


class ForceRowsRecord(PointMassRecord):
    """The numbers of :class:`ForceRows`."""

    mu: float  # friction coefficient μ_s
    min_normal_force: float  # u_min, N
    tracked: int  # 1 where h(w, w) is taken, the paper's reading, 0 for h(x, w)


@fixed_arrays("friction", "record")
class ForceRows(KeepsViews):
    """Friction pyramid and least normal force of the reduced-order model's contact force.

    Rows: μ u_gz ∓ u_gx, μ u_gz ∓ u_gy (each |·| split in two), u_gz − u_min. The reference is w =
    [c_w; ċ_w].

    Args:
        mass: m, kg.
        mu: friction coefficient μ_s.
        friction_share: share of μ_s that the rows use; what is left is for errors. The paper uses
            all of it.
        min_normal_force: u_min, N.
        gains: gains of the thruster feedback.
        law: which control law closes the loop (see :class:`harpy_pin.governors.point_mass.Law`).
        evaluate_at: ``measured`` takes h(x, w) at the measured state (R1); ``tracked`` takes h(w,
            w), the paper's assumption of perfect tracking (R2): the force is m g r̂_z along the leg
            that the reference implies.
        g: magnitude of gravity, m/s².

    Attributes:
        record: for kernels, the fields of :func:`~harpy_pin.governors.point_mass.model_record`,
            ``mu``, ``min_normal_force`` (N), and ``tracked`` for that reading.
        friction: (1,) coefficient of the rows, the share of μ_s, to be overwritten between updates
            where more is known.
        friction_share: as given.

    Raises:
        InputError: a number out of its domain, or an unknown reading.
    """

    _record_: Records[Any]

    of_the_paper: ClassVar[bool] = True
    names: tuple[str, ...] = (
        "friction +x",
        "friction -x",
        "friction +y",
        "friction -y",
        "normal force",
    )

    @checked
    def __init__(
        self,
        *,
        mass: float,
        mu: float,
        friction_share: float = 1.0,
        min_normal_force: float = 20.0,
        gains: CentreGains | None = None,
        law: Law = Law.FULL,
        evaluate_at: str = "measured",
        g: float = 9.81,
    ) -> None:
        checks.one_of("evaluate_at", evaluate_at, EVALUATE_AT)
        self.friction_share = checks.number(
            "friction_share", friction_share, low=0.0, high=1.0, strict=True
        )
        self.record = make_record(
            ForceRowsRecord,
            mu=self.friction_share * checks.number("mu", mu, low=0.0),
            min_normal_force=checks.number("min_normal_force", min_normal_force, low=0.0),
            tracked=evaluate_at == "tracked",
            **fields(model_record(mass=mass, g=g, gains=gains, law=Law(law))),
        )
        self.friction: Vector = self._record_["mu"]

    def evaluate(self, x: Vector, w: Vector, h: Vector, jacobian: Vector) -> None:
        """See :class:`ConstraintRows`.

        Raises:
            InputError: an array of another shape.
        """
        _check_rows(_evaluate_force_rows(x, w, self._record_, h, jacobian))


class StackedRows(KeepsViews):
    """Several sets of rows, one below the other.

    Args:
        parts: the sets, all on the same reference.
    """

    @checked
    def __init__(self, parts: Sequence[ConstraintRows]) -> None:
        self.parts = tuple(parts)
        if not all(hasattr(part, "names") and hasattr(part, "evaluate") for part in self.parts):
            raise InputError(
                f"parts must be sets of rows, got {shown(parts)}", name="parts", value=parts
            )
        self.names: tuple[str, ...] = tuple(name for part in self.parts for name in part.names)

    def evaluate(self, x: Vector, w: Vector, h: Vector, jacobian: Vector) -> None:
        """See :class:`ConstraintRows`."""
        check_outputs(len(self.names), x, w, h, jacobian)
        start = 0
        for part in self.parts:
            stop = start + len(part.names)
            part.evaluate(x, w, h[start:stop], jacobian[start:stop])
            start = stop


def own_rows(rows: ConstraintRows) -> list[bool]:
    """For each row, whether it is one of the user's own, none of the paper's."""
    if isinstance(rows, StackedRows):
        return [own for part in rows.parts for own in own_rows(part)]
    inner = getattr(
        rows, "rows", None
    )  # of rows that see those of another through other coordinates
    paper = getattr(rows if inner is None else inner, "of_the_paper", False)
    return [not paper] * len(rows.names)


def check_outputs(rows: int, x: Vector, w: Vector, h: Vector, jacobian: Vector) -> None:
    """Refuse arguments of ``evaluate`` that are other arrays than said in :class:`ConstraintRows`.

    Raises:
        InputError: one that is not of float64, or of another shape.
    """
    given = (x, w, h, jacobian)
    fit = all(isinstance(array, np.ndarray) and array.dtype == np.float64 for array in given)
    _check_rows(fit and w.ndim == 1 and len(w) >= 6 and x.shape == (9,) and h.shape == (rows,))
    _check_rows(jacobian.shape == (rows, len(w)))


def _check_rows(fit: bool) -> None:
    if not fit:
        raise InputError(
            "rows need x (9,), w (n ≥ 6,), h (rows,) and a Jacobian (rows, n), in float64",
            name="rows",
        )


@kernel(x=(9,), w=(6,), h=("n",), jacobian=("n", 6))
def _evaluate_force_rows(
    x: Vector, w: Vector, record: ForceRowsRecord, h: Vector, jacobian: Vector
) -> bool:
    if not (
        x.shape == (9,)
        and w.shape[0] >= 6
        and h.shape == (5,)
        and jacobian.shape == (5, w.shape[0])
    ):
        return False
    force_rows(x, w, record, h, jacobian)
    return True


@kernel
def force_rows(x: Vector, w: Vector, p: ForceRowsRecord, h: Vector, jacobian: Vector) -> None:
    """Force rows as the element ``p`` of :attr:`ForceRows.record` reads them."""
    if p.tracked:
        force_rows_tracked(x, w, p, h, jacobian)
    else:
        force_rows_measured(x, w, p, h, jacobian)


@kernel
def _pyramid(mu: float) -> Vector:
    """The rows as a matrix (5, 3): times a force, what is to be positive, but for u_min."""
    return np.array(
        [[-1.0, 0.0, mu], [1.0, 0.0, mu], [0.0, -1.0, mu], [0.0, 1.0, mu], [0.0, 0.0, 1.0]]
    )


@kernel
def force_rows_measured(
    x: Vector, w: Vector, p: ForceRowsRecord, h: Vector, jacobian: Vector
) -> None:
    """Force rows at the measured state: exactly affine in w, all parallel to ∂N/∂w (equations.md
    R1).
    """
    r, slope = x[:3] - x[6:], np.empty(6)
    offset = axial_force(r, x[:3], x[3:6], p, slope)
    rows = _pyramid(p.mu) @ (
        r / np.maximum(np.sqrt(r @ r), 1e-12)
    )  # a body on the foot has no direction
    h[:] = rows * (slope @ w[:6] + offset)
    h[4] -= p.min_normal_force
    jacobian[:, :6] = np.outer(rows, slope)


@kernel
def force_rows_tracked(
    x: Vector, w: Vector, p: ForceRowsRecord, h: Vector, jacobian: Vector
) -> None:
    """Force rows where the state equals the reference: u_g = m g r̂_z r̂ with r = c_w − u
    (equations.md R2).
    """
    r, upward = w[:3] - x[6:], np.array([0.0, 0.0, 1.0])
    squared = np.maximum(r @ r, 1e-12)  # a reference on the foot has no direction
    scale = p.mass * p.g / squared
    slope = r[2] * np.eye(3) + np.outer(r, upward) - 2.0 * r[2] / squared * np.outer(r, r)
    h[:] = _pyramid(p.mu) @ (scale * r[2] * r)
    h[4] -= p.min_normal_force
    jacobian[:] = 0.0
    jacobian[:, :3] = _pyramid(p.mu) @ (scale * slope)
