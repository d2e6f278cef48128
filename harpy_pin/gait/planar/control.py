"""The controller of the planar walk: clock, closed-form inverse kinematics, joint PID."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gait.planar.gait import PlanarGait, planar_targets
from harpy_pin.gait.planar.model import PlanarModel
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector

__all__ = ["PlanarJoints", "PlanarWalkController", "joint_targets", "planar_control"]

MAX_JOINT_RATE = 20.0
"""Largest joint velocity target, rad/s, as in the governed controller."""


@dataclass(frozen=True, kw_only=True)
class PlanarJoints:
    """PID of hips and knees (equations.md §3, "joint PID"; the derivative gains are what a 1 ms hold bears).

    Attributes:
        k_p: (hip, knee), N·m/rad.
        k_i: N·m/(rad·s); zero leaves the controller without memory.
        k_d: N·m·s/rad.
        integral_limit: largest torque of the integral part, N·m.
    """

    k_p: tuple[float, float] = (1000.0, 1000.0)
    k_i: tuple[float, float] = (20.0, 20.0)
    k_d: tuple[float, float] = (10.0, 3.0)
    integral_limit: float = 4.0

    def __post_init__(self) -> None:
        for name in ("k_p", "k_i", "k_d"):
            checks.gains(name, getattr(self, name), 2)
        checks.number("integral_limit", self.integral_limit, low=0.0)

    @property
    def packed(self) -> Vector:
        """(4, 2) [k_p; k_i; k_d; integral limit]."""
        return np.array([self.k_p, self.k_i, self.k_d, (self.integral_limit,) * 2])


class PlanarWalkController:
    """The same walk as a controller for :class:`harpy_pin.plant.simulator.Simulator` on the planar robot.

    Args:
        robot: Harpy on its free flyer, or its :class:`PlanarModel`.
        gait: the walk.
        joints: PID gains.
        period: time between ticks, s.
    """

    def __init__(
        self,
        robot: Robot | PlanarModel,
        gait: PlanarGait,
        *,
        joints: PlanarJoints | None = None,
        period: float = 1e-3,
    ) -> None:
        self.model = robot if isinstance(robot, PlanarModel) else PlanarModel.from_robot(robot)
        self.gait = gait
        self.joints = joints if joints is not None else PlanarJoints()
        self.period = checks.number("period", period, low=0.0, strict=True)
        if self.model.planar.thrusters and len(self.model.planar.thrusters) != 2:
            raise InputError("the planar walk needs two thrusters or none", name="robot")
        self._curves, self._packed, self._pid = gait.curves, gait.packed, self.joints.packed
        self._integral, self._target, self._thrust = np.zeros(4), np.zeros(4), np.zeros(2)
        self._command = Command(np.zeros(4), np.zeros((len(self.model.planar.thrusters), 3)))

    def reset(self) -> None:
        """Forget the integrals."""
        self._integral[:] = 0.0

    def step(self, state: State) -> Command:
        """Torques of hips and knees, and the sagittal thrust in equal halves."""
        command = self._command
        planar_control(
            state.t,
            state.q,
            state.v,
            self._curves,
            self._packed,
            self._pid,
            self.model.links,
            self.model.points,
            self.period,
            self._integral,
            self._target,
            command.torque,
            self._thrust,
        )
        command.thrust[:, 0] = 0.5 * self._thrust[0]
        command.thrust[:, 2] = 0.5 * self._thrust[1]
        return command

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """Joint targets."""
        return {"joint_target": self._target}

    def describe(self) -> Mapping[str, Any]:
        """The gait's numbers."""
        return {"gait": self.gait.as_dict()}


