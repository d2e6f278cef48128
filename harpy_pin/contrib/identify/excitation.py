"""A motion that makes joints observable: sums of sines about a posture, for a robot that hangs by
its base.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.contrib.identify.equations import rigid
from harpy_pin.model.ik import find_posture
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, Vector

FUNDAMENTAL = 0.1
"""Frequency of which all others are multiples, Hz: the motion repeats after 1 / FUNDAMENTAL."""
BANDS = ((0.1, 0.4), (0.4, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0))
"""Of each joint's sines, one in each, Hz: slow ones for the torque's scale, fast ones for inertia
and delay.
"""
TRIES = 20
"""Motions that are drawn, of which the best conditioned one is taken."""
REACH, RANGE = 0.8, 0.35
"""Way from the posture: at most this share of that to the nearer end of a joint, and so far, rad.
"""
FASTEST = 8.0
"""Largest velocity, rad/s."""
EFFORT = 0.4
"""Largest torque that the model needs, as a share of the joint's peak torque."""
ENDLESS = 1e3
"""Peak torque of a joint whose file has none, N·m."""
STIFFNESS, DAMPING = 1.5, 0.03
"""Of the motors: peak torques per rad, and s of the stiffness."""
ROTOR, CROSSING = 1e-4, 60.0
"""Armature that a motor has at least, kg·m² per N·m of its peak torque; largest damping over a
joint's inertia, 1/s: with more, a delay of some milliseconds makes the loop unstable.
"""
RAMP = 1.0
"""In which the motion begins and ends, s."""


@dataclass(frozen=True, eq=False)
class Excitation:
    """Targets of the joints, a row for each tick.

    Attributes:
        t: (n,) s.
        q: (n, joints) rad.
        v: (n, joints) rad/s.
        torque: (n, joints) feedforward by the model, N·m.
        k_p: (joints,) stiffness of the motors, N·m/rad.
        k_d: (joints,) their damping, N·m·s/rad.
        condition: condition number of the worst joint's regressor, of columns of length one.
    """

    t: Vector
    q: Vector
    v: Vector
    torque: Vector
    k_p: Vector
    k_d: Vector
    condition: float

    def command(self, tick: int) -> Command:
        """What a controller sends at a tick."""
        return Command(
            self.torque[tick], q=self.q[tick], v=self.v[tick], k_p=self.k_p, k_d=self.k_d
        )


@checked
def excitation(
    robot: Robot, *, duration: float = 60.0, period: float = 2e-3, seed: int = 0
) -> Excitation:
    """A motion about the standing posture that makes the joints observable, for a robot that hangs
    by its base.

    All joints move at once, each by sines of frequencies of its own, within its ends and torques.
    Of some random motions that one is taken whose worst joint has the best conditioned regressor.
    Watch it before a robot moves: whether links touch is not checked.

    Args:
        robot: whose posture, limits and masses count.
        duration: s.
        period: between ticks, s.
        seed: of the random motions.

    Raises:
        InputError: a number is out of its domain, or the robot has no posture.
    """
    duration = checks.number("duration", duration, low=4.0 * RAMP)
    t: Vector = period * np.arange(
        checks.ticks(duration, checks.number("period", period, low=0.0, strict=True)),
        dtype=np.float64,
    )
    rng, posture = np.random.default_rng(seed), find_posture(robot)
    reach = np.clip(
        REACH * np.minimum(posture - robot.joint_lower, robot.joint_upper - posture), 0.0, RANGE
    )
    peak = np.where(np.isfinite(robot.torque_limit), robot.torque_limit, ENDLESS)
    best = min(
        (_drawn(robot, posture, reach, peak, rng) for _ in range(TRIES)),
        key=lambda series: series.condition,
    )
    q, v, a = best.at(t)
    # Ramps at both ends.
    x = np.clip(np.minimum(t, t[-1] - t) / RAMP, 0.0, 1.0)[:, None]
    sign = np.where(t < 0.5 * t[-1], 1.0, -1.0)[:, None] / RAMP
    s, ds, dds = (
        x**2 * (3.0 - 2.0 * x),
        sign * 6.0 * x * (1.0 - x),
        (6.0 - 12.0 * x) / RAMP**2 * ((x > 0.0) & (x < 1.0)),
    )
    targets = posture + s * q, s * v + ds * q, s * a + 2.0 * ds * v + dds * q
    torque = needed(robot, *targets)
    model = rigid(robot)
    upper = np.triu(
        pin.crba(model, model.createData(), np.append(pin.neutral(model)[:7], posture))[6:, 6:]
    )
    inertia = 1.0 / np.diag(np.linalg.inv(upper + np.triu(upper, 1).T + np.diag(ROTOR * peak)))
    k_d = np.minimum(DAMPING * STIFFNESS * peak, CROSSING * inertia)
    return Excitation(t, *targets[:2], torque, k_d / DAMPING, k_d, best.condition)


