"""How a reference acts through the thruster law: a force in R³, and back with the least change of the reference.

Both laws (:class:`~harpy_pin.governor.reduced.model.Law`) act through
F = m (r̂ r̂ᵀ (k_r e + d_r ė) + (I − Y)(k_t e + d_t ė)), with gains per mass
along the leg (r) and across it (t). The contact force and the acceleration are affine in F:

    projected law   u_gz = r̂_z (m g r̂_z + r̂ᵀF)    m c̈ = F + (I − Y) m g
    full law        u_gz = r̂_z (m g r̂_z − r̂ᵀF)    m c̈ = (I − Y)(F + m g)
"""

from __future__ import annotations

import numpy as np
from numba import njit

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.governor.reduced.model import Law
from harpy_pin.model.state import Vector
from harpy_pin.model.thrust import CentreGains

__all__ = ["acceleration", "feedback", "lift", "pack_model"]

MODEL = 7
"""Numbers of :func:`pack_model`: mass, g, law, k_r, d_r, k_t, d_t."""


def pack_model(*, mass: float, g: float, gains: CentreGains | None, law: Law) -> Vector:
    """(7,) mass (kg), g (m/s²), law, and the gains per mass k_r, d_r, k_t, d_t (1/s² and 1/s).

    Raises:
        InputError: a number out of its domain, gains that differ between the axes, or no gain along or across the leg.
    """
    chosen = gains if gains is not None else CentreGains()
    packed = chosen.packed
    if np.ptp(packed[:3]) != 0.0 or np.ptp(packed[3:6]) != 0.0:
        raise InputError("this governor needs gains that are the same along every axis", name="gains", value=chosen)
    mass = checks.number("mass", mass, low=0.0, strict=True)
    across = (packed[0] / mass, packed[3] / mass)
    along = (packed[6], packed[7]) if law is Law.PROJECTED else across
    if along[0] ** 2 + along[1] ** 2 == 0.0 or across[0] ** 2 + across[1] ** 2 == 0.0:
        raise InputError("with these gains the reference has no effect along or across the leg", name="gains")
    return np.array([mass, checks.number("g", g, low=0.0, strict=True), float(law), *along, *across])


@njit(cache=True)
def direction(x, r_hat):  # type: ignore[no-untyped-def]
    """r̂ into ``r_hat``; returns L = |c − u|, m."""
    for i in range(3):
        r_hat[i] = x[i] - x[6 + i]
    length = np.sqrt(r_hat[0] ** 2 + r_hat[1] ** 2 + r_hat[2] ** 2)
    for i in range(3):
        r_hat[i] /= max(length, 1e-12)
    return length


@njit(cache=True)
def feedback(x, w, r_hat, model, out):  # type: ignore[no-untyped-def]
    """F of a reference [c_w; ċ_w] at the state [c; ċ; u], N."""
    e_along, v_along = 0.0, 0.0
    for i in range(3):
        e_along += r_hat[i] * (w[i] - x[i])
        v_along += r_hat[i] * (w[3 + i] - x[3 + i])
    along = (model[3] - model[5]) * e_along + (model[4] - model[6]) * v_along
    for i in range(3):
        across = model[5] * (w[i] - x[i]) + model[6] * (w[3 + i] - x[3 + i])
        out[i] = model[0] * (across + r_hat[i] * along)


@njit(cache=True)
def lift(change, r_hat, model, w):  # type: ignore[no-untyped-def]
    """Move a reference, by the least norm of [c_w; ċ_w], so that F changes by ``change``, N."""
    along = 0.0
    for i in range(3):
        along += r_hat[i] * change[i]
    squared_r = model[0] * (model[3] ** 2 + model[4] ** 2)
    squared_t = model[0] * (model[5] ** 2 + model[6] ** 2)
    for i in range(3):
        part = r_hat[i] * along
        rest = change[i] - part
        w[i] += model[3] * part / squared_r + model[5] * rest / squared_t
        w[3 + i] += model[4] * part / squared_r + model[6] * rest / squared_t


@njit(cache=True)
def acceleration(force, r_hat, model, out):  # type: ignore[no-untyped-def]
    """c̈ under F, m/s²."""
    g, mass = model[1], model[0]
    along = -g * r_hat[2]
    if model[2] != 0.0:
        for i in range(3):
            along += r_hat[i] * force[i] / mass
    for i in range(3):
        out[i] = force[i] / mass - r_hat[i] * along
    out[2] -= g


@njit(cache=True)
def finite(x, x_r):  # type: ignore[no-untyped-def]
    """Whether a measured state and a target hold numbers only."""
    s = 0.0
    for i in range(9):
        s += x[i]
    for i in range(6):
        s += x_r[i]
    return np.isfinite(s)
