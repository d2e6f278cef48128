"""Flights as they are planned before the first one: jumps that land where they should, and ways by thrust."""

from __future__ import annotations

from collections.abc import Sequence

from harpy_pin.gaits.flight.airway import Airway
from harpy_pin.gaits.flight.flights import Flight, Fly
from harpy_pin.gaits.flight.flyer import Flyer, TakeOff
from harpy_pin.gaits.flight.jumping import Throw, crouch_and_push, fly_jump, plan_jump
from harpy_pin.gaits.flight.lifting import lift, stretch
from harpy_pin.model.state import Vector

__all__: list[str] = []


class PlannedFlights:
    """The flights of a robot.

    Args:
        flyer: who flies.
        flights: what is asked for.

    Raises:
        InputError: a jump that does not land where it should.
    """

    def __init__(self, flyer: Flyer, flights: Sequence[Flight]) -> None:
        self._flyer, self._flights = flyer, flights
        self._plan()

    def _plan(self) -> None:
        self._plans: list[Fly | Throw] = [
            flight if isinstance(flight, Fly) else plan_jump(self._flyer, flight) for flight in self._flights
        ]

    def expect_lag(self, lag: float) -> None:
        """Plan for thrusts that lag under a controller that knows it; see :class:`PlannedFlights`.

        Args:
            lag: time constant of the thrusts, s.
        """
        if self._flyer.expect_lag(lag):
            self._plan()

    def take_off(self, k: int, feet: Vector) -> TakeOff:
        """From standing to where a flight leaves the ground.

        Args:
            k: which flight.
            feet: (3,) middle of the feet on the ground, m.
        """
        plan = self._plans[k]
        return stretch(self._flyer, feet) if isinstance(plan, Fly) else crouch_and_push(self._flyer, plan, feet)

    def airway(self, k: int, body: Vector, joints: Vector, feet: Vector, ground: float) -> Airway:
        """From there to touchdown.

        Args:
            k: which flight.
            body: (2, 3) place and velocity of the body as it leaves the ground.
            joints: (2, n) angles and rates of the joints there.
            feet: (3,) middle of the feet on the ground before, m.
            ground: height where they land, m.
        """
        plan = self._plans[k]
        if isinstance(plan, Fly):
            return lift(self._flyer, plan, joints, feet, ground)
        return fly_jump(self._flyer, plan, body, joints, feet, ground)
