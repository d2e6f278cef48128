"""Thrusts that follow their commands by a lag, and legs that make up for it.

With the magnitude's time constant T, a thrust of ℓ under the constant command c has, in the mean of a tick h,

    u = c + m (ℓ − c),    m = (1 − e^(−h/T)) T / h.

A controller first solves its program as if thrusts were there at once: these are the commands. Then it solves it once
more with the thrusts fixed at the u that follows, so that the legs do what the thrusts do not do yet. The thrust ℓ is
not measured: it is what the commands so far make of it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.record import ZERO, RecordOf, Records, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.weights import WholeBodyLimits, thrust_box

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord

__all__: list[str] = []

SMALL = 1e-9
"""Thrust without a direction, N."""


class ThrustLagRecord(RecordOf):
    """What is known of the thrusts.

    Attributes:
        remaining: share of the distance to the command that a tick leaves.
        mean_share: m, that share in the mean of the tick.
        least: (thrust variables,) of a program without lag, N.
        largest: (thrust variables,) likewise.
        goal: (thrusters,) of the last command: a magnitude, of a rotor its thrust, N.
        level: (thrusters,) at the beginning of the tick, N.
        direction: (thrusters, 3) of the last command, world axes; not of rotors.
        present: (thrust variables,) in the mean of the tick, N.
        settled: 0 before the first command.
    """

    remaining: float
    mean_share: float
    least: Vector
    largest: Vector
    goal: Vector = sized("thrusters")
    level: Vector = sized("thrusters")
    direction: Vector = sized("thrusters", 3)
    present: Vector = sized("thrusts")
    settled: int = ZERO


def thrust_lag_record(
    robot: Robot, limits: WholeBodyLimits, *, lag: float, period: float
) -> Records[ThrustLagRecord] | None:
    """What is known of a robot's thrusts; None where they have no lag.

    Args:
        robot: who has them.
        limits: of the program.
        lag: T, s.
        period: h, s.
    """
    if lag == 0.0 or not robot.n_thrust:
        return None
    least, largest = thrust_box(robot, limits)
    return make_record(
        ThrustLagRecord,
        robot.sizes | {"thrusters": len(robot.thrusters)},
        remaining=math.exp(-period / lag),
        mean_share=-math.expm1(-period / lag) * lag / period,
        least=least,
        largest=largest,
    )


@kernel
def advance_thrusts(r: ThrustLagRecord) -> None:
    """Thrusts at the beginning of the next tick."""
    for k in range(r.goal.shape[0]):
        r.level[k] = r.goal[k] + r.remaining * (r.level[k] - r.goal[k])


@kernel
def command_thrusts(r: ThrustLagRecord, d: DynamicsRecord, variables: Vector, command: Vector) -> None:
    """Command the thrusts of a program without lag, and find those of this tick, ``present``.

    Args:
        r: element of the record.
        d: of the robot's dynamics.
        variables: (thrust variables, or more) N.
        command: (thrusters, 3) out: world axes, N.
    """
    count = r.goal.shape[0]
    free = (r.least.shape[0] - count) // 2  # three variables of each, one of each rotor
    for k in range(count):
        c = 3 * k if k < free else 2 * free + k
        goal = variables[c]
        if k < free:
            goal = np.sqrt(goal * goal + variables[c + 1] ** 2 + variables[c + 2] ** 2)
        if r.settled == 0:
            r.level[k] = goal
        r.goal[k] = goal
        now = goal + r.mean_share * (r.level[k] - goal)
        if k >= free:
            r.present[c] = now
        for i in range(3):
            if k >= free:
                command[k, i] = goal * d.rotor_axis[k - free, i]
                continue
            command[k, i] = variables[c + i]
            if goal > SMALL:
                r.direction[k, i] = variables[c + i] / goal
            r.present[c + i] = now * r.direction[k, i]
    r.settled = 1


@kernel
def bound_thrusts(r: ThrustLagRecord, fixed: bool, lower: Vector, upper: Vector) -> None:
    """Bounds of a program: as if there were no lag, or the thrusts of this tick.

    Args:
        r: element of the record.
        fixed: whether they are those of this tick.
        lower: (thrust variables, or more) of the program, out.
        upper: likewise.
    """
    for c in range(r.present.shape[0]):
        lower[c] = r.present[c] if fixed else r.least[c]
        upper[c] = r.present[c] if fixed else r.largest[c]
