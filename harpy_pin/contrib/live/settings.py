"""What can be set while a robot is driven, and what its gait makes of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeAlias

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gaits.commanded import CommandedGait, make_commanded_gait
from harpy_pin.gaits.walking.schedules import BY_FEET, SCHEDULES
from harpy_pin.gaits.walking.walking_gait import WalkingGait
from harpy_pin.ground.ground import Ground, walking_stiffness
from harpy_pin.model.catalogue import HARPY_FEET, HARPY_THRUSTERS
from harpy_pin.model.record import field
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.simulation.sensors import ESTIMATED, TRUE
from harpy_pin.view.identity import CONTROLLERS

DrivenGait: TypeAlias = CommandedGait | WalkingGait

SOFTEST, HARDEST = 2e3, 2e5
"""Ends of the ground's stiffness, N/m, between which Harpy's gait is in the legs' reach."""
MAX_SPEED, MAX_SLOPE = 3.0, 0.35
"""Ends of the commanded velocity, m/s, of which the gait scales down what its legs cannot do, and
of the slope, rad.
"""
MIN_FRICTION, MAX_FRICTION = 0.02, 1.0
MAX_DELAY = 20
"""Largest delay of the measurements, ms."""


@dataclass(frozen=True, kw_only=True)
class LiveSettings(checks.Checked):
    """Everything that a driver sets; pushes and resets are not settings but events.

    Attributes:
        controller: one of :data:`harpy_pin.view.identity.CONTROLLERS`.
        forward: commanded velocity, m/s.
        sideways: to the left, m/s.
        turning: to the left, rad/s.
        height: change of the body's height, m; of robots other than Harpy.
        schedule: contact schedule of robots other than Harpy, see
            :class:`harpy_pin.gaits.WalkingGait`; by default the gait's own.
        friction: static coefficient of the ground.
        friction_strips: strips of ground with another friction, see
            :class:`harpy_pin.ground.ground.Ground`.
        stiffness: of the ground, N/m.
        slope: angle by which the ground rises along x, rad.
        assumed: friction that the controller assumes; that of the ground outside the strips by
            default.
        estimate: whether the controller estimates the friction as it goes.
        state: what the controller knows: ``true``, or ``estimated`` from the usual sensors
            (:class:`harpy_pin.Imu`).
        delay: age of the measurements, ms.
        noise: of the measurements, as a multiple of typical noise
            (:meth:`harpy_pin.simulation.sensors.Noise.typical`).
        pace: simulated time per time of the clock, at most 1.

    Raises:
        InputError: an unknown name, or a value out of its domain.
    """

    controller: str = checks.setting("condensed", checks.one_of, valid=CONTROLLERS)
    forward: float = checks.setting(0.0, low=-MAX_SPEED, high=MAX_SPEED)
    sideways: float = checks.setting(0.0, low=-MAX_SPEED, high=MAX_SPEED)
    turning: float = checks.setting(0.0, low=-2.0, high=2.0)
    height: float = checks.setting(0.0, low=-0.5, high=0.5)
    schedule: str | None = checks.setting(None, checks.one_of, valid=SCHEDULES)
    friction: float = checks.setting(0.8, low=MIN_FRICTION, high=MAX_FRICTION)
    friction_strips: tuple[tuple[float, float, float], ...] = ()
    # of robots from a hundredth to a hundred times Harpy's weight
    stiffness: float = checks.setting(8000.0, low=0.01 * SOFTEST, high=100.0 * HARDEST)
    slope: float = checks.setting(0.0, low=-MAX_SLOPE, high=MAX_SLOPE)
    assumed: float | None = checks.setting(
        None, low=0.0, high=checks.MAX_FRICTION, called="assumed friction"
    )
    estimate: bool = False
    state: str = checks.setting(TRUE, checks.one_of, valid=(TRUE, ESTIMATED))
    delay: int = checks.setting(0, checks.whole, high=MAX_DELAY, called="delay in ms")
    noise: float = checks.setting(0.0, low=0.0, high=10.0)
    pace: float = checks.setting(1.0, low=0.01, high=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.keep(
            self, friction_strips=Ground(friction_strips=self.friction_strips).friction_strips
        )
        if not isinstance(self.estimate, bool):
            raise InputError(
                f"estimate must be true or false, got {self.estimate!r:.60}", name="estimate"
            )
        if self.estimate and self.controller == "none":
            raise InputError(
                "without a governor nothing takes an estimate of the friction", name="estimate"
            )
        if self.state == ESTIMATED and (self.noise or self.delay):
            raise InputError(
                "the sensors of the estimate have noise of their own: set noise and delay to 0",
                name="state",
                value=self.state,
            )

    @property
    def mu(self) -> float:
        """Friction that the controller assumes."""
        return self.friction if self.assumed is None else self.assumed

    @property
    def turns(self) -> bool:
        """Whether the controller knows a heading; the paper's faces x."""
        return CONTROLLERS[self.controller].name != "governed"

    def changed(self, changes: Mapping[str, Any]) -> LiveSettings:
        """A copy with other values.

        Raises:
            InputError: no mapping, an unknown name, or a value out of its domain.
        """
        for name in checks.mapping("changes", changes):
            checks.one_of("setting", name, [entry.name for entry in fields(self)])
        return replace(self, **changes)


@dataclass(frozen=True, kw_only=True)
class DriveRanges:
    """Ends of what a driver sets, and what there is to choose from; the defaults are Harpy's.

    Attributes:
        controllers: names of :data:`harpy_pin.view.identity.CONTROLLERS` that walk the robot.
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

    controllers: tuple[str, ...] = tuple(CONTROLLERS)
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
        """The ranges of Harpy or a variant of it, or of any robot with two, four or six feet.

        Raises:
            InputError: it does not walk.
        """
        if is_harpy(robot):
            return cls()
        gait = WalkingGait(robot)
        forward, sideways = (
            min(np.floor(20.0 * v) / 20.0, MAX_SPEED) for v in (gait.max_speed, gait.max_aside)
        )
        low, high = (round(float(end), 2) for end in gait._record_["planned"]["height_range"][0])
        usual = walking_stiffness(robot)
        share = max(robot.mass / 4.0, 1.0)  # beside the mass of Harpy, kg
        nominal: Vector = field(gait._record_["pace"], "nominal")
        return cls(
            controllers=tuple(name for name, one in CONTROLLERS.items() if one.name != "governed"),
            schedules=_schedules(robot),
            forward=float(forward),
            sideways=float(sideways),
            stiffness=(0.05 * usual, 5.0 * usual),
            height=(low, high),
            impulse=round(30.0 * share),
            pull=round(60.0 * share),
            spring=round(80.0 * share),
            ahead=0.25 + float(nominal[:, 0].max()),
        )

    def check(self, settings: LiveSettings) -> None:
        """Raise an :class:`InputError` for settings that the robot does not have."""
        checks.one_of("controller of this robot", settings.controller, self.controllers)
        checks.number(
            "stiffness", settings.stiffness, low=self.stiffness[0], high=self.stiffness[1]
        )
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
    return tuple(BY_FEET[len(robot.corners)])


def usual_settings(robot: Robot) -> LiveSettings:
    """The settings with which a drive of a robot begins: the defaults are Harpy's."""
    if is_harpy(robot):
        return LiveSettings()
    return LiveSettings(stiffness=walking_stiffness(robot), schedule=_schedules(robot)[0])


def make_driven_gait(robot: Robot, settings: LiveSettings) -> DrivenGait:
    """The gait of a robot that is driven, at rest, for the stiffness of the ground and the schedule
    that are set.
    """
    if is_harpy(robot):
        return make_commanded_gait(robot, stiffness=settings.stiffness)
    return WalkingGait(robot, settings.schedule)
