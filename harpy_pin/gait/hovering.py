"""Hovering, for robots without feet: a place and a heading held in the air, or a way there and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gait.base import GaitTarget
from harpy_pin.gait.standing import LONGEST, stand
from harpy_pin.model.record import field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["Hovering"]


class Hovering:
    """Targets of a robot that hovers above the world's origin and faces x.

    The body's target goes from its place to ``shift`` and back, over and over, smoothly and from rest. It is upright;
    the whole-body controllers lean a robot that has to (:mod:`harpy_pin.control.lean`).

    Args:
        robot: one without feet.
        posture: (joints,) angles, rad; by default the robot's own, or zero where it has none.
        height: of the body's origin, m; a run counts as a fall at 60 % of it.
        shift: (3,) how far the body goes, world axes, m.
        shift_period: there and back, s.

    Attributes:
        step_duration: one second, so that measures per step are per second.
        double_support: 1, always.
        constant: it never changes, so that controllers may copy it (:func:`~harpy_pin.gait.base.own_target`).

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
        if robot.feet:
            raise InputError(f"'{robot.name}' has feet: hp.Standing is for robots that stand", name="robot")
        self.robot = robot
        self.step_duration, self.double_support = 1.0, 1.0
        if posture is None:
            posture = robot.posture
        self._q = pin.neutral(robot.model)
        self._q[2] = checks.number("height", height, low=0.0, strict=True)
        if posture is not None:
            self._q[7:] = checks.vector("posture", posture, len(robot.joints))
        self._record = make_record(
            feet=np.zeros((0, 3)),
            height=self._q[2],
            shift=checks.vector("shift", shift, 3),
            shift_period=checks.number("shift_period", shift_period, low=0.0, strict=True),
            press=0.0,
        )
        self.target = GaitTarget(0)
        self.update(0.0)  # compiles

    def update(self, t: float) -> GaitTarget:
        """Targets at time t ≥ 0, s.

        Raises:
            InputError: t is no finite number, or beyond 1e9 s.
        """
        if not stand(t, self._record, self.target.record):
            raise InputError(f"the gait's time must be finite and below {LONGEST:g} s, got {t!r}", name="t", value=t)
        return self.target

    def initial_state(self, *, sink: float = 0.0) -> tuple[Vector, Vector]:
        """Configuration (nq,) and velocity (nv,) that match the targets at t = 0.

        Args:
            sink: without a meaning here: no foot sinks in.
        """
        return self._q.copy(), np.zeros(self.robot.model.nv)

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        return {
            "posture": self._q[7:].tolist(),
            "height": float(self._q[2]),
            "shift": field(self._record, "shift").tolist(),
            "shift_period": float(self._record["shift_period"][0]),
            "step_duration": self.step_duration,
        }
