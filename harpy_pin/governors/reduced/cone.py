"""The friction cone as a barrier (equations.md R4): references that keep the leg inside the pyramid.

The model's force lies along the leg, so friction holds exactly while the leg stays inside the pyramid: each face is
b = aᵀr ≥ 0 with a = μ ẑ ∓ x̂, μ ẑ ∓ ŷ. Each is enforced by b̈ + (k₁ + k₂) ḃ + k₁ k₂ b ≥ 0, affine in F
(:mod:`harpy_pin.governors.reduced.feedback`); beside them stand the normal-force window, the leg's length (the same
condition on r·r), and the thrust limit as a box inside it. F is projected exactly, and lifted back to the closest
reference.

The reference is a function of state and target alone: without memory or switching it cannot chatter.

From b ≥ 0 and ḃ + k₁ b ≥ 0, with feasible rows at all times, b ≥ 0 for ever (the comparison lemma, twice:
s = ḃ + k₁ b obeys ṡ ≥ −k₂ s, and then ḃ ≥ −k₁ b). Held over a tick the rows drift by O(Δt); ``tightening`` covers it.

After ticks without feasible rows, or a start outside, b or ḃ + k₁ b may be negative although the rows are feasible.
They then only bring the leg back, and friction is violated meanwhile: the status is ``outside``. The rows hold at the
ticks only: where the target jumps, the thruster feedback moves the normal force by newtons within one tick
(docs/governors.md), more than the default ``tightening``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.governors.governor import GovernorStatus, check_update
from harpy_pin.governors.reduced.feedback import FeedbackRecord, direction, feedback, feedback_record, finite, lift
from harpy_pin.governors.reduced.point_mass import Law
from harpy_pin.governors.reduced.projection import project
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Records, field, fields, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.thrust import CentreGains

__all__ = ["ROWS", "ConeGovernor", "cone_record", "cone_rows"]

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


class ConeRecord(FeedbackRecord):
    """What the kernels of :class:`ConeGovernor` know and work in.

    Attributes:
        mu: μ_s.
        k_1, k_2: rates of the barriers, 1/s.
        min_normal_force, max_normal_force: N.
        shortest, longest: leg, m; not limited where ``longest`` is zero.
        thrust_limit: N, none where it is zero.
        tightening: N.
        feed_forward: whether the target's motion gives the velocity it does not carry.
        last: (3,) target of the last tick, m.
        applied: (6,) x_w.
        rate: (6,) ẋ_w out.
        h_r, h_w: (14,) rows at target and applied reference, out, N.
        rows, bounds: (14, 3) and (14,) of the condition rows F ≥ bounds, N.
        inside: least b and b + ḃ/k₁ of the faces, over √(1 + μ²), m: negative where friction is not promised.
        r_hat: (3,) along the leg.
        desired, held, change: (3,) F of the target, its projection, and their difference, N.
        work: (3, 14) of the projection.
    """

    mu: float
    k_1: float
    k_2: float
    min_normal_force: float
    max_normal_force: float
    shortest: float
    longest: float
    thrust_limit: float
    tightening: float
    feed_forward: int
    last: Vector = sized(3, fill=np.nan)
    applied: Vector = sized(6)
    rate: Vector = sized(6)
    h_r: Vector = sized("rows")
    h_w: Vector = sized("rows")
    rows: Vector = sized("rows", 3)
    bounds: Vector = sized("rows")
    inside: float = 0.0
    r_hat: Vector = sized(3)
    desired: Vector = sized(3)
    held: Vector = sized(3)
    change: Vector = sized(3)
    work: Vector = sized(3, "rows")


@fixed_arrays("applied", "friction")
class ConeGovernor(KeepsViews):
    """Closest reference that keeps the reduced-order model inside its cone and limits.

    Args:
        mass: m, kg.
        mu: friction coefficient μ_s.
        gains: of the thruster feedback, the same along every axis.
        law: which control law closes the loop.
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
        status: of the last update, rows :data:`ROWS`, N; rows not in use read one. It promises friction only where it
            is neither ``infeasible`` nor ``outside``.
        friction: (1,) μ_s, to be overwritten between updates where more is known.

    Raises:
        InputError: a number out of its domain.
    """

    @checked
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
        n = len(ROWS)
        least = checks.number("min_normal_force", min_normal_force, low=0.0)
        shortest, longest = (0.0, 0.0) if leg is None else leg
        limit = 0.0 if thrust_limit is None else checks.number("thrust_limit", thrust_limit, low=0.0, strict=True)
        self._record = make_record(
            ConeRecord,
            {"rows": n},
            mu=checks.number("mu", mu, low=0.0),
            k_1=checks.number("rates[0]", rates[0], low=0.0, strict=True),
            k_2=checks.number("rates[1]", rates[1], low=0.0, strict=True),
            min_normal_force=least,
            max_normal_force=checks.number("max_normal_force", max_normal_force, low=least),
            shortest=checks.number("leg[0]", shortest, low=0.0),
            longest=checks.number("leg[1]", longest, low=shortest),
            thrust_limit=limit,
            tightening=checks.number("tightening", tightening, low=0.0),
            feed_forward=bool(feed_forward),
            **fields(feedback_record(mass=mass, g=g, gains=gains, law=law)),
        )
        self._inside: Vector = self._record["inside"]
        self.applied: Vector = field(self._record, "applied")
        self.friction: Vector = self._record["mu"]
        self.status = GovernorStatus.from_record(ROWS, self._record)
        _cone_update.prepare(np.zeros(9), np.zeros(6), 0.0, self._record)

    def reset(self, x_r: Vector) -> None:
        """Start over with x_w = x_r.

        Args:
            x_r: (6,) target reference [c_t; ċ_t], m and m/s.
        """
        self.applied[:] = checks.vector("x_r", x_r, 6)
        self.status.bad_samples = 0
        field(self._record, "last")[:] = np.nan

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """See :class:`harpy_pin.governors.governor.Governor`."""
        status = self.status
        try:
            violation = _cone_update(x, x_r, dt, self._record)
        except Exception:
            check_update(x, x_r, 6, dt)
            raise
        if violation == np.inf:
            check_update(x, x_r, 6, dt)
            status.bad()
            return self.applied
        status.least_violation, status.infeasible = violation, violation > 0.0
        status.outside = bool(self._inside[0] < 0.0)
        return self.applied


def cone_record(**settings: Any) -> Records[ConeRecord]:
    """The record of a new governor, for its kernels; see :class:`ConeGovernor`."""
    return ConeGovernor(**settings)._record


@kernel(x=(9,), r_hat=(3,), rows="p.rows", bounds="p.bounds")
def cone_rows(x: Vector, r_hat: Vector, length: float, p: ConeRecord, rows: Vector, bounds: Vector) -> None:
    """Rows F ↦ rows F ≥ bounds in N, for an element of :func:`cone_record`. A row not in use is zero and holds."""
    length = max(length, 1e-6)  # a body on the foot has no direction, and no feasible row
    rows[:, :] = 0.0
    bounds[:] = -1.0
    _friction_rows(x, r_hat, length, p, rows, bounds)
    _normal_force_rows(r_hat, p, rows, bounds)
    if p.longest > 0.0 and not p.full:
        _leg_rows(x, r_hat, length, p, rows, bounds)
    if p.thrust_limit > 0.0:
        _thrust_rows(r_hat, p, rows, bounds)


@kernel
def _friction_rows(x: Vector, r_hat: Vector, length: float, p: ConeRecord, rows: Vector, bounds: Vector) -> None:
    """Barriers of the four faces of the pyramid: rows 0 to 3."""
    scale = 1.0 / np.sqrt(1.0 + p.mu * p.mu)
    upward = p.mu * scale
    p.inside = np.inf
    for k in range(4):
        axis = 0 if k < 2 else 1
        sign = -scale if k % 2 == 0 else scale
        along = sign * r_hat[axis] + upward * r_hat[2]  # aᵀ r̂
        speed = sign * x[3 + axis] + upward * x[5]
        p.inside = min(p.inside, along * length, along * length + speed / p.k_1)
        rows[k, axis] = sign
        rows[k, 2] = upward
        # m aᵀ(I − Y) g = −m g (a_z − aᵀr̂ r̂_z)
        gravity = -(p.mass * p.g) * (upward - along * r_hat[2])
        if p.full:
            for i in range(3):
                rows[k, i] -= along * r_hat[i]
        barrier = (p.k_1 + p.k_2) * speed + p.k_1 * p.k_2 * along * length
        bounds[k] = -gravity - p.mass * barrier + p.tightening


@kernel
def _normal_force_rows(r_hat: Vector, p: ConeRecord, rows: Vector, bounds: Vector) -> None:
    """Window of the normal force: rows 4 and 5."""
    sign = -1.0 if p.full else 1.0
    for i in range(3):
        rows[4, i] = sign * r_hat[2] * r_hat[i]
        rows[5, i] = -rows[4, i]
    weight = p.mass * p.g
    bounds[4] = p.min_normal_force - weight * r_hat[2] * r_hat[2] + p.tightening
    bounds[5] = weight * r_hat[2] * r_hat[2] - p.max_normal_force + p.tightening


@kernel
def _leg_rows(x: Vector, r_hat: Vector, length: float, p: ConeRecord, rows: Vector, bounds: Vector) -> None:
    """Barriers of the leg's length: rows 6 and 7."""
    k1, k2 = p.k_1, p.k_2
    speed, squared = 0.0, 0.0
    for i in range(3):
        speed += r_hat[i] * x[3 + i]
        squared += x[3 + i] * x[3 + i]
    for k in range(2):
        side = 1.0 if k == 0 else -1.0
        limit = p.shortest if k == 0 else p.longest
        for i in range(3):
            rows[6 + k, i] = side * r_hat[i]
        rest = squared / length + (k1 + k2) * speed + 0.5 * k1 * k2 * (length * length - limit * limit) / length
        bounds[6 + k] = -side * p.mass * rest + p.tightening


