"""The planar walk in closed loop: clock, inverse kinematics, joint PID and the compiled plant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gait.planar_gait import PlanarGait, planar_targets
from harpy_pin.gait.planar_model import PlanarModel, planar_step, workspace
from harpy_pin.ground import Ground
from harpy_pin.robot import Robot
from harpy_pin.state import Command, State, Vector

__all__ = ["PlanarJoints", "PlanarSummary", "PlanarWalk", "PlanarWalkController"]

MAX_JOINT_RATE = 20.0
"""Largest joint velocity target, rad/s, as in the governed controller."""
GRAVITY = 9.81
FALL_PITCH = 0.7
"""Pitch at which a walk counts as fallen, rad."""


@dataclass(frozen=True, kw_only=True)
class PlanarJoints:
    """PID of hips and knees (READING.md §3, "joint PID"; the derivative gains are what a 1 ms hold bears).

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


@dataclass(frozen=True)
class PlanarSummary:
    """What a planar walk achieved.

    Attributes:
        duration: time walked before the end or a fall, s.
        fell: whether it fell.
        steps: step durations walked.
        speed: mean along x, m/s.
        height_min: of the body, m.
        height_max: of the body, m.
        pitch_max: largest magnitude, rad.
        paper_cost: time average of 10|v_x − 0.3| + |ω| + 10|z − 0.6| (READING.md §3).
        thrust_rms: root mean square of the sum of the thrusts, N.
        slip: path of the touching feet along the ground, mm per step.
        torque_max: largest joint torque, N·m.
        force_rms_x: root mean square of the ground's force along x, N.
        variation: root mean square change of the pitch from one mid-step to the next, later half of the run, rad.
    """

    duration: float
    fell: bool
    steps: float
    speed: float
    height_min: float
    height_max: float
    pitch_max: float
    paper_cost: float
    thrust_rms: float
    slip: float
    torque_max: float
    force_rms_x: float
    variation: float


class PlanarWalk:
    """A planar gait on a robot and a ground.

    Args:
        robot: Harpy on its free flyer, or its :class:`PlanarModel`.
        gait: the walk.
        ground: contact parameters; friction 0.8 by default.
        joints: PID gains.
        dt: physics step, s; the controller ticks every second step.

    Attributes:
        q: (7,) configuration.
        v: (7,) velocity.
        integral: (4,) integral part of the joint torques, N·m.
        t: time, s.
    """

    def __init__(
        self,
        robot: Robot | PlanarModel,
        gait: PlanarGait,
        *,
        ground: Ground | None = None,
        joints: PlanarJoints | None = None,
        dt: float = 5e-4,
    ) -> None:
        self.model = robot if isinstance(robot, PlanarModel) else PlanarModel.from_robot(robot)
        self.gait = gait
        self.ground = ground if ground is not None else Ground(mu_s=0.8)
        self.joints = joints if joints is not None else PlanarJoints()
        self.dt = checks.number("dt", dt, low=0.0, strict=True)
        self.period = 2.0 * self.dt
        self._curves, self._packed, self._pid = gait.curves, gait.packed, self.joints.packed
        self._ground = self.ground.packed
        self.q, self.v, self.integral, self._force = np.zeros(7), np.zeros(7), np.zeros(4), np.zeros(6)
        self.t = 0.0
        self.reset(*self.initial_state())

    @property
    def static_sink(self) -> float:
        """Penetration of two feet at rest under the weight, m."""
        return self.model.mass * GRAVITY / (2.0 * self.ground.stiffness)

    def initial_state(self) -> tuple[Vector, Vector]:
        """Configuration (7,) and velocity (7,) at t = 0: joints on their targets, the lower foot in the ground."""
        g, q, v = self.gait, self.model.neutral(), np.zeros(7)
        target, rate = np.zeros(4), np.zeros(4)
        joint_targets(0.0, q, v, self._curves, self._packed, self.model.links, self.model.points, target, rate)
        q[2], q[3:] = g.start_pitch, target
        v[:3], v[3:] = (g.start_vx, g.start_vz, g.start_pitch_rate), rate
        q[1] = -float(self.model.terms(q, v)["foot_position"][:, 1].min()) - self.static_sink
        return q, v

    def reset(self, q: ArrayLike, v: ArrayLike, *, integral: ArrayLike | None = None, t: float = 0.0) -> None:
        """Put the walk in a state; contact forces start at zero.

        Raises:
            InputError: wrong shapes or entries that are not finite.
        """
        self.q, self.v = checks.vector("q", q, 7), checks.vector("v", v, 7)
        self.integral = np.zeros(4) if integral is None else checks.vector("integral", integral, 4)
        self._force[:] = 0.0
        self.t = checks.number("t", t, low=0.0)

    def run(self, duration: float, *, log: bool = False) -> PlanarSummary:
        """Walk on from the present state until the time is over or the robot falls.

        Args:
            duration: s.
            log: keep :attr:`log`: rows t, q (7), v (7), force (6), torque (4), thrust (2), feet (4) per tick.
        """
        ticks = max(round(checks.number("duration", duration, low=0.0, strict=True) / self.period), 1)
        self.log = np.zeros((ticks if log else 0, 31))
        sums = np.zeros(10)
        done, start = 0, self.q[0]
        done = _run(
            self.t,
            ticks,
            self.dt,
            self.q,
            self.v,
            self.integral,
            self._force,
            self._curves,
            self._packed,
            self._pid,
            self.model.links,
            self.model.points,
            self.model.joint,
            self._ground,
            self.log,
            sums,
        )
        self.log = self.log[:done]
        self.t += done * self.period
        walked, n = done * self.period, max(done, 1)
        steps = walked / self.gait.step_duration
        return PlanarSummary(
            duration=walked,
            fell=done < ticks,
            steps=steps,
            speed=float((self.q[0] - start) / max(walked, 1e-9)),
            height_min=float(sums[1]),
            height_max=float(sums[2]),
            pitch_max=float(sums[3]),
            paper_cost=float(sums[0] / n),
            thrust_rms=float(np.sqrt(sums[4] / n)),
            slip=float(1e3 * sums[5] / max(steps, 1e-9)),
            torque_max=float(sums[6]),
            force_rms_x=float(np.sqrt(sums[7] / n)),
            variation=float(np.sqrt(sums[8] / max(sums[9], 1.0))),
        )


