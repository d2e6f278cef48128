"""The planar walk in closed loop, compiled as a whole: a walk of ten steps takes about 40 ms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.gait.planar.control import PlanarJoints, joint_targets, planar_control
from harpy_pin.gait.planar.gait import PlanarGait
from harpy_pin.gait.planar.model import PlanarModel
from harpy_pin.gait.planar.step import planar_step, workspace
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.plant.ground import Ground

__all__ = ["PlanarSummary", "PlanarWalk"]

GRAVITY = 9.81
FALL_PITCH = 0.7
"""Pitch at which a walk counts as fallen, rad."""


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
        paper_cost: time average of 10|v_x − 0.3| + |ω| + 10|z − 0.6| (equations.md §3).
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
        ground: contact parameters; the paper's by default.
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
        self.ground = ground if ground is not None else Ground()
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
