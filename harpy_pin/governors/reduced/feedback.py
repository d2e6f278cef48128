"""How a reference acts through the thruster feedback: a force in R³, and back with the least change of the reference.

Both control laws (:class:`~harpy_pin.governors.reduced.point_mass.Law`) act through
F = m (r̂ r̂ᵀ (k_r e + d_r ė) + (I − Y)(k_t e + d_t ė)), with gains per mass
along the leg (r) and across it (t). The contact force and the acceleration are affine in F:

    projected       u_gz = r̂_z (m g r̂_z + r̂ᵀF)    m c̈ = F + (I − Y) m g
    full            u_gz = r̂_z (m g r̂_z − r̂ᵀF)    m c̈ = (I − Y)(F + m g)
"""

from __future__ import annotations

import numpy as np

from harpy_pin import checks
from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError
from harpy_pin.governors.reduced.point_mass import Law
from harpy_pin.model.entry import all_possible
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.state import Vector
from harpy_pin.model.thrust import CentreGains

__all__ = ["acceleration", "direction", "feedback", "feedback_record", "finite", "lift"]


class FeedbackRecord(RecordOf):
    """Model and control law, for the kernels of this module.

    Attributes:
        mass: m, kg.
        g: magnitude of gravity, m/s².
        full: whether it is the full control law.
        k_r, d_r: gains per mass along the leg, 1/s² and 1/s.
        k_t, d_t: likewise across it.
    """

    mass: float
    g: float
    full: int
    k_r: float
    d_r: float
    k_t: float
    d_t: float


def feedback_record(*, mass: float, g: float, gains: CentreGains | None, law: Law) -> Records[FeedbackRecord]:
    """A new :class:`FeedbackRecord`.

    Raises:
        InputError: a number out of its domain, gains that differ between the axes, or no gain along or across the leg.
    """
    chosen = gains if gains is not None else CentreGains()
    given = chosen.record[0]
    if np.ptp(given["k_pt"]) != 0.0 or np.ptp(given["k_dt"]) != 0.0:
        raise InputError("this governor needs gains that are the same along every axis", name="gains", value=chosen)
    mass = checks.number("mass", mass, low=0.0, strict=True)
    across = (given["k_pt"][0] / mass, given["k_dt"][0] / mass)
    along = (given["k_pr"], given["k_dr"]) if law is Law.PROJECTED else across
    if along[0] ** 2 + along[1] ** 2 == 0.0 or across[0] ** 2 + across[1] ** 2 == 0.0:
        raise InputError("with these gains the reference has no effect along or across the leg", name="gains")
    return make_record(
        FeedbackRecord,
        mass=mass,
        g=checks.number("g", g, low=0.0, strict=True),
        full=law is Law.FULL,
        k_r=along[0],
        d_r=along[1],
        k_t=across[0],
        d_t=across[1],
    )


@kernel(x=(9,), r_hat=(3,))
def direction(x: Vector, r_hat: Vector) -> float:
    """r̂ into ``r_hat``; returns L = |c − u|, m."""
    for i in range(3):
        r_hat[i] = x[i] - x[6 + i]
    length: float = np.sqrt(r_hat[0] ** 2 + r_hat[1] ** 2 + r_hat[2] ** 2)
    for i in range(3):
        r_hat[i] /= max(length, 1e-12)
    return length


@kernel(x=(9,), w=(6,), r_hat=(3,), out=(3,))
def feedback(x: Vector, w: Vector, r_hat: Vector, model: FeedbackRecord, out: Vector) -> None:
    """F of a reference [c_w; ċ_w] at the state [c; ċ; u], N; ``model``: element of :func:`feedback_record`."""
    e_along, v_along = 0.0, 0.0
    for i in range(3):
        e_along += r_hat[i] * (w[i] - x[i])
        v_along += r_hat[i] * (w[3 + i] - x[3 + i])
    along = (model.k_r - model.k_t) * e_along + (model.d_r - model.d_t) * v_along
    for i in range(3):
        across = model.k_t * (w[i] - x[i]) + model.d_t * (w[3 + i] - x[3 + i])
        out[i] = model.mass * (across + r_hat[i] * along)


@kernel(change=(3,), r_hat=(3,), w=(6,))
def lift(change: Vector, r_hat: Vector, model: FeedbackRecord, w: Vector) -> None:
    """Move a reference, by the least norm of [c_w; ċ_w], so that F changes by ``change``, N."""
    along = 0.0
    for i in range(3):
        along += r_hat[i] * change[i]
    squared_r = model.mass * (model.k_r**2 + model.d_r**2)
    squared_t = model.mass * (model.k_t**2 + model.d_t**2)
    for i in range(3):
        part = r_hat[i] * along
        rest = change[i] - part
        w[i] += model.k_r * part / squared_r + model.k_t * rest / squared_t
        w[3 + i] += model.d_r * part / squared_r + model.d_t * rest / squared_t


@kernel(force=(3,), r_hat=(3,), out=(3,))
def acceleration(force: Vector, r_hat: Vector, model: FeedbackRecord, out: Vector) -> None:
    """c̈ under F, m/s²."""
    g, mass = model.g, model.mass
    along = -g * r_hat[2]
    if model.full:
        for i in range(3):
            along += r_hat[i] * force[i] / mass
    for i in range(3):
        out[i] = force[i] / mass - r_hat[i] * along
    out[2] -= g


@kernel(x=("n",), x_r=("m",))
def finite(x: Vector, x_r: Vector, dt: float) -> bool:
    """Whether a measured state and a target have the right sizes and possible numbers, and dt is a time."""
    if x.shape != (9,) or x_r.shape != (6,) or not 0.0 <= dt < np.inf:
        return False
    return all_possible(x) and all_possible(x_r)
