"""Gaits as parts of a scenario."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.commanded import check_script, make_commanded_gait
from harpy_pin.gaits.flight.flights import Flight, Jump, flight_entry, read_flights
from harpy_pin.gaits.flight.flying_gait import FlyingGait
from harpy_pin.gaits.gait import Gait
from harpy_pin.gaits.hovering import Hovering
from harpy_pin.gaits.named_gaits import make_named_gait
from harpy_pin.gaits.standing import Standing
from harpy_pin.gaits.stepping import Stepping
from harpy_pin.gaits.walking.schedules import BY_FEET, FOUR_FEET, TWO_FEET
from harpy_pin.gaits.walking.velocity import is_sequence, read_velocity
from harpy_pin.gaits.walking.walking_gait import WalkingGait
from harpy_pin.model.catalogue import CATALOGUE, check_robot_name
from harpy_pin.model.robot import Robot
from harpy_pin.scenario.parts import Part
from harpy_pin.simulation.ground import MAX_STIFFNESS

__all__ = [
    "GAIT_PARTS",
    "Commanded",
    "Flying",
    "GaitPart",
    "Hover",
    "Optimised",
    "PaperCurves",
    "Stand",
    "StepInPlace",
    "Straight",
    "Walking",
    "gaits_of",
]

_NOT_WALKING = ("solo8",)
"""Robots whose legs have too few joints to place their feet."""
_WITH_PARAMETERS = (FlyingGait, Standing, Stepping, WalkingGait)
"""Gaits that have settings of controllers."""
MAX_SPEED = 100.0
"""m/s: far beyond what any walker does, and far from numbers that overflow."""


@dataclass(frozen=True, kw_only=True)
class GaitPart(Part):
    """A gait of a scenario."""

    @abstractmethod
    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """The gait.

        Args:
            robot: that walks.
            stiffness: of the ground as the feet feel it, N/m.
        """

    def controller_parameters(self, gait: Gait) -> Mapping[str, Any]:
        """Settings of a controller that fit the gait and the weight of its robot."""
        fitting: Mapping[str, Any] = gait.parameters if isinstance(gait, _WITH_PARAMETERS) else {}
        return fitting


@dataclass(frozen=True, kw_only=True)
class _AlongX(GaitPart):
    """Harpy walks along x.

    Attributes:
        speed: m/s; zero stands on both feet.
    """

    speed: float = 0.3

    def __post_init__(self) -> None:
        checks.keep(self, speed=checks.number("speed", self.speed, low=-MAX_SPEED, high=MAX_SPEED))

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`GaitPart`."""
        return make_named_gait(robot, self.name, speed=self.speed, stiffness=stiffness)


@dataclass(frozen=True, kw_only=True)
class Straight(_AlongX):
    """Harpy's walk of few parameters along x, tuned for little slip.

    Attributes:
        speed: m/s; zero stands on both feet.
        stiffness: of the ground that the walk is for, N/m; that of the scenario's ground by default.
    """

    name = "hand"
    stiffness: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.keep(self, stiffness=_checked_stiffness(self.stiffness))

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`GaitPart`."""
        return super().make(robot, stiffness if self.stiffness is None else self.stiffness)


@dataclass(frozen=True, kw_only=True)
class Optimised(_AlongX):
    """A planar gait of Harpy that walks without thrust, refined for the governed walk in space.

    Attributes:
        speed: m/s: 0.3, or zero to stand.
    """

    name = "optimised"


@dataclass(frozen=True, kw_only=True)
class PaperCurves(_AlongX):
    """A gait of Harpy with the paper's own shape of curves, in space as the paper prints it.

    Attributes:
        speed: m/s: 0.3, or zero to stand.
    """

    name = "paper-curves"


@dataclass(frozen=True, kw_only=True)
class Commanded(GaitPart):
    """Harpy goes where it is told, under a whole-body controller.

    Attributes:
        velocity: (forward, sideways, turning) in m/s, m/s and rad/s, in the frame of the heading; or rows (t, forward,
            sideways, turning), each valid from its time t, s, on. Kept as rows.
        stiffness: of the ground that the walk is for, N/m; that of the scenario's ground by default.
    """

    name = "commanded"
    velocity: Sequence[float] | Sequence[Sequence[float]] = ((0.0, 0.3, 0.0, 0.0),)
    stiffness: float | None = None

    def __post_init__(self) -> None:
        rows = self.velocity.tolist() if isinstance(self.velocity, np.ndarray) else self.velocity
        if (
            isinstance(rows, Sequence)
            and len(rows) == 3
            and not any(isinstance(row, Sequence | np.ndarray) for row in rows)
        ):
            rows = ((0.0, *rows),)
        script = check_script(rows)
        if not script:
            raise InputError("a command needs at least one row of (t, forward, sideways, turning)", name="velocity")
        checks.keep(self, velocity=script)
        checks.keep(self, stiffness=_checked_stiffness(self.stiffness))

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`GaitPart`."""
        stiffness = stiffness if self.stiffness is None else self.stiffness
        return make_commanded_gait(robot, check_script(self.velocity), stiffness=stiffness)


