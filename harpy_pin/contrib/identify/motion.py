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
from harpy_pin.model.posture import find_posture
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, Vector

FUNDAMENTAL = 0.1  # Hz, of which all frequencies are multiples: the motion repeats after 10 s
BANDS = ((0.1, 0.4), (0.4, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0))
"""Of each joint's sines, one in each, Hz: slow ones for the torque's scale, fast ones for inertia
and delay.
"""
TRIES = 20  # motions that are drawn, of which the best conditioned one is taken
REACH = 0.8  # largest way from the posture, as a share of that to the nearer end of the joint
RANGE = 0.35  # largest way from the posture, rad
FASTEST = 8.0  # largest velocity, rad/s
EFFORT = 0.4  # largest torque that the model needs, as a share of the joint's peak torque
ENDLESS = 1e3  # peak torque of a joint whose file has none, N·m
STIFFNESS = 1.5  # largest stiffness of a motor, in peak torques per rad
DAMPING = 0.03  # of a motor, in s of its stiffness
ROTOR = 1e-4  # armature that a motor has at least, kg·m² per N·m of its peak torque
CROSSING = 60.0  # largest damping over inertia, 1/s: with more, some ms of delay are unstable
RAMP = 1.0  # in which the motion begins and ends, s
LONGEST = 3600.0  # largest duration, s


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

    Arrays are read only.
    """

    t: Vector
    q: Vector
    v: Vector
    torque: Vector
    k_p: Vector
    k_d: Vector
    condition: float

    def __post_init__(self) -> None:
        for array in (self.t, self.q, self.v, self.torque, self.k_p, self.k_d):
            array.flags.writeable = False

    def signals(self) -> dict[str, Vector]:
        """What the motors are sent, by the names of the log's signals; the log lacks but ``q``."""
        gains = {name: np.tile(getattr(self, name), (len(self.t), 1)) for name in ("k_p", "k_d")}
        targets = {"target_q": self.q, "target_v": self.v, "torque": self.torque}
        return {"t": self.t, **targets, **gains}

    def command(self, tick: int) -> Command:
        """What a controller sends at a tick, counted from zero."""
        checks.whole("tick", tick, high=len(self.t) - 1)
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
        duration: s, at least 4.
        period: between ticks, s.
        seed: of the random motions.

    Raises:
        InputError: a number is out of its domain, or the robot has no posture.
    """
    duration = checks.number("duration", duration, low=4.0 * RAMP, high=LONGEST)
    period = checks.number("period", period, low=1e-4, high=0.01)
    seed = checks.whole("seed", seed)
    rng, posture = np.random.default_rng(seed), find_posture(robot)
    low, high = posture - robot.joint_lower, robot.joint_upper - posture
    reach = np.clip(REACH * np.minimum(low, high), 0.0, RANGE)
    peak = np.where(np.isfinite(robot.torque_limit), robot.torque_limit, ENDLESS)
    tries = [_drawn(robot, posture, reach, peak, rng) for _ in range(TRIES)]
    best = min(tries, key=lambda series: series.condition)
    t = period * np.arange(float(checks.ticks(duration, period)))
    x = np.clip(np.minimum(t, t[-1] - t) / RAMP, 0.0, 1.0)[:, None]
    q, v, a = _moved(t, posture + x**3 * (10.0 - 15.0 * x + 6.0 * x**2) * best.at(t))
    model = rigid(robot)
    held = np.append(pin.neutral(model)[:7], posture)
    upper = np.triu(pin.crba(model, model.createData(), held)[6:, 6:])
    alone = np.linalg.inv(upper + np.triu(upper, 1).T + np.diag(ROTOR * peak))
    k_d = np.minimum(DAMPING * STIFFNESS * peak, CROSSING / np.diag(alone))
    return Excitation(t, q, v, hung_torques(model, q, v, a), k_d / DAMPING, k_d, best.condition)


@dataclass(frozen=True, eq=False)
class _Series:
    """Sums of sines: (sines, joints) amplitudes, rad, frequencies, rad/s, and phases, rad."""

    amplitude: Vector
    frequency: Vector
    phase: Vector
    condition: float = np.inf

    def at(self, t: Vector) -> Vector:
        """(n, joints) angles about the posture."""
        angle = t[:, None, None] * self.frequency + self.phase
        return np.asarray((self.amplitude * np.sin(angle)).sum(axis=1))


def _moved(t: Vector, q: Vector) -> tuple[Vector, Vector, Vector]:
    """Angles with their velocities and accelerations."""
    v = np.gradient(q, t, axis=0)
    return q, v, np.gradient(v, t, axis=0)


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
    t, model = np.arange(0.0, 1.0 / FUNDAMENTAL, 0.02), rigid(robot)
    still = hung_torques(model, posture[None], *np.zeros((2, 1, len(posture))))
    for _ in range(3):  # torques are not proportional to the amplitudes
        q, v, a = _moved(t, series.at(t))
        torque = hung_torques(model, posture + q, v, a)
        limits = zip((q, v, torque - still), (reach, FASTEST, EFFORT * peak), strict=True)
        factors = [limit / np.maximum(np.abs(x).max(axis=0), 1e-9) for x, limit in limits]
        series = replace(series, amplitude=series.amplitude * np.min(factors, axis=0))
    parts = torque, np.gradient(torque, t, axis=0), a, v, np.sign(v), np.ones_like(v)
    matrix = np.stack(parts).transpose(2, 1, 0)
    matrix = matrix / np.maximum(np.linalg.norm(matrix, axis=1, keepdims=True), 1e-12)
    return replace(series, condition=float(np.linalg.cond(matrix).max()))


def hung_torques(model: pin.Model, q: Vector, v: Vector, a: Vector) -> Vector:
    """(n, joints) torques of a model that hangs level by its base, N·m, for (n, joints) motions."""
    data, held, still = model.createData(), pin.neutral(model)[:7], np.zeros(6)
    return np.array(
        [
            pin.rnea(model, data, np.append(held, x), np.append(still, y), np.append(still, z))[6:]
            for x, y, z in zip(q, v, a, strict=True)
        ]
    )
