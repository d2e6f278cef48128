"""The cone's rows in rate form: ẋ_w from a barrier condition that includes the drift of the state.

With B(x, x_w) ≥ 0 the rows of :mod:`harpy_pin.governor.cone`, the applied reference moves towards the target,
ẋ_w = α (x_r − x_w) + ẋ_r, as far as Ḃ + κ B ≥ 0 allows, where Ḃ contains ∂B/∂x ẋ (READING.md W3). Per tick this reads
B(x⁺, x_w⁺) ≥ (1 − κ Δt) B(x, x_w) with the model's own prediction x⁺ = x + Δt ẋ: exact to first order in Δt, again
affine in F, projected exactly and lifted back with the least norm.

What holds, in continuous time: B ≥ 0 at the start stays so, and so the cone does under the cone's own conditions; a
violated row recovers at the rate κ. Per tick the row is held at x⁺ while the force already acts at x, a gap of O(Δt)
that ``tightening`` is there to cover: measured, not proved. The price of a smooth rate is lag.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from harpy_pin import checks
from harpy_pin.governor.base import GovernorStatus, check_batch
from harpy_pin.governor.cone import ROWS, cone_rows, pack_cone
from harpy_pin.governor.feedback import acceleration, direction, feedback, finite, lift
from harpy_pin.governor.projection import project
from harpy_pin.state import Vector
from harpy_pin.thrust import CentreGains
from harpy_pin.vlip import Law

__all__ = ["BarrierGovernor"]


class BarrierGovernor:
    """Rate-form governor of the reduced-order model's cone.

    Args:
        mass: m, kg.
        mu: friction coefficient μ_s.
        gains: of the thruster law, the same along every axis.
        law: which law closes the loop.
        alpha: rate towards the target, 1/s.
        kappa: κ, rate at which a row may be approached, 1/s.
        rates: k₁, k₂ of the faces' barriers, 1/s.
        min_normal_force: u_min, N.
        max_normal_force: u_max, N.
        leg: shortest and longest leg, m; None leaves it free.
        thrust_limit: of the total thrust, N; None leaves it free.
        tightening: margin on every row, N; it also covers the O(Δt) error of the prediction.
        feed_forward: add the target's own rate of change.
        g: magnitude of gravity, m/s².

    Raises:
        InputError: a number out of its domain.
    """

    def __init__(
        self,
        *,
        mass: float,
        mu: float,
        gains: CentreGains | None = None,
        law: Law = Law.FULL,
        alpha: float = 10.0,
        kappa: float = 50.0,
        rates: tuple[float, float] = (15.0, 15.0),
        min_normal_force: float = 20.0,
        max_normal_force: float = 1e6,
        leg: tuple[float, float] | None = None,
        thrust_limit: float | None = None,
        tightening: float = 0.6,
        feed_forward: bool = True,
        g: float = 9.81,
    ) -> None:
        packed = pack_cone(
            mass=mass,
            mu=mu,
            gains=gains,
            law=law,
            g=g,
            rates=rates,
            min_normal_force=min_normal_force,
            max_normal_force=max_normal_force,
            leg=leg,
            thrust_limit=thrust_limit,
            tightening=tightening,
        )
        more = (
            checks.number("alpha", alpha, low=0.0),
            checks.number("kappa", kappa, low=0.0, strict=True),
            float(bool(feed_forward)),
        )
        n = len(ROWS)
        self._packed = np.array([*packed, *more])
        self.applied: Vector = np.zeros(6)
        self.status = GovernorStatus(ROWS, np.zeros(n), np.zeros(n), np.zeros(6))
        self._last = np.full(6, np.nan)
        self._work = np.zeros(7 * n + 30)

    def reset(self, x_r: Vector) -> None:
        """Start over with x_w = x_r."""
        self.applied[:] = x_r
        self._last[:] = np.nan

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """See :class:`harpy_pin.governor.base.Governor`."""
        s = self.status
        s.least_violation = barrier_update(
            x, x_r, dt, self._packed, self._work, self._last, self.applied, s.rate, s.h_r, s.h_w
        )
        s.infeasible = s.least_violation > 0.0
        return self.applied

    def update_batch(self, x: Vector, x_r: Vector, applied: Vector, dt: float) -> Vector:
        """Advance N governors with these settings by one tick; see :func:`harpy_pin.governor.base.check_batch`.

        The target's rate of change is not fed forward.
        """
        check_batch(x, x_r, applied)
        violation = np.zeros(len(x))
        _update_all(x, x_r, dt, self._packed, np.zeros_like(self._work), applied, violation)
        return violation


@njit(cache=True)
def barrier_update(x, x_r, dt, p, work, last, x_w, rate, h_r, h_w):  # type: ignore[no-untyped-def]
    """One tick; returns the least violation of the barrier condition, N."""
    if not finite(x, x_r):
        rate[:] = 0.0
        return np.inf  # a reading that is no number: the reference stays
    n = h_r.shape[0]
    rows = work[: 3 * n].reshape((n, 3))
    bounds = work[3 * n : 4 * n]
    scratch = work[4 * n : 7 * n].reshape((3, n))
    rest = work[7 * n :]
    r_hat, force, held, change, ahead = rest[0:3], rest[3:6], rest[6:9], rest[9:12], rest[12:21]
    # B now, at the target and at the applied reference.
    length = direction(x, r_hat)
    cone_rows(x, r_hat, length, p, rows, bounds)
    feedback(x, x_r, r_hat, p, force)
    for k in range(n):
        h_r[k] = rows[k, 0] * force[0] + rows[k, 1] * force[1] + rows[k, 2] * force[2] - bounds[k]
    feedback(x, x_w, r_hat, p, force)
    for k in range(n):
        h_w[k] = rows[k, 0] * force[0] + rows[k, 1] * force[1] + rows[k, 2] * force[2] - bounds[k]
    # The model's own prediction, the foot at rest.
    acceleration(force, r_hat, p, change)
    for i in range(3):
        ahead[i] = x[i] + dt * x[3 + i] + 0.5 * dt * dt * change[i]
        ahead[3 + i] = x[3 + i] + dt * change[i]
        ahead[6 + i] = x[6 + i]
    for i in range(6):
        rate[i] = -x_w[i]
        x_w[i] += min(p[16] * dt, 1.0) * (x_r[i] - x_w[i])
        if p[18] != 0.0 and not np.isnan(last[i]):
            x_w[i] += x_r[i] - last[i]
        last[i] = x_r[i]
    length = direction(ahead, r_hat)
    cone_rows(ahead, r_hat, length, p, rows, bounds)
    keep = max(1.0 - p[17] * dt, 0.0)
    for k in range(n):
        bounds[k] += keep * h_w[k]
    for k in range(n):
        if rows[k, 0] == 0.0 and rows[k, 1] == 0.0 and rows[k, 2] == 0.0:
            bounds[k] = min(bounds[k], 0.0) if h_w[k] >= 0.0 else bounds[k]
    feedback(ahead, x_w, r_hat, p, force)
    violation = project(rows, bounds, force, held, scratch)
    for i in range(3):
        change[i] = held[i] - force[i]
    lift(change, r_hat, p, x_w)
    for i in range(6):
        rate[i] = (rate[i] + x_w[i]) / dt if dt > 0.0 else 0.0
    return violation


@njit(cache=True)
def _update_all(x, x_r, dt, p, work, applied, violation):  # type: ignore[no-untyped-def]
    n = (work.shape[0] - 30) // 7
    last, rate, h_r, h_w = np.empty(6), np.zeros(6), np.zeros(n), np.zeros(n)
    for k in range(x.shape[0]):
        last[:] = np.nan
        violation[k] = barrier_update(x[k], x_r[k], dt, p, work, last, applied[k], rate, h_r, h_w)
