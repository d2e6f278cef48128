"""The planar walk in closed loop, compiled as a whole: a walk of ten steps takes about 40 ms.

Its controller is a clock, closed-form inverse kinematics and a joint PID. The physics step is that
of the robot in space, with the terms of :mod:`reproduction.gait.planar_model`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.controllers.governed_tick import MAX_JOINT_RATE
from harpy_pin.ground.ground import Ground, GroundRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.record import RecordOf, Records, field, fields, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.simulation.step import StepRecord, implicit_step, step_record
from reproduction.gait.planar_gait import PlanarGait, PlanarGaitRecord, planar_targets
from reproduction.gait.planar_model import NV, PlanarModel, PlanarModelRecord, planar_terms


@dataclass(frozen=True, kw_only=True)
class PlanarJoints(checks.Checked):
    """PID of hips and knees (equations.md §3, "joint PID"; the derivative gains are what a 1 ms
    hold bears).
    """

    # (hip, knee), N·m/rad
    k_p: tuple[float, float] = checks.setting((1000.0, 1000.0), checks.fixed_gains, size=2)
    # N·m/(rad·s); zero leaves the controller without memory
    k_i: tuple[float, float] = checks.setting((20.0, 20.0), checks.fixed_gains, size=2)
    # N·m·s/rad
    k_d: tuple[float, float] = checks.setting((10.0, 3.0), checks.fixed_gains, size=2)
    # largest torque of the integral part, N·m
    integral_limit: float = checks.setting(4.0, low=0.0)


class PlanarWalkRecord(PlanarGaitRecord, PlanarJoints):
    """What :func:`planar_control` knows and writes, besides the numbers of the gait and of the
    PID.
    """

    period: float  # between ticks, s
    integral: Vector = sized(4)  # (4,) integral part of the joint torques, N·m
    target: Vector = sized(4)  # (4,) left hip, left knee, right hip, right knee, rad
    rate: Vector = sized(4)  # (4,) of the targets, rad/s
    torque: Vector = sized(4)  # (4,) of the command, N·m


def walk_record(
    gait: PlanarGait, joints: PlanarJoints, *, period: float
) -> Records[PlanarWalkRecord]:
    """A new :class:`PlanarWalkRecord`."""
    return make_record(PlanarWalkRecord, period=period, **asdict(joints), **fields(gait.record))


@kernel(q=(7,), v=(7,))
def planar_control(
    t: float, q: Vector, v: Vector, walk: PlanarWalkRecord, model: PlanarModelRecord
) -> None:
    """One tick: joint torques.

    Args:
        t: time, s.
        q: (7,) configuration.
        v: (7,) velocity.
        walk: element of :func:`walk_record`.
        model: element of :attr:`PlanarModel.record`.
    """
    joint_targets(t, walk, model)
    limit = walk.integral_limit
    for i in range(4):
        error = walk.target[i] - q[3 + i]
        walk.integral[i] += walk.k_i[i % 2] * error * walk.period
        walk.integral[i] = min(max(walk.integral[i], -limit), limit)
        walk.torque[i] = (
            walk.k_p[i % 2] * error + walk.integral[i] + walk.k_d[i % 2] * (walk.rate[i] - v[3 + i])
        )


@kernel
def joint_targets(t: float, walk: PlanarWalkRecord, model: PlanarModelRecord) -> None:
    """Targets and rates of the joints: closed-form inverse kinematics.

    Where a foot target is out of reach, they are those of the nearest pose.
    """
    position, velocity, stance = np.empty((2, 2)), np.empty((2, 2)), np.empty((2, 2))
    planar_targets(t, walk, position, velocity, stance)
    for k in range(2):
        _place_leg(k, position[k], velocity[k], walk, model)


@kernel
def _place_leg(
    k: int, position: Vector, velocity: Vector, walk: PlanarWalkRecord, model: PlanarModelRecord
) -> None:
    """Targets and rates of hip and knee that put foot k where it should be in body axes."""
    hip, upper, lower = model.origin[1 + 2 * k], -model.origin[2 + 2 * k, 1], -model.foot[k, 1]
    x, drop = position[0] - hip[0], hip[1] - position[1]
    length = np.hypot(x, drop)
    reach = min(max(length, abs(upper - lower) + 1e-6), upper + lower - 1e-6)
    knee = np.arccos((reach * reach - upper * upper - lower * lower) / (2.0 * upper * lower))
    bend = np.arctan2(lower * np.sin(knee), upper + lower * np.cos(knee))
    # Rates: of the leg's length through the knee, of its direction through the hip.
    knee_rate, hip_rate = 0.0, 0.0
    if reach == length:
        stretch = (x * velocity[0] - drop * velocity[1]) / length
        knee_rate = -stretch * length / (upper * lower * np.sin(knee))
        turn = -(drop * velocity[0] + x * velocity[1]) / (length * length)
        slope = (lower * lower + upper * lower * np.cos(knee)) / (length * length)
        hip_rate = turn - slope * knee_rate
    walk.target[2 * k] = np.arctan2(-x, drop) - bend
    walk.target[2 * k + 1] = knee
    walk.rate[2 * k] = min(max(hip_rate, -MAX_JOINT_RATE), MAX_JOINT_RATE)
    walk.rate[2 * k + 1] = min(max(knee_rate, -MAX_JOINT_RATE), MAX_JOINT_RATE)


DT = 5e-4
"""Physics step, s; the controller ticks every second step."""
FALL_PITCH = 0.7
"""Pitch at which a walk counts as fallen, rad."""


@dataclass(frozen=True)
class PlanarSummary:
    """What a planar walk achieved."""

    duration: float  # time walked before the end or a fall, s
    fell: bool  # whether it fell
    steps: float  # step durations walked
    speed: float  # mean along x, m/s
    height_min: float  # of the body, m
    height_max: float  # of the body, m
    pitch_max: float  # largest magnitude, rad
    paper_cost: float  # time average of 10|v_x − 0.3| + |ω| + 10|z − 0.6| (equations.md §3)
    slip: float  # path of the touching feet along the ground, mm per step
    torque_max: float  # largest joint torque, N·m
    force_rms_x: float  # root mean square of the ground's force along x, N
    # root mean square change of the pitch from one mid-step to the next, later half of the run, rad
    variation: float


class PlanarWalk(KeepsViews):
    """A planar gait on a robot and a ground.

    Args:
        robot: Harpy on its free flyer, or its :class:`PlanarModel`.
        gait: the walk.
        ground: contact parameters; the paper's by default.
        joints: PID gains.

    Attributes:
        q: (7,) configuration.
        v: (7,) velocity.
        integral: (4,) integral part of the joint torques, N·m.
        t: time, s.
    """

    @checked
    def __init__(
        self,
        robot: Robot | PlanarModel,
        gait: PlanarGait,
        *,
        ground: Ground | None = None,
        joints: PlanarJoints | None = None,
    ) -> None:
        self.model = robot if isinstance(robot, PlanarModel) else PlanarModel.from_robot(robot)
        self.gait = gait
        self.ground = ground if ground is not None else Ground()
        self.joints = joints if joints is not None else PlanarJoints()
        self.period = 2.0 * DT
        self._walk = walk_record(gait, self.joints, period=self.period)
        self._model = self.model.record.copy()
        self._ground = self.ground.record
        self._step = step_record({"nv": NV, "feet": 2}, dt=DT)
        self.q, self.v, self.integral = np.zeros(NV), np.zeros(NV), field(self._walk, "integral")
        self.t = 0.0
        self.reset(*self.initial_state())

    @property
    def static_penetration(self) -> float:
        """Penetration of two feet at rest under the weight, m."""
        return float(self.model.mass * self._model["gravity"][0] / (2.0 * self.ground.stiffness))

    def initial_state(self) -> tuple[Vector, Vector]:
        """Configuration (7,) and velocity (7,) at t = 0: joints on their targets, the lower foot in
        the ground.
        """
        g, q, v = self.gait, np.zeros(NV), np.zeros(NV)
        joint_targets(0.0, self._walk[0], self._model[0])
        q[2], q[3:] = g.start_pitch, field(self._walk, "target")
        v[:3], v[3:] = (g.start_vx, g.start_vz, g.start_pitch_rate), field(self._walk, "rate")
        q[1] = -float(self.model.terms(q, v)["foot_position"][:, 2].min()) - self.static_penetration
        return q, v

    def reset(
        self, q: ArrayLike, v: ArrayLike, *, integral: ArrayLike | None = None, t: float = 0.0
    ) -> None:
        """Put the walk in a state; contact forces start at zero.

        Args:
            q: (7,) configuration in the plane, m and rad, see :meth:`PlanarModel.terms`.
            v: (7,) its rate, m/s and rad/s.
            integral: (4,) of the joint PID; zero by default.
            t: time, s.

        Raises:
            InputError: wrong shapes or entries that are not finite.
        """
        self.q, self.v = checks.vector("q", q, 7), checks.vector("v", v, 7)
        self.integral[:] = 0.0 if integral is None else checks.vector("integral", integral, 4)
        field(self._step, "force")[:] = 0.0
        self.t = checks.number("t", t, low=0.0)

    @checked
    def run(self, duration: float, *, log: bool = False) -> PlanarSummary:
        """Walk on from the present state until the time is over or the robot falls.

        Args:
            duration: s.
            log: keep :attr:`log`: rows t, q (7), v (7), force (6), torque (4) per tick.
        """
        ticks = checks.ticks(checks.number("duration", duration, low=0.0, strict=True), self.period)
        self.log = np.zeros((ticks if log else 0, 25))
        sums = make_record(SumsRecord)
        start = self.q[0]
        done = _run(
            self.t,
            ticks,
            self.q,
            self.v,
            self._walk,
            self._model,
            self._ground,
            self._step,
            self.log,
            sums,
        )
        self.log = self.log[:done]
        self.t += done * self.period
        walked, n = done * self.period, max(done, 1)
        steps = walked / self.gait.step_duration
        total = sums[0]
        return PlanarSummary(
            duration=walked,
            fell=done < ticks,
            steps=steps,
            speed=float((self.q[0] - start) / max(walked, 1e-9)),
            height_min=float(total["height_min"]),
            height_max=float(total["height_max"]),
            pitch_max=float(total["pitch_max"]),
            paper_cost=float(total["cost"] / n),
            slip=float(1e3 * total["slip"] / max(steps, 1e-9)),
            torque_max=float(total["torque_max"]),
            force_rms_x=float(np.sqrt(total["force"] / n)),
            variation=float(np.sqrt(total["pitch_change"] / max(total["changes"], 1.0))),
        )


class SumsRecord(RecordOf):
    """What a walk adds up.

    Attributes:
        cost: of the paper, per tick.
        pitch_max, torque_max: largest magnitudes, rad and N·m.
        force: squared force along x, N².
        slip: path of touching feet, m.
        pitch_change, changes: sum of the squared changes from one mid-step to the next, rad², and
            how many.
        height_min, height_max: m.
        pitch: at the last mid-step, rad.
        foot_x: (2,) of the last step, m.
    """

    cost: float = 0.0
    pitch_max: float = 0.0
    torque_max: float = 0.0
    force: float = 0.0
    slip: float = 0.0
    pitch_change: float = 0.0
    changes: float = 0.0
    height_min: float = np.inf
    height_max: float = -np.inf
    pitch: float = np.nan
    foot_x: Vector = sized(2)


@kernel
def _run(
    t: float,
    ticks: int,
    q: Vector,
    v: Vector,
    p: PlanarWalkRecord,
    d: PlanarModelRecord,
    ground: GroundRecord,
    s: StepRecord,
    log: Vector,
    total: SumsRecord,
) -> int:
    """Walk; returns the ticks done before a fall."""
    fall_height, thrust = 0.6 * q[1], np.zeros(3)
    step_ticks = max(int(np.floor(p.step_duration / p.period + 0.5)), 1)
    for tick in range(ticks):
        planar_control(t + p.period * tick, q, v, p, d)
        if log.shape[0] > 0:
            row = log[tick]
            row[0] = t + p.period * tick
            row[1:8] = q
            row[8:15] = v
            row[15:21] = s.force
            row[21:25] = p.torque
        for _ in range(2):
            first, second = s.force[2] > 0.0, s.force[5] > 0.0
            planar_step(q, v, p.torque, thrust, d, ground, s)
            _add_slip(0, first, d, s, total)
            _add_slip(1, second, d, s, total)
        _add_tick(q, v, p, s, total)
        if tick % step_ticks == step_ticks // 2:
            if 2 * tick > ticks and not np.isnan(total.pitch):
                total.pitch_change += (q[2] - total.pitch) ** 2
                total.changes += 1.0
            total.pitch = q[2]
        slow = np.sum(np.abs(v)) < 1e4
        if not (abs(q[2]) < FALL_PITCH and q[1] > fall_height and slow):
            return tick
    return ticks


@kernel(q=(7,), v=(7,), torque=(4,), thrust=(3,))
def planar_step(
    q: Vector,
    v: Vector,
    torque: Vector,
    thrust: Vector,
    model: PlanarModelRecord,
    ground: GroundRecord,
    step: StepRecord,
) -> int:
    """One time step, implicit in the contact, in place.

    Args:
        q: (7,) configuration, in and out.
        v: (7,) velocity, in and out.
        torque: (4,) joint torques, N·m.
        thrust: (3,) sum of the thrusts, world axes, N.
        model: a copy of :attr:`~reproduction.gait.planar_model.PlanarModel.record`; out: terms at
            the start of the step.
        ground: :attr:`harpy_pin.ground.ground.Ground.record`.
        step: see :func:`harpy_pin.simulation.step.step_record`.

    Returns:
        Sweeps of the contact solver, see :func:`harpy_pin.simulation.step.implicit_step`.
    """
    planar_terms(q, v, model)
    sweeps = implicit_step(model, ground, step, v, torque, thrust)
    q += step.displacement
    return int(sweeps)


@kernel
def _add_slip(
    k: int, touched: bool, d: PlanarModelRecord, s: StepRecord, total: SumsRecord
) -> None:
    """Path of a foot that touched before and after the step."""
    x = d.foot_position[k, 0]
    if touched and s.force[3 * k + 2] > 0.0:
        total.slip += abs(x - total.foot_x[k])
    total.foot_x[k] = x


@kernel
def _add_tick(q: Vector, v: Vector, p: PlanarWalkRecord, s: StepRecord, total: SumsRecord) -> None:
    total.cost += 10.0 * abs(v[0] - 0.3) + abs(v[2]) + 10.0 * abs(q[1] - 0.6)
    total.height_min, total.height_max = min(total.height_min, q[1]), max(total.height_max, q[1])
    total.pitch_max = max(total.pitch_max, abs(q[2]))
    total.torque_max = max(total.torque_max, np.max(np.abs(p.torque)))
    total.force += (s.force[0] + s.force[3]) ** 2
