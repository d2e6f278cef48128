"""Actuators of the true robot that are not what the controllers believe: slow or weak motors,
friction, thrusters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.kernels import kernel
from harpy_pin.model.record import ZERO, RecordOf, Records, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import all_finite
from harpy_pin.simulation.thrusters import Thrusters

MAX_BANDWIDTH = 1e6  # Hz
MAX_TORQUE = 1e6  # N·m, and N·m·s/rad
POSITIVE: dict[str, Any] = {"low": 0.0, "high": MAX_TORQUE, "strict": True}


@dataclass(frozen=True, kw_only=True)
class Actuators(checks.Checked):
    """What motors and joints of the true robot do that the model does not say; nothing by default.

    Attributes:
        bandwidth: of the motors, Hz: the torque follows the command with the time constant 1 / (2π
            bandwidth). The motors have settled at the first command. None: torques are there at
            once.
        torque_share: largest torque, as a share of the model's peak torque; the plant clips what is
            beyond. None: the plant clips nothing, as controllers have limits of their own.
        viscous_friction: of every joint, N·m·s/rad, besides the model's damping.
        coulomb_friction: of every joint, N·m, besides the model's dry friction: a joint at rest
            stays at rest under smaller torques.
        thrusters: lag and limits of the thrusts, also as a mapping.
        no_load_speed: at which a motor under full voltage has no torque left, at the joint, rad/s:
            the torque is at most stall (1 − ω/ω₀) along the speed ω, and stall (1 + ω/ω₀) against
            it. None: torques know no speed.
        no_load_share: instead of that, for each joint of its own, as a share of the velocity limit
            that the model gives it.
        stall_share: torque of a motor at rest under full voltage, as a share of the model's peak
            torque. None: 1.
    """

    whose = "actuators' "
    bandwidth: float | None = checks.setting(None, low=0.0, high=MAX_BANDWIDTH, strict=True)
    torque_share: float | None = checks.setting(None, **POSITIVE)
    viscous_friction: float = checks.setting(0.0, low=0.0, high=MAX_TORQUE)
    coulomb_friction: float = checks.setting(0.0, low=0.0, high=MAX_TORQUE)
    thrusters: Thrusters = checks.setting(Thrusters(), checks.record, kind=Thrusters)
    no_load_speed: float | None = checks.setting(None, **POSITIVE)
    no_load_share: float | None = checks.setting(None, **POSITIVE)
    stall_share: float | None = checks.setting(None, **POSITIVE)

    def __post_init__(self) -> None:
        super().__post_init__()
        told = (self.no_load_speed is not None) + (self.no_load_share is not None)
        if told > 1:
            raise InputError(
                "a no_load_speed and a no_load_share say the same",
                name="no_load_share",
                value=self.no_load_share,
            )
        if self.stall_share is not None and not told:
            raise InputError(
                "a stall_share needs a no_load_speed or a no_load_share",
                name="stall_share",
                value=self.stall_share,
            )

    def __bool__(self) -> bool:
        """Whether there is anything that the model does not say."""
        return self != Actuators()

    @checked
    def damped(self, robot: Robot) -> Robot:
        """The robot with the viscous friction in its joints; itself where there is none.

        Args:
            robot: stays as it is.
        """
        if self.viscous_friction == 0.0:
            return robot
        return robot.with_joints(damping=robot.damping + self.viscous_friction)

    @checked
    def coulomb(self, robot: Robot) -> Vector:
        """(joints,) Coulomb friction of each joint, with that of the model, N·m.

        Args:
            robot: whose joints.
        """
        return self.coulomb_friction + robot.dry_friction


class MotorsRecord(RecordOf):
    """The motors."""

    rate: float  # 1 / time constant, 1/s; infinite without lag
    limit: Vector  # (joints,) largest torque, N·m
    stall: Vector  # (joints,) torque at rest under full voltage, N·m
    no_load_speed: Vector  # (joints,) rad/s; infinite where torques know no speed
    torque: Vector = sized("joints")  # (joints,) at the end of the last step, N·m
    mean_torque: Vector = sized("joints")  # (joints,) over the last step, N·m
    settled: int = ZERO  # 0 before the first command
    # (joints,) of each joint's angle in q; of its cosine where it has no bounds
    place: NDArray[np.int64]
    unbounded: NDArray[np.int64]  # (joints,) 1 for a joint whose q is a cosine and a sine
    peak: Vector  # (joints,) torque that a motor with a law of its own does not exceed, N·m
    has_law: int = ZERO  # whether the command has the motors' law below
    law: Vector = sized(
        4, "joints"
    )  # targets q* and q̇*, stiffness and damping: rad, rad/s, N·m/rad, N·m·s/rad


def motors_of(robot: Robot) -> dict[str, Any]:
    """What :func:`motors_record` takes of a robot."""
    place, unbounded = robot.layout
    return {
        "peak": robot.torque_limit,
        "fastest": robot.velocity_limit,
        "place": place,
        "unbounded": unbounded,
    }


def motors_record(
    actuators: Actuators,
    peak: Vector,
    fastest: ArrayLike = math.inf,
    place: NDArray[np.int64] | None = None,
    unbounded: ArrayLike = 0,
) -> Records[MotorsRecord]:
    """The motors, for kernels.

    ``peak`` are the model's peak torques (joints,), N·m, ``fastest`` its velocity limits, rad/s,
    the rest as in the record.
    """
    joints, bandwidth, share = len(peak), actuators.bandwidth, actuators.torque_share
    place = np.arange(7, 7 + joints) if place is None else place
    no_load = np.full(joints, math.inf)
    if actuators.no_load_speed is not None:
        no_load[:] = actuators.no_load_speed
    elif actuators.no_load_share is not None:
        no_load[:] = actuators.no_load_share * np.asarray(fastest)
    return make_record(
        MotorsRecord,
        {"joints": joints},
        rate=math.inf if bandwidth is None else 2.0 * math.pi * bandwidth,
        limit=np.full(joints, math.inf) if share is None else share * peak,
        stall=peak * (1.0 if actuators.stall_share is None else actuators.stall_share),
        no_load_speed=no_load,
        place=np.asarray(place, np.int64),
        unbounded=np.full(joints, unbounded, np.int64),
        peak=peak,
    )


@kernel
def take_law(m: MotorsRecord, law: Vector) -> bool:
    """Give the motors a law (4, joints) from now on; whether it is one: of finite numbers, and of
    that shape.
    """
    if law.shape != m.law.shape or not all_finite(law.reshape((law.size,))):
        return False
    m.law[:] = law
    m.has_law = 1
    return True


@kernel
def drive_motors(m: MotorsRecord, command: Vector, q: Vector, v: Vector, dt: float) -> None:
    """Torques of a step dt, s, under a constant command (joints,), N·m, at a state q (nq,), v (6 +
    joints,).

    The exact mean of the lag over the step goes into ``mean_torque``.
    """
    x = m.rate * dt
    remaining = np.exp(-x)
    for j in range(command.shape[0]):
        goal = command[j]
        if m.has_law != 0:
            k = m.place[j]
            off = m.law[0, j] - (np.arctan2(q[k + 1], q[k]) if m.unbounded[j] else q[k])
            if m.unbounded[j]:  # the short way round
                off -= 2.0 * np.pi * np.floor(off / (2.0 * np.pi) + 0.5)
            goal += m.law[2, j] * off + m.law[3, j] * (m.law[1, j] - v[6 + j])
            goal = min(max(goal, -m.peak[j]), m.peak[j])
        goal = min(max(goal, -m.limit[j]), m.limit[j])
        if m.no_load_speed[j] < np.inf:
            share = v[6 + j] / m.no_load_speed[j]
            goal = min(max(goal, -m.stall[j] * (1.0 + share)), m.stall[j] * (1.0 - share))
        if m.settled == 0 or x == np.inf:
            m.torque[j] = m.mean_torque[j] = goal
        else:
            m.mean_torque[j] = goal + (m.torque[j] - goal) * (1.0 - remaining) / x
            m.torque[j] = goal + (m.torque[j] - goal) * remaining
    m.settled = 1
