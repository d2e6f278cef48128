"""The paper's explicit reference governor, Algorithm 1, faithful to the print.

Its known weaknesses (equations.md §2, W1–W9) are part of it: it chatters by construction, cannot move when x_w = x_r,
and ignores how fast the constraints drift. It is here to be measured.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numba import njit

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.governor.base import GovernorStatus, check_batch
from harpy_pin.governor.reduced.rows import ConstraintRows, ForceRows, force_rows_measured, force_rows_tracked
from harpy_pin.model.state import Vector

__all__ = ["ExplicitReferenceGovernor", "explicit_update"]

CONDITIONS = ("algorithm", "equation")


class ExplicitReferenceGovernor:
    """Explicit reference governor of the paper (Algorithm 1; equations.md E8).

    Args:
        rows: the constraints.
        alpha_r: rate towards the target where it is allowed, 1/s (3D run: 10).
        alpha_t: rate along the null space of the violated rows, 1/s (3D run: 15).
        alpha_n: rate of the repair along the worst row, 1/s (3D run: 20).
        size: length of the reference w.
        conditions: ``algorithm`` follows Algorithm 1; ``equation`` the equations, which differ from it: v_t also acts
            where x_w alone violates, and v_n compares the worst rows of both and is not normalised.

    Raises:
        InputError: a rate is negative or not finite, or ``conditions`` is unknown.
    """

    def __init__(
        self,
        rows: ConstraintRows,
        *,
        alpha_r: float = 10.0,
        alpha_t: float = 15.0,
        alpha_n: float = 20.0,
        size: int = 6,
        conditions: Literal["algorithm", "equation"] = "algorithm",
    ) -> None:
        if conditions not in CONDITIONS:
            raise InputError.unknown("conditions", conditions, CONDITIONS)
        self.rows = rows
        self.conditions = conditions
        self._literal = conditions == "equation"
        self._law = (-1 if rows.reading == "tracked" else int(rows.law)) if isinstance(rows, ForceRows) else 0
        self._alpha = np.array(
            [
                checks.number("alpha_r", alpha_r, low=0.0),
                checks.number("alpha_t", alpha_t, low=0.0),
                checks.number("alpha_n", alpha_n, low=0.0),
            ]
        )
        n = len(rows.names)
        self.applied: Vector = np.zeros(size)
        self.status = GovernorStatus(rows.names, np.zeros(n), np.zeros(n), np.zeros(size))
        self._jacobian_r = np.zeros((n, size))
        self._jacobian_w = np.zeros((n, size))
        self._basis = np.zeros((n, size))

    def reset(self, x_r: Vector) -> None:
        """Start over with x_w = x_r."""
        self.applied[:] = x_r

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """Advance x_w by one tick; see :class:`harpy_pin.governor.base.Governor`."""
        status, rows = self.status, self.rows
        if isinstance(rows, ForceRows):
            # The whole update in one call into compiled code.
            status.infeasible = _force_update(
                x,
                x_r,
                self.applied,
                rows.parameters,
                self._law,
                rows.gains,
                self._alpha,
                dt,
                self._literal,
                status.h_r,
                status.h_w,
                self._jacobian_r,
                self._jacobian_w,
                self._basis,
                status.rate,
            )
            return self.applied
        self.rows.evaluate(x, x_r, status.h_r, self._jacobian_r)
        self.rows.evaluate(x, self.applied, status.h_w, self._jacobian_w)
        status.infeasible = explicit_update(
            status.h_r,
            status.h_w,
            self._jacobian_r,
            x_r,
            self.applied,
            self._alpha,
            dt,
            self._literal,
            self._basis,
            status.rate,
        )
        return self.applied

    def update_batch(self, x: Vector, x_r: Vector, applied: Vector, dt: float) -> Vector:
        """Advance N governors with these settings by one tick; see :func:`harpy_pin.governor.base.check_batch`.

        Returns:
            (N,) one where both references violate a row, else zero.

        Raises:
            InputError: rows other than :class:`~harpy_pin.governor.reduced.rows.ForceRows`; these alone are one kernel.
        """
        rows = self.rows
        if not isinstance(rows, ForceRows):
            raise InputError("a batch of updates needs force rows alone", name="rows", value=rows)
        check_batch(x, x_r, applied)
        infeasible = np.zeros(len(x))
        _update_all(x, x_r, applied, rows.parameters, self._law, rows.gains, self._alpha, dt, self._literal, infeasible)
        return infeasible


@njit(cache=True)
def explicit_update(h_r, h_w, jacobian, x_r, x_w, alpha, dt, literal, basis, rate):  # type: ignore[no-untyped-def]
    """One tick of Algorithm 1: ẋ_w = v_r + v_t + v_n, x_w ← x_w + Δt ẋ_w.

    Args:
        h_r: (rows,) constraints at x_r.
        h_w: (rows,) constraints at x_w.
        jacobian: (rows, n) J_r.
        x_r: (n,) target reference.
        x_w: (n,) applied reference, updated in place.
        alpha: (3,) α_r, α_t, α_n, 1/s.
        dt: Δt, s.
        literal: use the conditions of the equations instead of those of the algorithm.
        basis: (rows, n) work space.
        rate: (n,) ẋ_w out.

    Returns:
        Whether both references violate a row.
    """
    n_rows, n = jacobian.shape
    min_r, min_w, worst = h_r[0], h_w[0], 0
    for k in range(1, n_rows):
        min_r = min(min_r, h_r[k])
        if h_w[k] < min_w:
            min_w, worst = h_w[k], k
    rate[:] = 0.0

    # v_r: straight to the target.
    if min_w >= 0.0 or min_r >= 0.0:
        for i in range(n):
            rate[i] += alpha[0] * (x_r[i] - x_w[i])

    # v_t: the part of the way that leaves the violated rows unchanged, (I − C⁺C)(x_r − x_w).
    along = (min_w >= 0.0 or min_r < 0.0) if literal else (min_w >= 0.0 and min_r < 0.0)
    if along:
        rank = 0
        for k in range(n_rows):
            if h_r[k] < 0.0:
                norm = 0.0
                for i in range(n):
                    norm += jacobian[k, i] * jacobian[k, i]
                norm = np.sqrt(norm)
                if norm == 0.0:
                    continue
                for i in range(n):
                    basis[rank, i] = jacobian[k, i] / norm
                # Gram–Schmidt, twice: normalised analytic rows, so that the rank is right (W7).
                for _ in range(2):
                    for b in range(rank):
                        dot = 0.0
                        for i in range(n):
                            dot += basis[b, i] * basis[rank, i]
                        for i in range(n):
                            basis[rank, i] -= dot * basis[b, i]
                rest = 0.0
                for i in range(n):
                    rest += basis[rank, i] * basis[rank, i]
                rest = np.sqrt(rest)
                if rest > 1e-9:
                    for i in range(n):
                        basis[rank, i] /= rest
                    rank += 1
                    if rank == n:
                        break
        for i in range(n):
            rate[i] += alpha[1] * (x_r[i] - x_w[i])
        for b in range(rank):
            dot = 0.0
            for i in range(n):
                dot += basis[b, i] * (x_r[i] - x_w[i])
            for i in range(n):
                rate[i] -= alpha[1] * dot * basis[b, i]

    # v_n: repair along the worst row when both references violate.
    infeasible = min_w < 0.0 and min_r < 0.0
    if infeasible:
        squared, dot = 0.0, 0.0
        for i in range(n):
            squared += jacobian[worst, i] * jacobian[worst, i]
            dot += jacobian[worst, i] * (x_r[i] - x_w[i])
        towards = min_w <= min_r if literal else h_r[worst] >= h_w[worst]
        scale = alpha[2] * dot if towards else -alpha[2] * dot
        if not literal:
            scale = scale / squared if squared > 0.0 else 0.0
        for i in range(n):
            rate[i] += scale * jacobian[worst, i]

    for i in range(n):
        x_w[i] += dt * rate[i]
    return infeasible


@njit(cache=True)
def _force_update(  # type: ignore[no-untyped-def]
    x, x_r, x_w, parameters, law, gains, alpha, dt, literal, h_r, h_w, jacobian_r, jacobian_w, basis, rate
):
    """Force rows at both references, then :func:`explicit_update`; ``law`` −1 stands for the tracked reading."""
    if law < 0:
        force_rows_tracked(x, x_r, parameters, h_r, jacobian_r)
        force_rows_tracked(x, x_w, parameters, h_w, jacobian_w)
    else:
        force_rows_measured(x, x_r, parameters, law, gains, h_r, jacobian_r)
        force_rows_measured(x, x_w, parameters, law, gains, h_w, jacobian_w)
    return explicit_update(h_r, h_w, jacobian_r, x_r, x_w, alpha, dt, literal, basis, rate)


@njit(cache=True)
def _update_all(  # type: ignore[no-untyped-def]
    x, x_r, applied, parameters, law, gains, alpha, dt, literal, infeasible
):
    h_r, h_w, rate = np.zeros(5), np.zeros(5), np.zeros(6)
    jacobian_r, jacobian_w, basis = np.zeros((5, 6)), np.zeros((5, 6)), np.zeros((5, 6))
    for k in range(x.shape[0]):
        infeasible[k] = _force_update(
            x[k],
            x_r[k],
            applied[k],
            parameters,
            law,
            gains,
            alpha,
            dt,
            literal,
            h_r,
            h_w,
            jacobian_r,
            jacobian_w,
            basis,
            rate,
        )
