"""One flight from lift-off to touchdown: where body and legs should be, and the feedback that brings them there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from harpy_pin.gaits.flight.balance import Balance
from harpy_pin.gaits.flight.paths import Fall, Quintic
from harpy_pin.model.state import Vector

__all__: list[str] = []

FARTHEST = 0.1
"""Error of the place to which the feedback answers at most, m."""


@dataclass(frozen=True)
class Airway:
    """A flight as functions of the time since lift-off.

    Attributes:
        over: horizontal ways of the body, one after the other.
        height: of the body.
        legs: angles of the joints.
        gains: feedback and the time until which it is the one, s.
        sinks: time from which on a foot that is loaded has landed, s.
    """

    over: tuple[Quintic, ...]
    height: Fall | tuple[Quintic, ...]
    legs: Quintic
    gains: tuple[tuple[float, Vector], ...]
    sinks: float

    def body(self, t: float) -> Vector:
        """(3, 3) place, velocity and acceleration of the body's origin.

        Args:
            t: time since lift-off, s.
        """
        height = np.array(self.height.at(t)) if isinstance(self.height, Fall) else along(self.height, t)[:, 0]
        return np.column_stack((along(self.over, t), height))

    def acceleration(self, t: float, q: Vector, v: Vector, balance: Balance) -> Vector:
        """(nv,) generalised acceleration that leads to the way.

        Args:
            t: time since lift-off, s.
            q: (nq,) measured configuration.
            v: (nv,) measured velocity.
            balance: whose thrusts and joints give it.
        """
        body, legs = self.body(t), self.legs.at(t)
        goal = np.concatenate((body[0], (0.0, 0.0, 0.0, 1.0), legs[0]))
        away = pin.difference(balance.robot.model, goal, q)
        away[:3] = np.clip(away[:3], -FARTHEST, FARTHEST)
        still = np.zeros(3)
        error = np.concatenate((away, v - np.concatenate((body[1], still, legs[1]))))
        gain = next((gain for end, gain in self.gains if t < end), self.gains[-1][1])
        return balance.reachable(q, v, np.concatenate((body[2], still, legs[2])) + gain @ error)


def along(ways: tuple[Quintic, ...], t: float) -> Vector:
    """(3, n) on ways that follow each other."""
    for way in ways[:-1]:
        if t < way.duration:
            return way.at(t)
        t -= way.duration
    return ways[-1].at(t)
