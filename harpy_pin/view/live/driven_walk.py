"""What a drive takes from its robot: the gait, the controllers that walk it, and the ends of what can be set."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gaits.commanded import CommandedGait, make_commanded_gait
from harpy_pin.gaits.walking.schedules import FOUR_FEET, TWO_FEET
from harpy_pin.gaits.walking.walking_gait import WalkingGait
from harpy_pin.model.record import field
from harpy_pin.model.robot import HARPY_FEET, HARPY_THRUSTERS, Robot
from harpy_pin.model.state import Vector
from harpy_pin.simulation.resting import walking_stiffness
from harpy_pin.view.live.drive_settings import CONTROLLERS, HARDEST, MAX_SPEED, SOFTEST, LiveSettings

__all__ = [
    "DriveRanges",
    "DrivenGait",
    "command_gait",
    "fitting_parameters",
    "make_driven_gait",
    "may_change_schedule",
    "usual_settings",
]

DrivenGait: TypeAlias = CommandedGait | WalkingGait

HARPY_MASS = 4.0
"""kg: pushes on other robots grow with their mass."""
SLOW = 0.02
"""Velocity below which a robot that never stops stepping may change its schedule, m/s and rad/s."""


@dataclass(frozen=True, kw_only=True)
class DriveRanges:
    """Ends of what a driver sets, and what there is to choose from.

    Attributes:
        controllers: names of :data:`~harpy_pin.view.live.drive_settings.CONTROLLERS` that walk the robot.
        schedules: contact schedules; none where the gait has only its own.
        forward: largest velocity, m/s.
        sideways: likewise, to the left.
        turning: likewise, rad/s.
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
    """Settings that differ from Harpy's, which are the defaults: stiffness of the ground, and schedule.

    Args:
        robot: that is driven.
    """
    if is_harpy(robot):
        return {}
    return {"stiffness": walking_stiffness(robot), "schedule": next(iter(_schedules(robot)))}


def make_driven_gait(robot: Robot, settings: LiveSettings) -> DrivenGait:
    """The gait of a robot that is driven, at rest.

    Args:
        robot: that walks.
        settings: stiffness of the ground, and schedule.
    """
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
