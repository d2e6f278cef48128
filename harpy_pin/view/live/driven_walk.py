"""What a drive takes from its robot: the gait, the controllers that walk it, and the ends of what can be set."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gaits.commanded import CommandedGait, make_commanded_gait
from harpy_pin.gaits.gait import GaitTarget
from harpy_pin.gaits.walking.build import FOUR_FEET, TWO_FEET
from harpy_pin.gaits.walking.walking_gait import WalkingGait
from harpy_pin.ground.ground import walking_stiffness
from harpy_pin.ground.terrain import Plane
from harpy_pin.model.record import field
from harpy_pin.model.robot import HARPY_FEET, HARPY_THRUSTERS, Robot
from harpy_pin.model.state import Vector
from harpy_pin.view.live.drive_settings import CONTROLLERS, HARDEST, MAX_SPEED, SOFTEST, LiveSettings

__all__ = [
    "STRAIGHT",
    "DriveRanges",
    "DrivenGait",
    "FacingGait",
    "command_gait",
    "fitting_parameters",
    "make_driven_gait",
    "may_change_schedule",
    "nearer_stiffness",
    "tilted",
    "usual_settings",
]

DrivenGait: TypeAlias = CommandedGait | WalkingGait

HARPY_MASS = 4.0
"""kg: pushes on other robots grow with their mass."""
SLOW = 0.02
"""Velocity below which a robot that never stops stepping may change its schedule, m/s and rad/s."""
STRAIGHT = 0.01
"""Largest heading, rad, and turning velocity, rad/s, that count as facing x."""
STIFFNESS_RATE = 4.0
"""How fast the stiffness changes, 1/s: by a factor of e in 0.25 s."""
TILT_RATE = 0.1
"""How fast the ground tilts, rad/s."""


@dataclass(frozen=True, kw_only=True)
class DriveRanges:
    """Ends of what a driver sets, and what there is to choose from.

    Attributes:
        controllers: names of :data:`~harpy_pin.view.live.drive_settings.CONTROLLERS` that walk the robot.
        schedules: contact schedules; none where the gait has only its own.
        forward: largest velocity forward, m/s.
        sideways: largest velocity to the left, m/s.
        turning: largest velocity of turning, rad/s.
        stiffness: least and largest of the ground, N/m.
        height: least and largest change of the body's height, m; None where the gait keeps it.
        impulse: largest push, N·s.
        pull: largest pull, N.
        spring: of the hand that drags the robot, N/m.
        ahead: distance from the body to ice that is laid ahead, m.
    """

    controllers: tuple[str, ...]
    schedules: tuple[str, ...] = ()
    forward: float = 0.5
    sideways: float = 0.2
    turning: float = 1.0
    stiffness: tuple[float, float] = (SOFTEST, HARDEST)
    height: tuple[float, float] | None = None
    impulse: float = 30.0
    pull: float = 60.0
    spring: float = 80.0
    ahead: float = 0.25

    @classmethod
    def of(cls, robot: Robot) -> DriveRanges:
        """Those of a robot.

        Args:
            robot: Harpy or a variant of it, or any robot with two or four feet.

        Raises:
            InputError: it does not walk.
        """
        if is_harpy(robot):
            return cls(controllers=tuple(CONTROLLERS))
        gait = WalkingGait(robot)
        speed = min(np.floor(20.0 * gait.max_speed) / 20.0, MAX_SPEED)
        low, high = (round(float(end), 2) for end in gait.record["height_range"][0])
        usual = walking_stiffness(robot)
        share = max(robot.mass / HARPY_MASS, 1.0)
        nominal: Vector = field(gait.record, "nominal")
        return cls(
            controllers=tuple(name for name, (kind, _) in CONTROLLERS.items() if kind != "governed"),
            schedules=_schedules(robot),
            forward=float(speed),
            sideways=float(speed),
            stiffness=(0.05 * usual, 5.0 * usual),
            height=(low, high),
            impulse=round(30.0 * share),
            pull=round(60.0 * share),
            spring=round(80.0 * share),
            ahead=0.25 + float(nominal[:, 0].max()),
        )

    def check(self, settings: LiveSettings) -> None:
        """Refuse settings that the robot does not have.

        Raises:
            InputError: another controller or schedule, a ground too soft or too hard, or a height where the gait keeps
                its own.
        """
        checks.one_of("controller of this robot", settings.controller, self.controllers)
        checks.number("stiffness", settings.stiffness, low=self.stiffness[0], high=self.stiffness[1])
        if settings.schedule is not None:
            if not self.schedules:
                raise InputError("Harpy's gait has no contact schedule to choose", name="schedule")
            checks.one_of("schedule of this robot", settings.schedule, self.schedules)
        if settings.height != 0.0 and self.height is None:
            raise InputError("Harpy's gait keeps its height", name="height", value=settings.height)


def is_harpy(robot: Robot) -> bool:
    """Whether a robot has Harpy's feet and thrusters, as its gait needs."""
    return robot.feet == HARPY_FEET and robot.thrusters == HARPY_THRUSTERS


