"""Flights as a part of a scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.contrib.flight.flights import Flight, Jump, flight_entry, read_flights
from harpy_pin.contrib.flight.flying_gait import FlyingGait
from harpy_pin.gaits.gait import Gait
from harpy_pin.ground.terrain import Terrain
from harpy_pin.model.robot import Robot
from harpy_pin.scenario.gait_parts import GAIT_PARTS, Commanded, GaitPart

__all__ = ["Flying"]


@dataclass(frozen=True, kw_only=True)
class Flying(GaitPart):
    """Harpy jumps or flies, lands, and goes on where it is told, see :class:`~harpy_pin.contrib.flight.FlyingGait`.

    Attributes:
        flights: jumps (:class:`~harpy_pin.contrib.flight.Jump`) and flights (:class:`~harpy_pin.contrib.flight.Fly`),
            one or several, also as the mappings that files have.
        velocity: what it does after the last landing, as that of :class:`~harpy_pin.scenario.Commanded`; it stands by
            default.
        start: for how long it stands before each flight, s.
    """

    name = "flying"
    extension = "harpy_pin.contrib.flight"
    not_governed = FlyingGait.not_governed
    flights: Flight | Sequence[Flight | Mapping[str, Any]] = (Jump(),)
    velocity: Sequence[float] | Sequence[Sequence[float]] = ((0.0, 0.0, 0.0, 0.0),)
    start: float = 0.5

    def __post_init__(self) -> None:
        checks.keep(self, flights=read_flights(self.flights), velocity=Commanded(velocity=self.velocity).velocity)
        checks.keep(self, start=checks.number("start", self.start, low=0.0, high=1e6))

    def to_dict(self) -> dict[str, Any]:
        """See :class:`~harpy_pin.scenario.parts.Part`."""
        flights = [flight_entry(flight) for flight in read_flights(self.flights)]
        return {**super().to_dict(), "flights": flights}

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`~harpy_pin.scenario.GaitPart`."""
        return FlyingGait(Commanded(velocity=self.velocity).make(robot, stiffness), self.flights, start=self.start)

    @checked
    def over(self, gait: Gait, terrain: Terrain, *, normal_error: float, friction: float) -> Gait:
        """See :class:`~harpy_pin.scenario.GaitPart`."""
        return checks.instance("gait", gait, FlyingGait).over(terrain, normal_error=normal_error)

    @checked
    def controller_parameters(self, gait: Gait) -> Mapping[str, Any]:
        """See :class:`~harpy_pin.scenario.GaitPart`."""
        return checks.instance("gait", gait, FlyingGait).parameters

    @classmethod
    @checked
    def fits(cls, robot: str) -> bool:
        """See :class:`~harpy_pin.scenario.GaitPart`."""
        return robot == "harpy"


GAIT_PARTS[Flying.name] = Flying
