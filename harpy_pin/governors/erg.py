"""The paper's explicit reference governor, Algorithm 1, faithful to the print.

Its known weaknesses (equations.md §2, W1–W9) are part of it: it chatters by construction, cannot
move when x_w = x_r, and ignores how fast the constraints drift. It is here to be measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.governors.governor import GovernorStatus, StatusRecord, check_update
from harpy_pin.governors.rows import (
    ConstraintRows,
    ForceRows,
    ForceRowsRecord,
    force_rows,
    own_rows,
)
from harpy_pin.kernels import ByPrecision, kernel
from harpy_pin.model.entry import all_possible
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import field, make_record, sized
from harpy_pin.model.state import Vector

FEASIBLE, INFEASIBLE, STUCK, BAD, MISFIT = 0, 1, 2, 3, 4
"""Outcome of an update; the last two for arguments that are not finite, or do not fit."""
STUCK_AFTER = 0.1
"""Time of repair without a break after which the governor counts as stuck, s."""
NO_WAY = 1e-6
"""Change of the worst row on the way to the target, relative to its violation, that counts as no
direction.
"""
FARTHEST = 0.5
"""Change of the reference (m, m/s) beyond which a user's row is not repaired."""
INSIDE = 1e-4
"""How far within such a row its repair ends (m, m/s)."""
MAX_SIZE = 1000
"""Most entries of a reference."""
INDEPENDENT = ByPrecision(1e-9, single=1e-5)
"""Share of a row outside the span of others with which it counts as independent of them."""


@fixed_arrays("applied")
class ExplicitReferenceGovernor(KeepsViews):
    """Explicit reference governor of the paper (Algorithm 1; equations.md E8).

    While both references violate a row, only the repair of the worst row moves x_w, and the target
    moves away; after 0.1 s of it ``status.stuck`` is set. Where the repair has no direction,
    because both references agree in the row (W2), v_t moves x_w instead: it follows the target and
    leaves the violated rows as they are.

    This is Algorithm 1 as printed, for the paper's own rows. A user's row never stops x_w: while it
    is the worst, x_w takes the shortest change that satisfies it, at the rate α_n, and v_t follows
    the target in all other directions. A row that no change of up to 0.5 (m, m/s) satisfies is not
    repaired: x_w follows the target as without the row, and ``status.infeasible`` and
    ``status.stuck`` are set.

    Args:
        rows: the constraints.
        alpha_r: rate towards the target where it is allowed, 1/s (3D run: 10).
        alpha_t: rate along the null space of the violated rows, 1/s (3D run: 15).
        alpha_n: rate of the repair along the worst row, 1/s (3D run: 20).
        size: length of the reference w.
        conditions: ``algorithm`` follows Algorithm 1; ``equation`` the equations, which differ from
            it: v_t also acts where x_w alone violates, and v_n compares the worst rows of both and
            is not normalised.

    Raises:
        InputError: a rate is negative or not finite, or ``conditions`` is unknown.
    """

    _applied_: Vector

    @checked
    def __init__(
        self,
        rows: ConstraintRows,
        *,
        alpha_r: float = 10.0,
        alpha_t: float = 15.0,
        alpha_n: float = 20.0,
        size: int = 6,
        conditions: str = "algorithm",
    ) -> None:
        checks.one_of("conditions", conditions, CONDITIONS)
        self.rows = rows
        self.conditions = conditions
        self._record = make_record(
            ErgRecord,
            {"rows": len(rows.names), "size": checks.whole("size", size, low=1, high=MAX_SIZE)},
            alpha_r=checks.number("alpha_r", alpha_r, low=0.0),
            alpha_t=checks.number("alpha_t", alpha_t, low=0.0),
            alpha_n=checks.number("alpha_n", alpha_n, low=0.0),
            literal=conditions == "equation",
            own=np.array(own_rows(rows), dtype=bool),
        )
        self.applied: Vector = field(self._record, "applied")
        h_r, h_w, rate = (field(self._record, name) for name in ("h_r", "h_w", "rate"))
        self.status = GovernorStatus(rows.names, h_r, h_w, rate, self._record)
        self._at_target = self.status.h_r, field(self._record, "jacobian_r")
        self._at_applied = self.status.h_w, field(self._record, "jacobian_w")
        x, x_r = np.zeros(9), np.zeros(size)
        if isinstance(rows, ForceRows):
            governed_update.prepare(x, x_r, 0.0, self._record, rows._record_)
        else:
            _argument_verdict.prepare(x, x_r, 0.0, self._record)
            _first_broken.prepare(*self._at_target)
            _explicit_update.prepare(x_r, 0.0, self._record)

    def reset(self, x_r: Vector) -> None:
        """Start over with x_w = x_r.

        Args:
            x_r: (6,) target reference [c_t; ċ_t], m and m/s.
        """
        self.applied[:] = checks.vector("x_r", x_r, len(self.applied))
        self._record["repairing"] = self.status.bad_samples = 0

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """Advance x_w by one tick; see :class:`harpy_pin.governors.governor.Governor`.

        Raises:
            InputError: also where a row of one's own is no number.
        """
        rows = self.rows
        try:
            if isinstance(rows, ForceRows):
                # The whole update in one call into compiled code.
                verdict = governed_update(x, x_r, dt, self._record, rows._record_)
            else:
                verdict = _argument_verdict(x, x_r, dt, self._record)
                if verdict == FEASIBLE:
                    self._evaluate(x, x_r)
                    _explicit_update(x_r, dt, self._record)
        except Exception:
            check_update(x, x_r, len(self.applied), dt)
            raise
        if verdict == MISFIT:
            check_update(x, x_r, len(self.applied), dt)
        return self._applied_

    def _evaluate(self, x: Vector, x_r: Vector) -> None:
        """Rows and Jacobians at both references; refuses those that are not finite."""
        for w, h, jacobian in (x_r, *self._at_target), (self.applied, *self._at_applied):
            self.rows.evaluate(x, w, h, jacobian)
            broken = _first_broken(h, jacobian)
            if broken >= 0:
                row = self.rows.names[broken]
                raise InputError(
                    f"row '{row}' of the governor is no number at {w.tolist()}",
                    name=row,
                    value=h.copy(),
                )


