"""Gaits as parts of a scenario."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from harpy_pin import checks, gaits
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.gaits.gait import Gait
from harpy_pin.gaits.velocity import is_sequence, read_velocity
from harpy_pin.gaits.walking.can_walk import SHORT_LEG, why_no_walk
from harpy_pin.gaits.walking.schedules import BY_FEET, SCHEDULES
from harpy_pin.ground.ground import MAX_STIFFNESS
from harpy_pin.ground.terrain import Terrain
from harpy_pin.model.catalogue import CATALOGUE
from harpy_pin.model.robot import Robot
from harpy_pin.model.source import named_robot
from harpy_pin.scenario.parts import Part

MAX_SPEED = 100.0  # m/s: far beyond what any walker does, and far from numbers that overflow


def read_rows(name: str, velocity: Any, entries: int) -> tuple[tuple[float, ...], ...]:
    """A velocity as rows of numbers; text may say them as ``VX VY W; Ts VX VY W; ...``."""
    if isinstance(velocity, str):
        velocity = [_row(part, first=k == 0) for k, part in enumerate(velocity.split(";"))]
    if not is_sequence(velocity) or not len(velocity):
        raise InputError(
            f"{name} must be (forward, sideways, turning) or rows of (t, ...), got "
            f"{shown(velocity)}",
            name=name,
            value=velocity,
        )
    first, rows, _ = read_velocity(velocity, entries)
    return tuple((t, *command.tolist()) for t, command in rows or ((0.0, first),))


def _row(text: str, *, first: bool) -> list[float]:
    """A row (t, forward, sideways, turning, ...) from ``Ts VX VY W``; the first one may leave its
    time out.
    """
    words = text.split()
    if first and words and not words[0].endswith("s"):
        words = ["0s", *words]
    try:
        if not words[0].endswith("s") or len(words) < 4:
            raise ValueError
        return [float(words[0][:-1]), *(float(word) for word in words[1:])]
    except (IndexError, ValueError):
        raise InputError(
            f"velocity must look like 'VX VY W; Ts VX VY W' (m/s, m/s, rad/s), got "
            f"'{text.strip()}'",
            name="velocity",
            value=text,
        ) from None


@dataclass(frozen=True, kw_only=True)
class GaitPart(Part):
    """A gait of a scenario.

    Attributes:
        not_governed: why the paper's controller cannot walk it; empty where it can.
        foot_counts: numbers of feet of other robots that have it; none where it is Harpy's.
        without: robots of so many feet that have it not.
    """

    not_governed: ClassVar[str] = ""
    foot_counts: ClassVar[tuple[int, ...]] = ()
    without: ClassVar[tuple[str, ...]] = ()

    @abstractmethod
    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """The gait.

        Args:
            robot: that walks.
            stiffness: of the ground as the feet feel it, N/m.
        """

    @checked
    def over(self, gait: Gait, terrain: Terrain, *, normal_error: float, friction: float) -> Gait:
        """The gait laid over ground that is not flat.

        Args:
            gait: that :meth:`make` has made.
            terrain: of the ground.
            normal_error: angle by which the normals are wrong, about y, rad.
            friction: coefficient that the controller assumes.
        """
        return gaits.OnTerrain(gait, terrain, normal_error=normal_error, friction=friction)

    @classmethod
    @checked
    def fits(cls, robot: str | Robot) -> bool:
        """Whether a robot has this gait.

        Args:
            robot: ``harpy``, one of the catalogue, or one's own.
        """
        if not cls.foot_counts:
            return robot == "harpy"
        return _feet(robot) in cls.foot_counts and robot not in cls.without


@dataclass(frozen=True, kw_only=True)
class Straight(GaitPart):
    """Harpy's walk of few parameters along x, tuned for little slip.

    Attributes:
        speed: m/s; zero stands on both feet.
        stiffness: of the ground that the walk is for, N/m; that of the scenario's ground by
            default.
    """

    name = "hand"
    speed: float = checks.setting(0.3, low=-MAX_SPEED, high=MAX_SPEED)
    stiffness: float | None = checks.setting(None, low=0.0, high=MAX_STIFFNESS, strict=True)

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`GaitPart`."""
        stiffness = stiffness if self.stiffness is None else self.stiffness
        return gaits.make_gait(robot, speed=self.speed, stiffness=stiffness)


