"""The friction cone as a barrier (equations.md R4): references that keep the leg inside the pyramid.

The model's force lies along the leg, so friction holds exactly while the leg stays inside the pyramid: each face is
b = aᵀr ≥ 0 with a = μ ẑ ∓ x̂, μ ẑ ∓ ŷ. Each is enforced by b̈ + (k₁ + k₂) ḃ + k₁ k₂ b ≥ 0, affine in F
(:mod:`harpy_pin.governor.reduced.feedback`); beside them stand the normal-force window, the leg's length (the same
condition on r·r), and the thrust limit as a box inside it. F is projected exactly, and lifted back to the closest
reference.

The reference is a function of state and target alone: no memory, no switching, so nothing to chatter.

What holds: from b ≥ 0 and ḃ + k₁ b ≥ 0, with feasible rows at all times, b ≥ 0 for ever (the comparison lemma, twice:
s = ḃ + k₁ b obeys ṡ ≥ −k₂ s, and then ḃ ≥ −k₁ b). Held over a tick the rows drift by O(Δt); ``tightening`` covers it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from harpy_pin import checks
from harpy_pin.governor.base import GovernorStatus, check_batch
from harpy_pin.governor.reduced.feedback import direction, feedback, finite, lift, pack_model
from harpy_pin.governor.reduced.model import Law
from harpy_pin.governor.reduced.projection import project
from harpy_pin.model.state import Vector
from harpy_pin.model.thrust import CentreGains

__all__ = ["ROWS", "ConeGovernor", "cone_rows", "pack_cone"]

ROWS = (
    "friction +x",
    "friction -x",
    "friction +y",
    "friction -y",
    "normal force, least",
    "normal force, most",
    "leg, shortest",
    "leg, longest",
    "thrust +1",
    "thrust -1",
    "thrust +2",
    "thrust -2",
    "thrust +3",
    "thrust -3",
)


def pack_cone(
    *,
    mass: float,
    mu: float,
    gains: CentreGains | None,
    law: Law,
    g: float,
    rates: tuple[float, float],
    min_normal_force: float,
    max_normal_force: float,
    leg: tuple[float, float] | None,
    thrust_limit: float | None,
    tightening: float,
) -> Vector:
    """(16,) numbers of :func:`cone_rows`: the model's seven, μ, k₁, k₂, u_min, u_max, L_min, L_max, T, tightening.

    Raises:
        InputError: a number out of its domain.
    """
    least = checks.number("min_normal_force", min_normal_force, low=0.0)
    shortest, longest = (0.0, 0.0) if leg is None else leg
    return np.array(
        [
            *pack_model(mass=mass, g=g, gains=gains, law=law),
            checks.number("mu", mu, low=0.0),
            checks.number("rates[0]", rates[0], low=0.0, strict=True),
            checks.number("rates[1]", rates[1], low=0.0, strict=True),
            least,
            checks.number("max_normal_force", max_normal_force, low=least),
            checks.number("leg[0]", shortest, low=0.0),
            checks.number("leg[1]", longest, low=shortest),
            0.0 if thrust_limit is None else checks.number("thrust_limit", thrust_limit, low=0.0, strict=True),
            checks.number("tightening", tightening, low=0.0),
        ]
    )


class ConeGovernor:
    """Closest reference that keeps the reduced-order model inside its cone and limits.

    Args:
        mass: m, kg.
        mu: friction coefficient μ_s.
        gains: of the thruster law, the same along every axis.
        law: which law closes the loop.
        rates: k₁, k₂ of the barriers, 1/s.
        min_normal_force: u_min, N.
        max_normal_force: u_max, N.
        leg: shortest and longest leg, m; None leaves it free (under the full law no reference changes it).
        thrust_limit: of the total thrust, N; None leaves it free.
        tightening: margin on every row, N: known bounds on the error of mass, friction and delay, in newtons.
        feed_forward: where the target carries no velocity, take it from the target's motion (equations.md W5).
        g: magnitude of gravity, m/s².

    Attributes:
        applied: (6,) x_w.
        status: of the last update, rows :data:`ROWS`, N; rows not in use read one.

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
        rates: tuple[float, float] = (15.0, 15.0),
        min_normal_force: float = 20.0,
        max_normal_force: float = 1e6,
        leg: tuple[float, float] | None = None,
        thrust_limit: float | None = None,
        tightening: float = 0.05,
        feed_forward: bool = False,
        g: float = 9.81,
    ) -> None:
        self._packed = pack_cone(
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
        n = len(ROWS)
        self.feed_forward = bool(feed_forward)
        self.applied: Vector = np.zeros(6)
        self.status = GovernorStatus(ROWS, np.zeros(n), np.zeros(n), np.zeros(6))
        self._last = np.full(3, np.nan)
        self._work = np.zeros(7 * n + 18)

    def reset(self, x_r: Vector) -> None:
        """Start over with x_w = x_r."""
        self.applied[:] = x_r
        self._last[:] = np.nan

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """See :class:`harpy_pin.governor.base.Governor`."""
        s = self.status
        s.least_violation = cone_update(
            x, x_r, dt, self._packed, self.feed_forward, self._work, self._last, self.applied, s.rate, s.h_r, s.h_w
        )
        s.infeasible = s.least_violation > 0.0
        return self.applied

    def update_batch(self, x: Vector, x_r: Vector, applied: Vector, dt: float) -> Vector:
        """Advance N governors with these settings by one tick; see :func:`harpy_pin.governor.base.check_batch`.

        The target's velocity is not fed forward.
        """
        check_batch(x, x_r, applied)
        violation = np.zeros(len(x))
        _update_all(x, x_r, dt, self._packed, np.zeros_like(self._work), applied, violation)
        return violation


@njit(cache=True)
def cone_rows(x, r_hat, length, p, rows, bounds):  # type: ignore[no-untyped-def]
    """Rows F ↦ rows F ≥ bounds in N; the first seven of ``p`` are the model. A row not in use is zero and holds."""
    mass, g, full = p[0], p[1], p[2] != 0.0
    mu, k1, k2 = p[7], p[8], p[9]
    weight = mass * g
    length = max(length, 1e-6)  # a body on the foot has no direction, and no feasible row
    rows[:, :] = 0.0
    bounds[:] = -1.0
    scale = 1.0 / np.sqrt(1.0 + mu * mu)
    for k in range(4):
        axis = 0 if k < 2 else 1
        sign = -scale if k % 2 == 0 else scale
        along = sign * r_hat[axis] + mu * scale * r_hat[2]  # aᵀ r̂
        speed = sign * x[3 + axis] + mu * scale * x[5]
        rows[k, axis] = sign
        rows[k, 2] = mu * scale
        # m aᵀ(I − Y) g = −m g (a_z − aᵀr̂ r̂_z)
        gravity = -weight * (mu * scale - along * r_hat[2])
        if full:
            for i in range(3):
                rows[k, i] -= along * r_hat[i]
        bounds[k] = -gravity - mass * ((k1 + k2) * speed + k1 * k2 * along * length) + p[15]
    sign = -1.0 if full else 1.0
    for i in range(3):
        rows[4, i] = sign * r_hat[2] * r_hat[i]
        rows[5, i] = -rows[4, i]
    bounds[4] = p[10] - weight * r_hat[2] * r_hat[2] + p[15]
    bounds[5] = weight * r_hat[2] * r_hat[2] - p[11] + p[15]
    if p[13] > 0.0 and not full:
        speed, squared = 0.0, 0.0
        for i in range(3):
            speed += r_hat[i] * x[3 + i]
            squared += x[3 + i] * x[3 + i]
        for k in range(2):
            side = 1.0 if k == 0 else -1.0
            limit = p[12 + k]
            for i in range(3):
                rows[6 + k, i] = side * r_hat[i]
            rest = squared / length + (k1 + k2) * speed + 0.5 * k1 * k2 * (length * length - limit * limit) / length
            bounds[6 + k] = -side * mass * rest + p[15]
    if p[14] > 0.0:
        if full:
            for k in range(3):
                rows[8 + 2 * k, k], rows[9 + 2 * k, k] = -1.0, 1.0
                bounds[8 + 2 * k] = bounds[9 + 2 * k] = -p[14] / np.sqrt(3.0) + p[15]
        else:
            # A square inside the disc, across the leg.
            small = 0
            for i in range(1, 3):
                if abs(r_hat[i]) < abs(r_hat[small]):
                    small = i
            norm = np.sqrt(1.0 - r_hat[small] ** 2)
            for i in range(3):
                rows[8, i] = ((1.0 if i == small else 0.0) - r_hat[small] * r_hat[i]) / norm
            rows[10, 0] = r_hat[1] * rows[8, 2] - r_hat[2] * rows[8, 1]
            rows[10, 1] = r_hat[2] * rows[8, 0] - r_hat[0] * rows[8, 2]
            rows[10, 2] = r_hat[0] * rows[8, 1] - r_hat[1] * rows[8, 0]
            for k in (8, 10):
                for i in range(3):
                    rows[k + 1, i] = -rows[k, i]
                bounds[k] = bounds[k + 1] = -p[14] / np.sqrt(2.0) + p[15]


@njit(cache=True)
def _margins(rows, bounds, force, h):  # type: ignore[no-untyped-def]
    for k in range(rows.shape[0]):
        h[k] = rows[k, 0] * force[0] + rows[k, 1] * force[1] + rows[k, 2] * force[2] - bounds[k]


@njit(cache=True)
def cone_update(x, x_r, dt, p, feed_forward, work, last, x_w, rate, h_r, h_w):  # type: ignore[no-untyped-def]
    """One tick; returns the least violation, N."""
    if not finite(x, x_r):
        rate[:] = 0.0
        return np.inf  # a reading that is no number: the reference stays
    n = h_r.shape[0]
    rows = work[: 3 * n].reshape((n, 3))
    bounds = work[3 * n : 4 * n]
    scratch = work[4 * n : 7 * n].reshape((3, n))
    r_hat, force, held = work[7 * n : 7 * n + 3], work[7 * n + 3 : 7 * n + 6], work[7 * n + 6 : 7 * n + 9]
    change = work[7 * n + 9 : 7 * n + 12]
    for i in range(6):
        rate[i] = -x_w[i]
        x_w[i] = x_r[i]
    if feed_forward:
        still = x_r[3] == 0.0 and x_r[4] == 0.0 and x_r[5] == 0.0
        for i in range(3):
            if still and dt > 0.0 and not np.isnan(last[i]):
                x_w[3 + i] = (x_r[i] - last[i]) / dt
            last[i] = x_r[i]
    length = direction(x, r_hat)
    feedback(x, x_w, r_hat, p, force)
    cone_rows(x, r_hat, length, p, rows, bounds)
    violation = project(rows, bounds, force, held, scratch)
    _margins(rows, bounds, force, h_r)
    _margins(rows, bounds, held, h_w)
    for i in range(3):
        change[i] = held[i] - force[i]
    lift(change, r_hat, p, x_w)
    for i in range(6):
        rate[i] = (rate[i] + x_w[i]) / dt if dt > 0.0 else 0.0
    return violation


@njit(cache=True)
def _update_all(x, x_r, dt, p, work, applied, violation):  # type: ignore[no-untyped-def]
    n = (work.shape[0] - 18) // 7
    last, rate, h_r, h_w = np.zeros(3), np.zeros(6), np.zeros(n), np.zeros(n)
    for k in range(x.shape[0]):
        violation[k] = cone_update(x[k], x_r[k], dt, p, False, work, last, applied[k], rate, h_r, h_w)