class ErgRecord(StatusRecord):
    """What :func:`explicit_update` knows, is given and works in."""

    alpha_r: float  # 1/s
    alpha_t: float  # 1/s
    alpha_n: float  # 1/s
    literal: int  # use the conditions of the equations instead of those of the algorithm
    own: NDArray[np.int64]  # (rows,) 1 for a user's row, 0 for one of the paper's; all 0 by default
    h_r: Vector = sized("rows")  # (rows,) constraints at x_r
    h_w: Vector = sized("rows")  # (rows,) constraints at x_w
    jacobian_r: Vector = sized("rows", "size")  # (rows, size) ∂h/∂w at x_r
    jacobian_w: Vector = sized("rows", "size")  # (rows, size) ∂h/∂w at x_w
    applied: Vector = sized("size")  # (size,) x_w
    rate: Vector = sized("size")  # (size,) ẋ_w out
    repairing: float = 0.0  # for how long both references have violated a row without a break, s
    basis: Vector = sized(
        "rows", "size"
    )  # (rows, size) work space: an orthonormal basis of the violated rows


@kernel
def _argument_verdict(x: Vector, x_r: Vector, dt: float, p: ErgRecord) -> int:
    """What the arguments are; the status counts a bad sample, and the reference stays where it
    is.
    """
    if x.shape != (9,) or x_r.shape != p.rate.shape or not 0.0 <= dt < np.inf:
        return MISFIT
    if all_possible(x) and all_possible(x_r):
        return FEASIBLE
    p.bad_samples += 1
    p.infeasible, p.least_violation = 1, np.inf
    return BAD


@kernel
def _first_broken(h: Vector, jacobian: Vector) -> int:
    """The first row that is NaN, or whose derivatives are not finite; −1 without any."""
    for r in range(h.shape[0]):
        finite = np.all(np.isfinite(jacobian[r]))
        if np.isnan(h[r]) or not finite:
            return r
    return -1


@kernel
def governed_update(x: Vector, x_r: Vector, dt: float, p: ErgRecord, rows: ForceRowsRecord) -> int:
    """One tick with the force rows, see :meth:`ExplicitReferenceGovernor.update`; what it came
    to.
    """
    verdict = _argument_verdict(x, x_r, dt, p)
    if verdict != FEASIBLE:
        return verdict
    force_rows(x, x_r, rows, p.h_r, p.jacobian_r)
    force_rows(x, p.applied, rows, p.h_w, p.jacobian_w)
    return _explicit_update(x_r, dt, p)


@kernel
def _explicit_update(x_r: Vector, dt: float, p: ErgRecord) -> int:
    """One tick with constraints and Jacobians filled in; keeps the time of repair."""
    infeasible = explicit_update(x_r, p.applied, dt, p)
    p.repairing = p.repairing + dt if infeasible else 0.0
    p.infeasible, p.least_violation = infeasible, 0.0
    p.stuck = p.repairing > STUCK_AFTER
    if not infeasible:
        return FEASIBLE
    return STUCK if p.repairing > STUCK_AFTER else INFEASIBLE