@njit(cache=True)
def joint_targets(
    t: float,
    q: Vector,
    v: Vector,
    curves: Vector,
    packed: Vector,
    links: Vector,
    points: Vector,
    target: Vector,
    rate: Vector,
) -> None:
    """Joint targets of the legs: closed-form inverse kinematics, then the turn at the hip by the pitch feedback.

    Args:
        t: time, s.
        q: (7,) configuration (its pitch is used by the feedback only).
        v: (7,) velocity.
        curves: (2, 5, 2) :attr:`PlanarGait.curves`.
        packed: (10,) :attr:`PlanarGait.packed`.
        links: see :class:`PlanarModel`.
        points: likewise.
        target: (4,) out: left hip, left knee, right hip, right knee, rad; the nearest pose where out of reach.
        rate: (4,) out, rad/s, without the feedback's own rate.
    """
    position, velocity, stance = np.empty((2, 2)), np.empty((2, 2)), np.empty((2, 2))
    planar_targets(t, curves, packed, position, velocity, stance)
    for k in range(2):
        hip, upper, lower = 1 + 2 * k, -links[2 + 2 * k, 5], -points[k, 1]
        x, drop = position[k, 0] - links[hip, 4], links[hip, 5] - position[k, 1]
        length = np.hypot(x, drop)
        reach = min(max(length, abs(upper - lower) + 1e-6), upper + lower - 1e-6)
        knee = np.arccos((reach * reach - upper * upper - lower * lower) / (2.0 * upper * lower))
        bend = np.arctan2(lower * np.sin(knee), upper + lower * np.cos(knee))
        angle = np.arctan2(-x, drop) - bend
        # Rates: of the leg's length through the knee, of its direction through the hip.
        knee_rate, hip_rate = 0.0, 0.0
        if reach == length:
            stretch = (x * velocity[k, 0] - drop * velocity[k, 1]) / length
            knee_rate = -stretch * length / (upper * lower * np.sin(knee))
            turn = -(drop * velocity[k, 0] + x * velocity[k, 1]) / (length * length)
            slope = (lower * lower + upper * lower * np.cos(knee)) / (length * length)
            hip_rate = turn - slope * knee_rate
        j = 0 if stance[k, 0] > 0.5 else 2
        target[2 * k] = angle + packed[2 + j] * q[2] + packed[3 + j] * v[2]
        target[2 * k + 1] = knee
        rate[2 * k] = min(max(hip_rate, -MAX_JOINT_RATE), MAX_JOINT_RATE) + packed[2 + j] * v[2]
        rate[2 * k + 1] = min(max(knee_rate, -MAX_JOINT_RATE), MAX_JOINT_RATE)


@njit(cache=True)
def planar_control(
    t: float,
    q: Vector,
    v: Vector,
    curves: Vector,
    packed: Vector,
    pid: Vector,
    links: Vector,
    points: Vector,
    period: float,
    integral: Vector,
    target: Vector,
    torque: Vector,
    thrust: Vector,
) -> None:
    """One tick: joint torques and the sagittal thrust.

    Args:
        t: time, s.
        q: (7,) configuration.
        v: (7,) velocity.
        curves: (2, 5, 2) :attr:`PlanarGait.curves`.
        packed: (10,) :attr:`PlanarGait.packed`.
        pid: (4, 2) :attr:`PlanarJoints.packed`.
        links: see :class:`PlanarModel`.
        points: likewise.
        period: time between ticks, s.
        integral: (4,) in and out, N·m.
        target: (4,) out: joint targets, rad.
        torque: (4,) out, N·m.
        thrust: (2,) out: sum of both thrusts, world x and z, N.
    """
    rate = np.empty(4)
    joint_targets(t, q, v, curves, packed, links, points, target, rate)
    for i in range(4):
        error = target[i] - q[3 + i]
        integral[i] += pid[1, i % 2] * error * period
        integral[i] = min(max(integral[i], -pid[3, i % 2]), pid[3, i % 2])
        torque[i] = pid[0, i % 2] * error + integral[i] + pid[2, i % 2] * (rate[i] - v[3 + i])
    thrust[0] = packed[6] * (packed[8] * t - q[0]) + packed[7] * (packed[8] - v[0])
    thrust[1] = 0.0
