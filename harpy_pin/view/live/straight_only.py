"""The commanded walk for a controller that knows no heading."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from harpy_pin.gaits.commanded import CommandedGait
from harpy_pin.gaits.gait import GaitTarget
from harpy_pin.model.state import Vector

__all__ = ["STRAIGHT", "FacingGait"]

STRAIGHT = 0.01
"""Largest heading, rad, and turning velocity, rad/s, that count as facing x."""


class FacingGait:
    """A commanded walk that does not turn: forward and sideways velocity act, turning is not heard.

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