@kernel(x_r="p.rate", x_w="p.rate")
def explicit_update(x_r: Vector, x_w: Vector, dt: float, p: ErgRecord) -> bool:
    """One tick of Algorithm 1: ẋ_w = v_r + v_t + v_n, x_w ← x_w + Δt ẋ_w.

    Args:
        x_r: (size,) target reference.
        x_w: (size,) applied reference, updated in place.
        dt: Δt, s.
        p: of the governor, its constraints and Jacobians filled in.

    Returns:
        Whether both references violate a row.
    """
    worst = np.argmin(p.h_w)
    min_r, min_w = float(np.min(p.h_r)), p.h_w[worst]
    p.rate[:] = 0.0
    # v_r: straight to the target.
    if min_w >= 0.0 or min_r >= 0.0:
        p.rate += p.alpha_r * (x_r - x_w)
    # v_t: the part of the way that leaves the violated rows unchanged.
    tangential = (min_w >= 0.0 or min_r < 0.0) if p.literal else (min_w >= 0.0 and min_r < 0.0)
    # v_n: repair along the worst row when both references violate; v_t instead, or as well, where
    # it has no direction.
    infeasible: bool = min_w < 0.0 and min_r < 0.0
    if infeasible and p.own[worst]:
        tangential = _add_shortest(dt, p, worst)
        if not tangential:
            p.rate += p.alpha_r * (x_r - x_w)
    elif infeasible:
        towards = min_w <= min_r if p.literal else p.h_r[worst] >= p.h_w[worst]
        tangential |= not _add_normal(x_r, x_w, p, worst, towards)
    if tangential:
        _add_tangential(x_r, x_w, p)
    x_w += dt * p.rate
    return infeasible


@kernel
def _violated_basis(p: ErgRecord) -> int:
    """Orthonormal basis of the rows that x_r violates, into ``p.basis``; returns their rank."""
    jacobian, basis = p.jacobian_r, p.basis
    rank = 0
    for k in range(p.h_r.shape[0]):
        norm = np.sqrt(jacobian[k] @ jacobian[k])
        if p.h_r[k] >= 0.0 or norm == 0.0:
            continue
        row = basis[rank]
        row[:] = jacobian[k] / norm
        # Gram–Schmidt, twice: normalised analytic rows, so that the rank is right (W7).
        for _ in range(2):
            for b in range(rank):
                row -= (basis[b] @ row) * basis[b]
        rest = np.sqrt(row @ row)
        if rest > INDEPENDENT:
            row /= rest
            rank += 1
            if rank == row.shape[0]:
                break
    return rank


@kernel
def _add_tangential(x_r: Vector, x_w: Vector, p: ErgRecord) -> None:
    """v_t = α_t (I − C⁺C)(x_r − x_w), C the violated rows."""
    away = x_r - x_w
    p.rate += p.alpha_t * away
    for b in range(_violated_basis(p)):
        p.rate -= p.alpha_t * (p.basis[b] @ away) * p.basis[b]


@kernel
def _add_normal(x_r: Vector, x_w: Vector, p: ErgRecord, worst: int, towards: bool) -> bool:
    """v_n along the worst row, towards the target or away from it; returns whether that is a
    direction at all.
    """
    row = p.jacobian_r[worst]
    squared = row @ row
    dot: float = row @ (x_r - x_w)
    scale = p.alpha_n * dot if towards else -p.alpha_n * dot
    if not p.literal:
        scale = scale / squared if squared > 0.0 else 0.0
    p.rate += scale * row
    return abs(dot) > float(-NO_WAY * p.h_w[worst])


@kernel
def _add_shortest(dt: float, p: ErgRecord, worst: int) -> bool:
    """The shortest way for x_w into its worst row; returns whether there is one, and a short
    one.
    """
    row = p.jacobian_w[worst]
    norm = np.sqrt(row @ row)
    if not -p.h_w[worst] <= FARTHEST * norm:
        return False
    # At the rate of the print, α_n times the distance of the references, and no further than just
    # inside.
    distance = -min(p.h_w[worst], p.h_r[worst]) / norm
    speed = min(p.alpha_n * distance, (INSIDE - p.h_w[worst] / norm) / max(dt, 1e-9))
    p.rate += speed * row / norm
    return True


CONDITIONS = ("algorithm", "equation")
"""Conditions of the terms of the update: those of Algorithm 1, or those of the equations."""


@dataclass(frozen=True, kw_only=True)
class PaperGovernorParameters(checks.Checked):
    """Settings of :class:`~harpy_pin.governors.ExplicitReferenceGovernor` on a walk; by default the
    paper's 3D run.

    Attributes:
        alpha_r: rate towards the target where it is allowed, 1/s.
        alpha_t: rate along the null space of the violated rows, 1/s.
        alpha_n: rate of the repair along the worst row, 1/s.
        conditions: ``algorithm`` or ``equation``, which differ (equations.md E8).
        friction_share: share of the assumed friction coefficient that the rows use; what is left is
            for errors.
        min_normal_force: least normal force of the row on it, N.
    """

    alpha_r: float = checks.setting(10.0, low=0.0)
    alpha_t: float = checks.setting(15.0, low=0.0)
    alpha_n: float = checks.setting(20.0, low=0.0)
    conditions: str = checks.setting("algorithm", checks.one_of, valid=CONDITIONS)
    friction_share: float = checks.setting(1.0, low=0.0, high=1.0, strict=True)
    min_normal_force: float = checks.setting(20.0, low=0.0)
