"""Hovering, for robots without feet: a place and a heading are held, or a path there and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gaits.staying import Staying, read_posture
from harpy_pin.model.record import field
from harpy_pin.model.robot import Robot

__all__ = ["Hovering"]


class Hovering(Staying):
    """Targets of a robot that hovers above the world's origin and faces x.

    The body's target goes from its place to ``shift`` and back, over and over, smoothly and from rest. At any time
    :meth:`move` sends it elsewhere. It is upright; the whole-body controllers lean a robot that has to
    (:mod:`harpy_pin.controllers.thrust_tilt`).

    Args:
        robot: one without feet.
        posture: (joints,) angles, rad; by default the robot's own, or zero where it has none.
        height: of the body's origin, m; a run counts as a fall at 60 % of it.
        shift: (3,) how far the body goes, world axes, m.
        shift_period: there and back, s.

    Attributes:
        step_duration: one second, so that measures per step are per second.
        double_support: 1, always.
        constant: it changes by :meth:`move` alone, so that controllers may copy it
            (:func:`~harpy_pin.gaits.gait.own_target`); their copies move with it.

    Raises:
        InputError: values out of their domains, or a robot with feet.
    """

    constant = True

    def __init__(
        self,
        robot: Robot,
        posture: ArrayLike | None = None,
        *,
        height: float = 1.0,
        shift: ArrayLike = (0.0, 0.0, 0.0),
        shift_period: float = 2.0,
    ) -> None:
        checks.instance("robot", robot, Robot)
        if robot.feet:
            raise InputError(f"'{robot.name}' has feet: hp.Standing is for robots that stand", name="robot")
        if posture is None:
            posture = robot.posture
        q = pin.neutral(robot.model)
        q[2] = checks.number("height", height, low=0.0, strict=True)
        if posture is not None:
            q[7:] = read_posture(robot, posture)
        super().__init__(robot, q, np.zeros((0, 3)), shift=shift, shift_period=shift_period)

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        return {
            "posture": self._q[7:].tolist(),
            "height": float(self._q[2]),
            "shift": field(self._record, "shift").tolist(),
            "shift_period": float(self._record["shift_period"][0]),
            "step_duration": self.step_duration,
        }
