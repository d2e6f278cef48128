"""What is flown: jumps by legs and thrust, and flights by thrust alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from harpy_pin import checks
from harpy_pin.errors import InputError, shown

__all__ = ["Fly", "Jump", "read_flights"]

HIGHEST, FARTHEST = 100.0, 1e4
"""m."""


@dataclass(frozen=True, kw_only=True)
class Jump:
    """Legs throw the body up, thrusters carry a part of its weight, brake its fall, and keep it upright.

    Attributes:
        height: by which the body rises after the feet have left the ground, m.
        forward: from where the feet leave the ground to where they touch it, m.
        left: the same to the left, m.
        carried: share of the weight that thrusters carry until they brake, 0.2 to 0.9.

    Raises:
        InputError: a value out of its domain.
    """

    height: float = 0.3
    forward: float = 0.0
    left: float = 0.0
    carried: float = 0.5

    def __post_init__(self) -> None:
        _check(self)
        checks.keep(self, carried=checks.number("carried share of the weight", self.carried, low=0.2, high=0.9))


@dataclass(frozen=True, kw_only=True)
class Fly:
    """Thrusters lift the robot, bring it to another place, hold it there, and set it down.

    Attributes:
        height: of the feet above the higher of the two places, m.
        forward: way to go, m.
        left: the same to the left, m.
        hover: time for which it stays above the place where it lands, s.
        acceleration: largest on the way, m/s².

    Raises:
        InputError: a value out of its domain.
    """

    height: float = 0.3
    forward: float = 0.0
    left: float = 0.0
    hover: float = 0.0
    acceleration: float = 1.0

    def __post_init__(self) -> None:
        _check(self)
        hover = checks.number("hover", self.hover, low=0.0, high=1e6)
        acceleration = checks.number("acceleration", self.acceleration, low=0.0, high=5.0, strict=True)
        checks.keep(self, hover=hover, acceleration=acceleration)


def _check(flight: Jump | Fly) -> None:
    """What both have."""
    height = checks.number("height", flight.height, low=0.02, high=HIGHEST)
    forward = checks.number("forward", flight.forward, low=-FARTHEST, high=FARTHEST)
    checks.keep(
        flight, height=height, forward=forward, left=checks.number("left", flight.left, low=-FARTHEST, high=FARTHEST)
    )


Flight = Jump | Fly
"""What is flown."""
KINDS: dict[str, type[Flight]] = {"jump": Jump, "fly": Fly}
"""By the names that files have."""


def read_flights(given: Any) -> tuple[Flight, ...]:
    """Flights from themselves, or from mappings as :func:`flight_entry` makes them.

    Args:
        given: one, or a sequence of them.

    Raises:
        InputError: something else, or none.
    """
    several = given if isinstance(given, list | tuple) else [given]
    flights = tuple(_read(one) for one in several)
    if not flights:
        raise InputError("flights must be at least one Jump or Fly", name="flights", value=given)
    return flights


def _read(value: Any) -> Flight:
    if isinstance(value, Jump | Fly):
        return value
    if isinstance(value, Mapping) and value.get("kind") in KINDS:
        try:
            return KINDS[str(value["kind"])](**{name: value[name] for name in value if name != "kind"})
        except TypeError as error:
            raise InputError(f"flight: {error}", name="flights", value=value) from None
    raise InputError(f"a flight must be a Jump or a Fly, got {shown(value)}", name="flights", value=value)


def flight_entry(flight: Flight) -> dict[str, Any]:
    """The flight for files."""
    kind = next(name for name, kind in KINDS.items() if isinstance(flight, kind))
    return {"kind": kind, **asdict(flight)}