def _schedules(robot: Robot) -> tuple[str, ...]:
    """Contact schedules for its number of feet."""
    return tuple(TWO_FEET if len(robot.corners) == 2 else FOUR_FEET)


def usual_settings(robot: Robot) -> dict[str, Any]:
    """Settings of a robot that differ from Harpy's, which are the defaults: stiffness of the ground, and schedule."""
    if is_harpy(robot):
        return {}
    return {"stiffness": walking_stiffness(robot), "schedule": next(iter(_schedules(robot)))}


def make_driven_gait(robot: Robot, settings: LiveSettings) -> DrivenGait:
    """The gait of a robot that is driven, at rest, for the stiffness of the ground and the schedule that are set."""
    if is_harpy(robot):
        return make_commanded_gait(robot, stiffness=settings.stiffness)
    return WalkingGait(robot, settings.schedule)


def fitting_parameters(gait: DrivenGait) -> Mapping[str, Any]:
    """Settings of a controller that fit the gait's robot."""
    return gait.parameters if isinstance(gait, WalkingGait) else {}


def command_gait(gait: DrivenGait, settings: LiveSettings) -> None:
    """Tell a gait the velocity that is set; one whose schedule is to change is told to stop."""
    turning = settings.turning if settings.turns else 0.0
    if isinstance(gait, CommandedGait):
        gait.command[:] = settings.forward, settings.sideways, turning
    elif settings.schedule in (None, gait.schedule):
        gait.command[:] = settings.forward, settings.sideways, turning, settings.height
    else:
        gait.command[:] = 0.0


def may_change_schedule(gait: DrivenGait) -> bool:
    """Whether the robot stands, or steps in place with every foot on the ground: a new gait begins from standing."""
    if isinstance(gait, CommandedGait):
        return False
    slow = float(np.abs(gait.applied).max()) < SLOW
    return slow and (not gait.walking or (bool(gait.record["always"][0]) and not gait.record["in_air"].any()))


class FacingGait:
    """A commanded walk that does not turn: forward and sideways velocity act, turning does not.

    The walk itself is not copied, so that a controller that turns can go on with it.

    Args:
        gait: to follow.
    """

    def __init__(self, gait: CommandedGait) -> None:
        self.gait = gait
        self.robot = gait.robot
        self.target: GaitTarget = gait.target
        self.step_duration, self.double_support = gait.step_duration, gait.double_support

    @staticmethod
    def fits(gait: CommandedGait) -> bool:
        """Whether a walk, as it goes now, faces x."""
        heading = gait.target.heading
        return bool(abs(heading[0]) < STRAIGHT and abs(heading[1]) < STRAIGHT)

    def update(self, t: float) -> GaitTarget:
        """See :meth:`harpy_pin.gaits.commanded.CommandedGait.update`."""
        self.gait.command[2] = 0.0
        return self.gait.update(t)

    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """See :meth:`harpy_pin.gaits.commanded.CommandedGait.initial_state`."""
        return self.gait.initial_state(penetration=penetration)

    def describe(self) -> Mapping[str, Any]:
        """The walk's parameters."""
        return self.gait.describe()

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """The walk's signals."""
        return self.gait.telemetry()


def nearer_stiffness(now: float, desired: float, span: float) -> float:
    """The stiffness, N/m, that goes to the desired one after a time, s."""
    most = math.exp(STIFFNESS_RATE * span)
    return min(desired, now * most) if desired > now else max(desired, now / most)


def tilted(plane: Plane, slope: float, place: Vector, span: float) -> Plane:
    """The ground after a time, s, in which it tilts to a slope, rad, about a (2,) place that keeps its height, m."""
    step = TILT_RATE * span
    angle = plane.slope + min(max(slope - plane.slope, -step), step)
    height = float(plane.height(place[0], place[1]))
    return Plane(slope=angle, above=height - math.tan(angle) * float(place[0]))