@kernel
def _thrust_rows(r_hat: Vector, p: ConeRecord, rows: Vector, bounds: Vector) -> None:
    """A box inside the thrust limit: rows 8 to 13."""
    if p.full:
        for k in range(3):
            rows[8 + 2 * k, k], rows[9 + 2 * k, k] = -1.0, 1.0
            bounds[8 + 2 * k] = bounds[9 + 2 * k] = -p.thrust_limit / np.sqrt(3.0) + p.tightening
        return
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
        bounds[k] = bounds[k + 1] = -p.thrust_limit / np.sqrt(2.0) + p.tightening


@kernel
def _row_margins(rows: Vector, bounds: Vector, force: Vector, h: Vector) -> None:
    for k in range(rows.shape[0]):
        h[k] = rows[k, 0] * force[0] + rows[k, 1] * force[1] + rows[k, 2] * force[2] - bounds[k]


@kernel
def _cone_update(x: Vector, x_r: Vector, dt: float, p: ConeRecord) -> float:
    """One tick of the applied reference; returns the least violation, N."""
    x_w = p.applied
    if not finite(x, x_r, dt):
        p.rate[:] = 0.0
        return np.inf  # not finite: the reference stays as it is
    for i in range(6):
        p.rate[i] = -x_w[i]
        x_w[i] = x_r[i]
    if p.feed_forward:
        _add_motion(x_r, x_w, dt, p.last)
    length = direction(x, p.r_hat)
    feedback(x, x_w, p.r_hat, p, p.desired)
    cone_rows(x, p.r_hat, length, p, p.rows, p.bounds)
    violation = project(p.rows, p.bounds, p.desired, p.held, p.work)
    _row_margins(p.rows, p.bounds, p.desired, p.h_r)
    _row_margins(p.rows, p.bounds, p.held, p.h_w)
    for i in range(3):
        p.change[i] = p.held[i] - p.desired[i]
    lift(p.change, p.r_hat, p, x_w)
    for i in range(6):
        p.rate[i] = (p.rate[i] + x_w[i]) / dt if dt > 0.0 else 0.0
    return violation


@kernel
def _add_motion(x_r: Vector, x_w: Vector, dt: float, last: Vector) -> None:
    """The velocity of a target that carries none, from its last two places."""
    still = x_r[3] == 0.0 and x_r[4] == 0.0 and x_r[5] == 0.0
    for i in range(3):
        if still and dt > 0.0 and not np.isnan(last[i]):
            x_w[3 + i] = (x_r[i] - last[i]) / dt
        last[i] = x_r[i]