@dataclass(frozen=True, eq=False)
class _Series:
    """Sums of sines: (sines, joints) amplitudes, rad, angular frequencies, rad/s, and phases, rad."""

    amplitude: Vector
    frequency: Vector
    phase: Vector
    condition: float = np.inf

    def at(self, t: Vector) -> tuple[Vector, Vector, Vector]:
        """(n, joints) angles about the posture, velocities and accelerations."""
        angle = t[:, None, None] * self.frequency + self.phase
        a, w, sine, cosine = self.amplitude, self.frequency, np.sin(angle), np.cos(angle)
        return (a * sine).sum(1), (a * w * cosine).sum(1), -(a * w**2 * sine).sum(1)


def needed(robot: Robot, q: Vector, v: Vector, a: Vector) -> Vector:
    """(n, joints) torques of the rigid model that hangs by its base, N·m, for (n, joints) joint
    motions.
    """
    model, still = rigid(robot), np.zeros(6)
    data, pose = model.createData(), pin.neutral(model)[:7]
    rows = zip(q, v, a, strict=True)
    return np.array(
        [
            pin.rnea(model, data, *(np.append(*x) for x in ((pose, x), (still, y), (still, z))))[6:]
            for x, y, z in rows
        ]
    )


def _drawn(
    robot: Robot, posture: Vector, reach: Vector, peak: Vector, rng: np.random.Generator
) -> _Series:
    """A random motion within the limits, and its condition number."""
    low, high = (np.array(BANDS)[:, k, None] for k in (0, 1))
    shape = len(BANDS), len(posture)
    frequency = FUNDAMENTAL * np.round(rng.uniform(low, high, shape) / FUNDAMENTAL)
    series = _Series(
        rng.uniform(0.7, 1.3, shape), 2.0 * np.pi * frequency, rng.uniform(-np.pi, np.pi, shape)
    )
    t = np.arange(0.0, 1.0 / FUNDAMENTAL, 0.05)
    for _ in range(3):  # torques are not proportional to the amplitudes: gravity
        q, v, a = series.at(t)
        torque = needed(robot, posture + q, v, a)
        still = needed(
            robot,
            np.tile(posture, (1, 1)),
            np.zeros((1, len(posture))),
            np.zeros((1, len(posture))),
        )
        moving = np.abs(torque - still).max(axis=0)
        factors = (
            reach / np.abs(q).max(axis=0),
            FASTEST / np.abs(v).max(axis=0),
            EFFORT * peak / moving,
        )
        series = replace(series, amplitude=series.amplitude * np.min(factors, axis=0))
    conditions = []
    for columns in zip(
        torque.T, np.gradient(torque, t, axis=0).T, a.T, v.T, np.sign(v).T, strict=True
    ):
        matrix = np.column_stack((*columns, np.ones(len(t))))
        conditions.append(
            np.linalg.cond(matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-12))
        )
    return replace(series, condition=float(np.max(conditions)))
