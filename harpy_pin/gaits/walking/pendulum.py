"""The linear inverted pendulum about a centre of pressure, c̈ = ω² (c − p), in closed form, one coordinate at a time.

Its *divergent component of motion* ξ = c + ċ/ω (the capture point) runs away from p: ξ(t) = p + (ξ(0) − p) exp(ω t). In
a walk that goes on for ever with steps of duration T, ξ has at each touchdown the same offset from the foot that lands
(Englsberger, Ott and Albu-Schäffer 2015): for a way L per step b = L / (exp(ω T) − 1), and for a support that jumps by
D, forth and back, b = D / (exp(ω T) + 1).
"""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel

__all__: list[str] = []


@kernel
def predict(place: float, velocity: float, pressure: float, omega: float, time: float) -> tuple[float, float]:
    """Place (m) and velocity (m/s) after a time.

    Args:
        place: c, m.
        velocity: ċ, m/s.
        pressure: p, which stays, m.
        omega: ω, 1/s.
        time: s.
    """
    grow, fall = np.exp(omega * time), np.exp(-omega * time)
    cosh, sinh = 0.5 * (grow + fall), 0.5 * (grow - fall)
    x = place - pressure
    return pressure + cosh * x + sinh / omega * velocity, omega * sinh * x + cosh * velocity


@kernel
def cyclic_offset(way: float, jump: float, growth: float) -> float:
    """Offset of ξ from a foot that lands, in a walk that goes on for ever, m.

    Args:
        way: L per step, m.
        jump: D from this support to the next, in the frame that moves with the walk, m.
        growth: exp(ω T).
    """
    return float(way / (growth - 1.0) + jump / (growth + 1.0))


@kernel
def toward(
    place: float, velocity: float, acceleration: float, goal: float, left: float, step: float
) -> tuple[float, float, float]:
    """Place, velocity and acceleration after a time on the quintic that ends at rest at the goal after the time left.

    Once it is over, they are the goal's.
    """
    if step >= left:
        return goal, 0.0, 0.0
    s, way, glide, bend = step / left, goal - place, velocity * left, 0.5 * acceleration * left * left
    third = 10.0 * way - 6.0 * glide - 3.0 * bend
    fourth = -15.0 * way + 8.0 * glide + 3.0 * bend
    fifth = 6.0 * way - 3.0 * glide - bend
    return (
        place + s * (glide + s * (bend + s * (third + s * (fourth + s * fifth)))),
        (glide + s * (2.0 * bend + s * (3.0 * third + s * (4.0 * fourth + s * 5.0 * fifth)))) / left,
        (2.0 * bend + s * (6.0 * third + s * (12.0 * fourth + s * 20.0 * fifth))) / (left * left),
    )