class PlanarWalkController:
    """The same walk as a controller for :class:`harpy_pin.simulation.Simulator` on the planar robot.

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


@njit(cache=True)
def _run(  # type: ignore[no-untyped-def]
    t, ticks, dt, q, v, integral, force, curves, packed, pid, links, points, joint, ground, log, sums
):
    """Ticks done before a fall. Sums: cost, z min, z max, |pitch| max, thrust², slip, |torque| max, force_x².

    Then the squared changes of the mid-step pitch, and how many.
    """
    target, torque, thrust = np.zeros(4), np.zeros(4), np.zeros(2)
    feet, before = np.zeros((2, 2)), np.zeros((2, 2))
    work = workspace()
    sums[1], sums[2] = np.inf, -np.inf
    fall_height = 0.6 * q[1]
    pitch, step_ticks = np.nan, max(round(packed[0] / (2.0 * dt)), 1)
    for tick in range(ticks):
        planar_control(
            t + 2.0 * dt * tick, q, v, curves, packed, pid, links, points, 2.0 * dt, integral, target, torque, thrust
        )
        if log.shape[0] > 0:
            row = log[tick]
            row[0] = t + 2.0 * dt * tick
            row[1:8] = q
            row[8:15] = v
            row[15:21] = force
            row[21:25] = torque
            row[25:27] = thrust
        for _ in range(2):
            touching = (force[2] > 0.0, force[5] > 0.0)
            planar_step(q, v, torque, thrust, links, points, joint, GRAVITY, dt, ground, force, feet, work)
            for k in range(2):
                if touching[k] and force[3 * k + 2] > 0.0:
                    sums[5] += abs(feet[k, 0] - before[k, 0])
                before[k, 0] = feet[k, 0]
        if log.shape[0] > 0:
            log[tick, 27:29] = feet[0]
            log[tick, 29:31] = feet[1]
        sums[0] += 10.0 * abs(v[0] - 0.3) + abs(v[2]) + 10.0 * abs(q[1] - 0.6)
        sums[1], sums[2] = min(sums[1], q[1]), max(sums[2], q[1])
        sums[3] = max(sums[3], abs(q[2]))
        sums[4] += thrust[0] * thrust[0] + thrust[1] * thrust[1]
        sums[6] = max(sums[6], np.abs(torque).max())
        sums[7] += (force[0] + force[3]) ** 2
        if tick % step_ticks == step_ticks // 2:
            if 2 * tick > ticks and not np.isnan(pitch):
                sums[8] += (q[2] - pitch) ** 2
                sums[9] += 1.0
            pitch = q[2]
        if not (abs(q[2]) < FALL_PITCH and q[1] > fall_height and np.abs(v).sum() < 1e4):
            return tick
    return ticks
