"""The simplest governor: the normal force of the reduced-order model, clamped to a window, exactly.

All force rows are parallel in the reference (READING.md §2), so the projection on u_min ≤ u_gz ≤ u_max moves F along
the leg only. It is the baseline that every other governor has to beat. It does nothing about friction.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from harpy_pin import checks
from harpy_pin.governor.base import GovernorStatus, check_batch
from harpy_pin.governor.feedback import direction, feedback, finite, lift, pack_model
from harpy_pin.state import Vector
from harpy_pin.thrust import CentreGains
from harpy_pin.vlip import Law

__all__ = ["ClampGovernor"]


class ClampGovernor:
    """Closest reference at which the model's normal force lies in a window.

    Args:
        mass: m, kg.
        gains: of the thruster law, the same along every axis.
        law: which law closes the loop.
        min_normal_force: u_min, N.
        max_normal_force: u_max, N.
        g: magnitude of gravity, m/s².

    Raises:
        InputError: a number out of its domain, or an empty window.
    """

    def __init__(
        self,
        *,
        mass: float,
        gains: CentreGains | None = None,
        law: Law = Law.FULL,
        min_normal_force: float = 20.0,
        max_normal_force: float = 1e6,
        g: float = 9.81,
    ) -> None:
        least = checks.number("min_normal_force", min_normal_force, low=0.0)
        most = checks.number("max_normal_force", max_normal_force, low=least)
        self._model = np.array([*pack_model(mass=mass, g=g, gains=gains, law=law), least, most])
        names = ("normal force, least", "normal force, most")
        self.applied: Vector = np.zeros(6)
        self.status = GovernorStatus(names, np.zeros(2), np.zeros(2), np.zeros(6))
        self._work = np.zeros(9)

    def reset(self, x_r: Vector) -> None:
        """Start over with x_w = x_r."""
        self.applied[:] = x_r

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """See :class:`harpy_pin.governor.base.Governor`."""
        s = self.status
        s.least_violation = clamp_update(x, x_r, dt, self._model, self._work, self.applied, s.rate, s.h_r, s.h_w)
        s.infeasible = s.least_violation > 0.0
        return self.applied

    def update_batch(self, x: Vector, x_r: Vector, applied: Vector, dt: float) -> Vector:
        """Advance N governors with these settings by one tick; see :func:`harpy_pin.governor.base.check_batch`."""
        check_batch(x, x_r, applied)
        violation = np.zeros(len(x))
        _update_all(x, x_r, dt, self._model, self._work, applied, violation)
        return violation


@njit(cache=True)
def clamp_update(x, x_r, dt, model, work, x_w, rate, h_r, h_w):  # type: ignore[no-untyped-def]
    """One tick; returns the violation that remains where the leg does not point up, N."""
    if not finite(x, x_r):
        rate[:] = 0.0
        return np.inf  # a reading that is no number: the reference stays
    r_hat, force, change = work[0:3], work[3:6], work[6:9]
    direction(x, r_hat)
    feedback(x, x_r, r_hat, model, force)
    sign = 1.0 if model[2] == 0.0 else -1.0
    along = 0.0
    for i in range(3):
        along += r_hat[i] * force[i]
    slope = sign * r_hat[2]
    rest = model[0] * model[1] * r_hat[2] * r_hat[2]
    normal = rest + slope * along
    h_r[0], h_r[1] = normal - model[7], model[8] - normal
    wanted = min(max(normal, model[7]), model[8])
    step = (wanted - normal) / slope if abs(slope) > 1e-9 else 0.0
    held = normal + slope * step
    h_w[0], h_w[1] = held - model[7], model[8] - held
    for i in range(3):
        change[i] = step * r_hat[i]
        rate[i], rate[3 + i] = -x_w[i], -x_w[3 + i]
        x_w[i], x_w[3 + i] = x_r[i], x_r[3 + i]
    lift(change, r_hat, model, x_w)
    for i in range(6):
        rate[i] = (rate[i] + x_w[i]) / dt if dt > 0.0 else 0.0
    scale = 1e-9 * (1.0 + model[7])
    left = max(-h_w[0], -h_w[1])
    return left if left > scale else 0.0


@njit(cache=True)
def _update_all(x, x_r, dt, model, work, applied, violation):  # type: ignore[no-untyped-def]
    rate, h_r, h_w = np.zeros(6), np.zeros(2), np.zeros(2)
    for k in range(x.shape[0]):
        violation[k] = clamp_update(x[k], x_r[k], dt, model, work, applied[k], rate, h_r, h_w)