@dataclass(frozen=True, kw_only=True)
class Flying(GaitPart):
    """Harpy jumps or flies, lands, and goes on where it is told, see :class:`harpy_pin.gaits.FlyingGait`.

    Attributes:
        flights: :class:`~harpy_pin.gaits.Jump` and :class:`~harpy_pin.gaits.Fly`, one or several, also as the mappings
            that files have.
        velocity: what it does after the last landing, as that of :class:`Commanded`; it stands by default.
        start: for how long it stands before each flight, s.
    """

    name = "flying"
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
        """See :class:`GaitPart`."""
        walk = make_commanded_gait(robot, check_script(self.velocity), stiffness=stiffness)
        return FlyingGait(walk, self.flights, start=self.start)


@dataclass(frozen=True, kw_only=True)
class Walking(GaitPart):
    """A robot of the catalogue with two or four feet walks where it is told, see :class:`harpy_pin.gaits.WalkingGait`.

    Attributes:
        schedule: ``trot`` (default), ``crawl``, ``pace`` or ``bound`` on four feet, ``walk`` (default) or ``step`` on
            two, or ``stand``.
        velocity: (forward, sideways, turning[, height]) in m/s, m/s, rad/s and m, in the frame of the heading; or rows
            with a time t, s, before these, each valid from then on. Kept as rows. By default 0.3 m/s forward, 0.15 m/s
            on flat feet.
    """

    name = "walking"
    schedule: str | None = None
    velocity: Sequence[float] | Sequence[Sequence[float]] | None = None

    def __post_init__(self) -> None:
        if self.schedule is not None:
            checks.one_of("schedule", self.schedule, ("stand", *FOUR_FEET, *TWO_FEET))
        if self.velocity is not None:
            first, rows, _ = read_velocity(_rows(self.velocity))
            script = rows or ((0.0, first),)
            checks.keep(self, velocity=tuple((t, *command.tolist()) for t, command in script))

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`GaitPart`."""
        slow = (0.15 if robot.flat_feet else 0.3, 0.0, 0.0)
        return WalkingGait(robot, self.schedule, slow if self.velocity is None else self.velocity)


@dataclass(frozen=True, kw_only=True)
class _OfRobot(GaitPart):
    """A gait that the robot alone decides."""

    kind: ClassVar[type[Standing | Stepping | Hovering]]

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`GaitPart`."""
        return self.kind(robot)


class Stand(_OfRobot):
    """A robot of the catalogue stands on all its feet, see :class:`harpy_pin.gaits.Standing`."""

    name, kind = "standing", Standing


class StepInPlace(_OfRobot):
    """A robot on two points steps in place, see :class:`harpy_pin.gaits.Stepping`."""

    name, kind = "stepping", Stepping


class Hover(_OfRobot):
    """A robot without feet hovers, see :class:`harpy_pin.gaits.Hovering`."""

    name, kind = "hovering", Hovering


GAIT_PARTS: dict[str, type[GaitPart]] = {
    kind.name: kind
    for kind in (Straight, Optimised, PaperCurves, Commanded, Flying, Walking, Stand, StepInPlace, Hover)
}
"""The gaits of a scenario by name."""


@checked
def gaits_of(robot: str) -> tuple[str, ...]:
    """Names of the gaits that a robot has; the first one is its default.

    Args:
        robot: ``harpy``, or a robot of the catalogue.

    Raises:
        InputError: there is no such robot.
    """
    check_robot_name(robot)
    if robot == "harpy":
        return (Straight.name, Optimised.name, PaperCurves.name, Commanded.name, Flying.name)
    known = CATALOGUE[robot]
    if not known.feet:
        return (Hover.name,)
    walks = (Walking.name,) if len(known.feet) in (2, 4) and robot not in _NOT_WALKING else ()
    steps = (StepInPlace.name,) if len(known.feet) == 2 and not known.flat_feet else ()
    return (*walks, *steps, Stand.name)


def schedules_of(robot: str) -> tuple[str, ...]:
    """Names of the schedules that a robot of the catalogue can walk by; the first one is its default."""
    return (*BY_FEET.get(len(CATALOGUE[robot].feet), {}), "stand")


def why_not(robot: str, gait: object) -> str:
    """Why a robot has not a gait, where that is not plain."""
    if gait == Walking.name and robot in _NOT_WALKING:
        return f"'{robot}' has two joints in each leg, and cannot place its feet to the side"
    return ""


def _checked_stiffness(value: float | None) -> float | None:
    """A stiffness, N/m, or none."""
    return None if value is None else checks.number("stiffness", value, low=0.0, high=MAX_STIFFNESS, strict=True)


def _rows(velocity: Any) -> Any:
    """A velocity, or rows of them.

    Raises:
        InputError: it is neither.
    """
    if not is_sequence(velocity) or not len(velocity):
        message = f"velocity must be (forward, sideways, turning) or rows of (t, ...), got {shown(velocity)}"
        raise InputError(message, name="velocity", value=velocity)
    return velocity
