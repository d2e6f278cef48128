"""Standing on every foot, for robots with any number of feet: a posture held, and the body's weight shifted over it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gait.base import GaitTarget
from harpy_pin.model.record import field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["Standing"]

LONGEST = 1e9
"""Largest time, s."""
LEVEL = 2e-3
"""Largest difference between the heights of the feet, m."""


class Standing:
    """Targets of a robot that stands upright on all its feet, where a posture of its joints puts them.

    The body's target goes from its place to ``shift`` and back, over and over, smoothly and from rest.

    The whole-body controllers' ranges of normal force are made for Harpy: give those of a lighter robot with
    ``min_normal_force`` and ``max_normal_force``, see :class:`~harpy_pin.control.WholeBodyParameters`.

    Args:
        robot: any robot with feet.
        posture: (joints,) angles, rad; by default the robot's own.
        shift: (3,) how far the body goes, world axes, m.
        shift_period: there and back, s.
        press: how much deeper than the ground a foot aims that does not carry, m: without it such a foot would come to
            rest just above the ground and never be held.

    Attributes:
        step_duration: one second, so that measures per step are per second.
        double_support: 1, always.
        constant: it never changes, so that controllers may copy it (:func:`~harpy_pin.gait.base.own_target`).

    Raises:
        InputError: values out of their domains, no posture given where the robot has none of its own, or a posture
            whose feet are not on one level below the body.
    """

    constant = True

    def __init__(
        self,
        robot: Robot,
        posture: ArrayLike | None = None,
        *,
        shift: ArrayLike = (0.0, 0.0, 0.0),
        shift_period: float = 2.0,
        press: float = 0.005,
    ) -> None:
        if not robot.feet:
            raise InputError(
                f"'{robot.name}' has no foot to stand on: hp.Hovering is for robots that fly", name="robot"
            )
        if posture is None:
            posture = robot.posture
        if posture is None:
            raise InputError(f"'{robot.name}' has no standing posture of its own: give one", name="posture")
        self.robot = robot
        self.step_duration, self.double_support = 1.0, 1.0
        model = robot.model
        self._q = pin.neutral(model)
        self._q[7:] = checks.vector("posture", posture, len(robot.joints))
        data = model.createData()
        pin.framesForwardKinematics(model, data, self._q)
        feet = np.array([data.oMf[robot.frame_id(name)].translation for name in robot.feet])
        if np.ptp(feet[:, 2]) > LEVEL or feet[:, 2].max() >= 0.0:
            heights = ", ".join(f"{name} {z:.3f} m" for name, z in zip(robot.feet, feet[:, 2], strict=True))
            raise InputError(f"this posture's feet are not on one level below the body: {heights}", name="posture")
        self._record = make_record(
            feet=feet,
            height=-float(feet[:, 2].min()),
            shift=checks.vector("shift", shift, 3),
            shift_period=checks.number("shift_period", shift_period, low=0.0, strict=True),
            press=checks.number("press", press, low=0.0),
        )
        self.target = GaitTarget(len(feet))

    def update(self, t: float) -> GaitTarget:
        """Targets at time t ≥ 0, s.

        Args:
            t: time, s.

        Raises:
            InputError: t is no finite number, or beyond 1e9 s.
        """
        if not stand(t, self._record, self.target.record):
            raise InputError(f"the gait's time must be finite and below {LONGEST:g} s, got {t!r}", name="t", value=t)
        return self.target

    def initial_state(self, *, sink: float = 0.0) -> tuple[Vector, Vector]:
        """Configuration (nq,) and velocity (nv,) that match the targets at t = 0.

        Args:
            sink: how deep the lowest foot is in the ground, m (see ``Simulator.static_sink``).
        """
        q = self._q.copy()
        q[2] = float(self._record["height"][0]) - sink
        return q, np.zeros(self.robot.model.nv)

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        return {
            "posture": self._q[7:].tolist(),
            "shift": field(self._record, "shift").tolist(),
            "shift_period": float(self._record["shift_period"][0]),
            "press": float(self._record["press"][0]),
            "step_duration": self.step_duration,
        }


@njit(cache=True)
def stand(t, gait, target):  # type: ignore[no-untyped-def]
    """All targets at time t, of a robot with any number of feet or none; returns whether it is one."""
    if not abs(t) < LONGEST:
        return False
    p, o = gait[0], target[0]
    rate = 2.0 * np.pi / p.shift_period
    share, speed = 0.5 - 0.5 * np.cos(rate * t), 0.5 * rate * np.sin(rate * t)
    acceleration = 0.5 * rate * rate * np.cos(rate * t)
    for i in range(3):
        o.body[i], o.body[3 + i], o.body[6 + i] = share * p.shift[i], speed * p.shift[i], acceleration * p.shift[i]
        for k in range(o.stance.shape[0]):
            o.foot_position[k, i] = p.feet[k, i] - o.body[i]
            o.foot_velocity[k, i] = -o.body[3 + i]
            o.foot_acceleration[k, i] = -o.body[6 + i]
    o.body[2] += p.height
    for k in range(o.stance.shape[0]):
        o.foot_position[k, 2] -= p.press
        o.stance[k], o.progress[k] = 1.0, 0.5
    return True
