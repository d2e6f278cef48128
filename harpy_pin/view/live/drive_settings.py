"""What can be set while the robot is driven."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gaits.walking.build import FOUR_FEET, TWO_FEET
from harpy_pin.ground.ground import Ground

__all__ = ["CONTROLLERS", "LiveSettings"]

CONTROLLERS: Mapping[str, tuple[str, str | None]] = {
    "condensed": ("condensed", None),
    "wbc": ("wbc", None),
    "none": ("governed", "none"),
    "paper": ("governed", "paper"),
    "filter": ("governed", "filter"),
}
"""Names of the live page: the controller's, and its governor's, as :func:`harpy_pin.controllers.make_controller`
knows them."""
SOFTEST, HARDEST = 2e3, 2e5
"""Ends of the ground's stiffness, N/m: between them Harpy's gait is in the legs' reach, and the ground may change. For
other robots they grow with the weight on a contact point."""
LIGHTEST, HEAVIEST = 0.01, 100.0
"""Weight on a contact point beside Harpy's for which there are such ends."""
MAX_SPEED, MAX_TURN = 3.0, 2.0
"""Ends of the command, m/s and rad/s; the gait scales down what its legs cannot do."""
MAX_RISE = 0.5
"""Ends of the change of the body's height, m."""
MAX_SLOPE = 0.35
"""Ends of the ground's slope, rad."""
MIN_FRICTION, MAX_FRICTION = 0.02, 1.0
"""Ends of the ground's friction."""
MAX_DELAY, MAX_NOISE = 20, 10.0
"""Ends of the delay, ms, and of the noise."""


@dataclass(frozen=True, kw_only=True)
class LiveSettings:
    """Everything that a driver sets; pushes and resets are not settings but events.

    Attributes:
        controller: one of :data:`CONTROLLERS`.
        forward: commanded velocity, m/s.
        sideways: to the left, m/s.
        turning: to the left, rad/s.
        height: change of the body's height, m; of robots other than Harpy.
        schedule: contact schedule of robots other than Harpy, see :class:`harpy_pin.gaits.WalkingGait`; by default
            the gait's own.
        friction: static coefficient of the ground.
        friction_strips: strips of ground with another friction, see :class:`harpy_pin.ground.ground.Ground`.
        stiffness: of the ground, N/m.
        slope: angle by which the ground rises along x, rad.
        assumed: friction that the controller assumes; that of the ground outside the strips by default.
        estimate: whether the controller estimates the friction as it goes.
        delay: age of the measurements, ms.
        noise: of the measurements, as a multiple of typical noise (:meth:`harpy_pin.simulation.sensors.Noise.typical`).
        pace: simulated time per time of the clock, at most 1.

    Raises:
        InputError: an unknown name, or a value out of its domain.
    """

    controller: str = "condensed"
    forward: float = 0.0
    sideways: float = 0.0
    turning: float = 0.0
    height: float = 0.0
    schedule: str | None = None
    friction: float = 0.8
    friction_strips: tuple[tuple[float, float, float], ...] = ()
    stiffness: float = 8000.0
    slope: float = 0.0
    assumed: float | None = None
    estimate: bool = False
    delay: int = 0
    noise: float = 0.0
    pace: float = 1.0

    def __post_init__(self) -> None:
        checks.one_of("controller", self.controller, CONTROLLERS)
        for name, most in (
            ("forward", MAX_SPEED),
            ("sideways", MAX_SPEED),
            ("turning", MAX_TURN),
            ("height", MAX_RISE),
        ):
            checks.keep(self, **{name: checks.number(name, getattr(self, name), low=-most, high=most)})
        if self.schedule is not None:
            checks.one_of("schedule", self.schedule, (*FOUR_FEET, *TWO_FEET))
        checks.keep(self, friction=checks.number("friction", self.friction, low=MIN_FRICTION, high=MAX_FRICTION))
        checks.keep(self, friction_strips=Ground(friction_strips=self.friction_strips).friction_strips)
        checks.keep(
            self, stiffness=checks.number("stiffness", self.stiffness, low=LIGHTEST * SOFTEST, high=HEAVIEST * HARDEST)
        )
        checks.keep(self, slope=checks.number("slope", self.slope, low=-MAX_SLOPE, high=MAX_SLOPE))
        if self.assumed is not None:
            assumed = checks.number("assumed friction", self.assumed, low=0.0, high=checks.MAX_FRICTION)
            checks.keep(self, assumed=assumed)
        if not isinstance(self.estimate, bool):
            raise InputError(f"estimate must be true or false, got {self.estimate!r:.60}", name="estimate")
        if self.estimate and self.controller == "none":
            raise InputError("without a governor nothing takes an estimate of the friction", name="estimate")
        checks.keep(self, delay=checks.whole("delay in ms", self.delay, high=MAX_DELAY))
        checks.keep(self, noise=checks.number("noise", self.noise, low=0.0, high=MAX_NOISE))
        checks.keep(self, pace=checks.number("pace", self.pace, low=0.01, high=1.0))

    @property
    def mu(self) -> float:
        """Friction that the controller assumes."""
        return self.friction if self.assumed is None else self.assumed

    @property
    def turns(self) -> bool:
        """Whether the controller knows a heading; the paper's faces x."""
        return CONTROLLERS[self.controller][0] != "governed"

    def changed(self, changes: Mapping[str, Any]) -> LiveSettings:
        """A copy with other values.

        Raises:
            InputError: no mapping, an unknown name, or a value out of its domain.
        """
        if not isinstance(changes, Mapping):
            raise InputError(f"changes must be a mapping, got {changes!r:.60}", name="changes", value=changes)
        valid = [entry.name for entry in fields(self)]
        for name in changes:
            checks.one_of("setting", name, valid)
        return replace(self, **changes)
