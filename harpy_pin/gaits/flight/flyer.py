"""What every flight of a robot has in common: its postures, the feedback in the air, and what its thrusters have to
spare."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
import pinocchio as pin

from harpy_pin.errors import InputError
from harpy_pin.gaits.flight.balance import GRAVITY, Balance
from harpy_pin.gaits.flight.paths import Quintic
from harpy_pin.gaits.flight.postures import AirPostures
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__: list[str] = []

REACH = 0.25
"""How much longer than in standing the legs are in the air, in heights of the body."""
LEGS = 0.3
"""Time after lift-off from which on legs are so, s."""
SPARE, LEAST_SPARE = 0.5, 1.0
"""Share that rising and braking use of what thrusters can do beyond the weight, and the least that there must be,
m/s²."""
MOST_BRAKE = 8.0
"""Largest acceleration with which flights rise and are braked, m/s²."""
SIDE = 0.82
"""Share of a free thruster's limit that whole-body controllers use upwards (``lateral_thrust``)."""
TOUCHDOWN, ABOVE = 0.1, 0.03
"""Speed at which feet meet the ground, m/s, and height above it from which on they have it, m."""
LED = 0.35
"""Share of the thrusts' lag with which they follow the plan, where their commands lead as far as limits allow."""
BEND = 2.5
"""Duration of a crouch, in √(height / g)."""


@dataclass(frozen=True)
class TakeOff:
    """What the body does on the ground before a flight, from standing.

    Attributes:
        bend: into the posture from which it leaves.
        push: from there to the release; None where thrusters take the load off the feet.
    """

    bend: Quintic
    push: Quintic | None


class Flyer:
    """A robot that flies.

    Args:
        robot: with feet, and thrusters or rotors.
        q: (nq,) configuration in which it stands, upright and facing x.

    Attributes:
        height: of the body in standing, m.
        scale: √(height / g), s.
        brake: acceleration upwards that flights use beyond the weight, m/s².
        lag: with which thrusts follow the jumps' plan, s; zero unless :meth:`expect_lag` says otherwise.
        postures: in the air.
        air: (nq,) that of landing.
        feet: (3,) middle of the feet in it, about the body's origin, m.
        stand: (3,) likewise in standing.
        over: (3,) likewise, below the centre of mass.
        balance: in the air.

    Raises:
        InputError: thrusters do not carry the robot, or its legs do not reach as far as flights need.
    """

    def __init__(self, robot: Robot, q: Vector) -> None:
        self.robot, self.height = robot, float(q[2])
        spare = thrust_upwards(robot) / robot.mass - GRAVITY
        if spare < LEAST_SPARE:
            message = f"thrusters of '{robot.name}' must carry it with {LEAST_SPARE:g} m/s² to spare, have {spare:.2g}"
            raise InputError(message, name="robot", value=robot)
        self.brake, self.scale = min(SPARE * spare, MOST_BRAKE), sqrt(self.height / GRAVITY)
        self.postures = AirPostures(robot, q)
        self.air = self.postures.find(REACH * self.height)
        self.feet: Vector = self.postures.places(self.air).mean(axis=0)
        self.stand: Vector = self.postures.feet.mean(axis=0)
        centre = pin.centerOfMass(robot.model, robot.model.createData(), q) - q[:3]
        self.over: Vector = np.array((centre[0], centre[1], self.stand[2]))
        self.balance = Balance(robot, self.air)
        self._gains = {1.0: self.balance.gain}
        self.lag = 0.0

    def expect_lag(self, lag: float) -> bool:
        """Plan for thrusts that lag under a controller that knows it.

        Args:
            lag: time constant of the thrusts, s.

        Returns:
            Whether this is new.
        """
        before, self.lag = self.lag, LED * lag
        return self.lag != before

    def gain(self, weight: float) -> Vector:
        """Feedback where thrusters carry the weight so many times.

        Args:
            weight: of the robot, in weights at rest.
        """
        if weight not in self._gains:
            self._gains[weight] = Balance(self.robot, self.air, weight=weight).gain
        return self._gains[weight]

    def legs(self, joints: Vector, duration: float) -> Quintic:
        """Angles of the joints, from what they are to those of landing.

        Args:
            joints: (2, n) angles and rates.
            duration: s.
        """
        rest = np.zeros((2, joints.shape[1]))
        return Quintic(np.vstack((joints, rest[:1])), np.vstack((self.air[7:], rest)), duration)


def thrust_upwards(robot: Robot) -> float:
    """Force upwards that the thrusters of an upright robot can give together, N."""
    free = len(robot.thrusters) - len(robot.rotors)
    rotors = sum(rotor.limit[1] * abs(rotor.axis[2]) for rotor in robot.rotors)
    return rotors + (free * robot.thrust_limit * SIDE if free else 0.0)
