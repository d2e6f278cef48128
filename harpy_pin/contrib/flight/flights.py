"""What is flown: jumps by legs and thrust, and flights by thrust alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.scenario.parts import Part, read_part

__all__ = ["Flight", "Fly", "Jump", "read_flights"]

HIGHEST, FARTHEST = 100.0, 1e4
"""m."""


@dataclass(frozen=True, kw_only=True)
class Flight(Part):
    """What every flight has.

    Attributes:
        height: by which the body of a jump rises after the feet have left the ground, or at which the feet of a flight
            are above the higher of the two places, m.
        forward: from where the feet leave the ground to where they touch it, m.
        left: the same to the left, m.

    Raises:
        InputError: a value out of its domain.
    """

    height: float = 0.3
    forward: float = 0.0
    left: float = 0.0

    def __post_init__(self) -> None:
        checks.keep(self, height=checks.number("height", self.height, low=0.02, high=HIGHEST))
        for name in ("forward", "left"):
            checks.keep(self, **{name: checks.number(name, getattr(self, name), low=-FARTHEST, high=FARTHEST)})


@dataclass(frozen=True, kw_only=True)
class Jump(Flight):
    """Legs throw the body up, thrusters carry a part of its weight, brake its fall, and keep it upright.

    Attributes:
        carried: share of the weight that thrusters carry until they brake, 0.2 to 0.9.
    """

    name = "jump"
    carried: float = 0.5

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.keep(self, carried=checks.number("carried share of the weight", self.carried, low=0.2, high=0.9))


@dataclass(frozen=True, kw_only=True)
class Fly(Flight):
    """Thrusters lift the robot, bring it to another place, hold it there, and set it down.

    Attributes:
        hover: time for which it stays above the place where it lands, s.
        acceleration: largest on the way, m/s².
    """

    name = "fly"
    hover: float = 0.0
    acceleration: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        acceleration = checks.number("acceleration", self.acceleration, low=0.0, high=5.0, strict=True)
        checks.keep(self, hover=checks.number("hover", self.hover, low=0.0, high=1e6), acceleration=acceleration)


def read_flights(given: Any) -> tuple[Jump | Fly, ...]:
    """Flights from themselves, their names, or mappings as :meth:`Part.to_dict` makes them.

    Args:
        given: one, or a sequence of them.

    Raises:
        InputError: something else, or none.
    """
    several = given if isinstance(given, list | tuple) else [given]
    kinds: dict[str, type[Jump | Fly]] = {"jump": Jump, "fly": Fly}
    flights = tuple(read_part(kinds, "flight", one) for one in several)
    if not flights:
        raise InputError("flights must be at least one Jump or Fly", name="flights", value=given)
    return flights