@dataclass(frozen=True, kw_only=True)
class Commanded(GaitPart):
    """Harpy follows a velocity command, under a whole-body controller.

    Attributes:
        velocity: (forward, sideways, turning) in m/s, m/s and rad/s, in the frame of the heading;
            or rows (t, forward, sideways, turning), each valid from its time t, s, on; or as text,
            ``"0.3 0 0; 4s 0.2 0 0.5"``. Kept as rows.
    """

    name = "commanded"
    not_governed = gaits.CommandedGait.not_governed
    velocity: str | Sequence[float] | Sequence[Sequence[float]] = checks.setting(
        ((0.0, 0.3, 0.0, 0.0),), read_rows, entries=3
    )

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`GaitPart`."""
        return gaits.make_commanded_gait(robot, self.velocity, stiffness=stiffness)


@dataclass(frozen=True, kw_only=True)
class Walking(GaitPart):
    """A robot with two, four or six feet follows a velocity, see
    :class:`harpy_pin.gaits.WalkingGait`.

    Attributes:
        schedule: ``trot`` (default), ``crawl``, ``pace`` or ``bound`` on four feet, ``walk``
            (default) or ``step`` on two, or ``stand``.
        velocity: (forward, sideways, turning[, height]) in m/s, m/s, rad/s and m, in the frame of
            the heading; or rows with a time t, s, before these, each valid from then on; or as
            text, ``"0.3 0 0; 4s 0.2 0 0.5"``. Kept as rows. By default 0.3 m/s forward, 0.15 m/s on
            flat feet.
    """

    name = "walking"
    foot_counts = tuple(BY_FEET)
    without = ("solo8",)  # its legs have too few joints to place their feet
    schedule: str | None = checks.setting(None, checks.one_of, valid=("stand", *SCHEDULES))
    velocity: str | Sequence[float] | Sequence[Sequence[float]] | None = checks.setting(
        None, read_rows, entries=4
    )

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`GaitPart`."""
        slow = (0.15 if robot.flat_feet else 0.3, 0.0, 0.0)
        velocity = slow if self.velocity is None else self.velocity
        return gaits.WalkingGait(robot, self.schedule, velocity)


class Stand(GaitPart):
    """A robot stands on all its feet, see :class:`harpy_pin.gaits.Standing`."""

    name = "standing"
    foot_counts = (1, 2, 3, 4, 6)

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`GaitPart`."""
        return gaits.Standing(robot)


class Hover(GaitPart):
    """A robot without feet hovers, see :class:`harpy_pin.gaits.Hovering`."""

    name = "hovering"
    foot_counts = (0,)

    @checked
    def make(self, robot: Robot, stiffness: float) -> Gait:
        """See :class:`GaitPart`."""
        return gaits.Hovering(robot)


GAIT_PARTS: dict[str, type[GaitPart]] = {
    kind.name: kind for kind in (Straight, Commanded, Walking, Stand, Hover)
}
"""The gaits of a scenario by name; an extension adds its own when it is imported."""


@checked
def gaits_of(robot: str | Robot) -> tuple[str, ...]:
    """Names of the gaits that a robot has; the first one is its default.

    Args:
        robot: ``harpy``, a robot of the catalogue, or one's own.

    Raises:
        InputError: there is no such robot, or no gait for so many feet.
    """
    robot = named_robot(robot)
    names = tuple(
        name for name, kind in GAIT_PARTS.items() if kind.fits(robot) and not why_not(robot, name)
    )
    if not names and isinstance(robot, Robot):
        feet = ", ".join(robot.feet)
        raise InputError(
            f"no gait is for the {_feet(robot)} feet of '{robot.name}': {feet}",
            name="robot",
            value=robot,
        )
    return names


def _feet(robot: str | Robot) -> int:
    """How many feet a robot has; −1 for Harpy, and where it is not known."""
    known = CATALOGUE.get(robot) if isinstance(robot, str) else robot
    return -1 if known is None else len(known.corners if isinstance(known, Robot) else known.feet)


def schedules_of(robot: str | Robot) -> tuple[str, ...]:
    """Names of the schedules that a robot other than Harpy can walk by; the first one is its
    default.
    """
    return (*BY_FEET.get(_feet(robot), {}), "stand")


def why_not(robot: str | Robot, gait: object) -> str:
    """Why a robot has not a gait, where that is not plain."""
    if gait != Walking.name:
        return ""
    if isinstance(robot, str):
        return SHORT_LEG.format(robot) if robot in Walking.without else ""
    return why_no_walk(robot)
