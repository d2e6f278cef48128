"""How slow thrusters may be: a linear argument, beside that of :mod:`harpy_pin.controllers.delay_margins`.

An acceleration is commanded by −k_p e − k_d ė, as the tasks of whole-body controllers and the paper's thruster feedback
do, and only thrusts can give it. These follow by a first-order lag T. The closed loop is then

    s² (T s + 1) + (k_d s + k_p) e^(−s h/2) = 0,

with half a period h for the hold. To first order in h this is a cubic, and the criterion of Routh and Hurwitz says up
to which T it is stable. Where legs and contact forces give what thrusts do not give yet, walks bear more.
"""

from __future__ import annotations

from harpy_pin import checks

__all__ = ["pd_lag_margin"]


def pd_lag_margin(k_p: float, k_d: float, *, period: float = 0.0) -> float:
    """Largest lag T up to which the loop is stable; k_d/k_p where nothing is held.

    Args:
        k_p: 1/s².
        k_d: 1/s.
        period: h, between ticks, s; zero for a command that is never held.

    Returns:
        The margin, s: exact without a hold, and with one to first order in it; never below zero.

    Raises:
        InputError: a value out of its domain.
    """
    k_p = checks.number("k_p", k_p, low=0.0, strict=True)
    k_d = checks.number("k_d", k_d, low=0.0)
    half = 0.5 * checks.number("period", period, low=0.0)
    square, linear = 1.0 - half * k_d, k_d / k_p - half
    return square * linear if square > 0.0 and linear > 0.0 else 0.0
