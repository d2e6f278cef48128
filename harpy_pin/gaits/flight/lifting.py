"""Flights by thrust: up, over, hover, down, and the last of the way at the speed of touchdown."""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from harpy_pin.gaits.flight.airway import Airway
from harpy_pin.gaits.flight.flights import Fly
from harpy_pin.gaits.flight.flyer import ABOVE, BEND, LEGS, TOUCHDOWN, Flyer, TakeOff
from harpy_pin.gaits.flight.paths import SWIFT, Quintic, rest
from harpy_pin.model.state import Vector

__all__: list[str] = []

SHORTEST = 0.4
"""Of a way, s."""


def stretch(flyer: Flyer, feet: Vector) -> TakeOff:
    """Legs become as long as in the air; the centre of mass comes where thrusters can carry it.

    Args:
        flyer: who flies.
        feet: (3,) middle of the feet on the ground, m.
    """
    return TakeOff(Quintic(rest(feet - flyer.stand), rest(feet - flyer.feet), 2.0 * BEND * flyer.scale), None)


def lift(flyer: Flyer, flight: Fly, joints: Vector, feet: Vector, ground: float) -> Airway:
    """From lift-off to touchdown.

    Args:
        flyer: who flies.
        flight: which.
        joints: (2, n) angles and rates at lift-off.
        feet: (3,) middle of the feet on the ground before, m.
        ground: height where they land, m.
    """
    begin = feet - flyer.feet
    top = max(float(feet[2]), ground) + flight.height - float(flyer.feet[2])
    end = np.array((ground + ABOVE - float(flyer.feet[2]),))
    above, slow = np.array((top,)), np.array(((0.0,), (-TOUCHDOWN,), (0.0,)))
    over = _swift(begin[:2], begin[:2] + np.array((flight.forward, flight.left)), flight.acceleration)
    up = _swift(begin[2:], above, flyer.brake)
    slow[0] = end
    down = Quintic(rest(above), slow, _swift(above, end, 0.5 * flyer.brake).duration)
    heights = (up, _stay(above, over.duration + flight.hover), down)
    legs = flyer.legs(joints, LEGS)
    sinks = up.duration + heights[1].duration + 0.5 * down.duration
    return Airway((_stay(begin[:2], up.duration), over), heights, legs, ((inf, flyer.gain(1.0)),), sinks)


def _stay(place: Vector, duration: float) -> Quintic:
    return Quintic(rest(place), rest(place), duration)


def _swift(begin: Vector, end: Vector, acceleration: float) -> Quintic:
    """From rest to rest with so much acceleration at most."""
    way = float(np.linalg.norm(end - begin))
    return Quintic(rest(begin), rest(end), max(sqrt(SWIFT * way / acceleration), SHORTEST))
