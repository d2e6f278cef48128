"""Thrusts that follow their commands by a lag: commands that lead, and legs that make up for the rest.

With the magnitude's time constant T, a thrust of ℓ under the constant command c has after a tick h, and in its mean,

    ℓ' = c + ρ (ℓ − c),    ρ = e^(−h/T),
    u  = c + m (ℓ − c),    m = (1 − ρ) T / h.

A controller solves its program twice:

1. With thrusts free. Commands are those by which the thrusts are there at the end of the tick, c = (|u| − ρ ℓ)/(1 − ρ),
   within their limits. The cost of a thrust is w ((1 − s) |u|² + s |u − ρ ℓ d|²): the first part is its price, the
   second that of its change from what is there without a command, in the last direction d. Up to a constant this is
   w |u − s ρ ℓ d|², so the program has the thrusts beyond s ρ ℓ d as variables. Without the second part a thrust that
   is needed no more, and is still there, points somewhere else in each tick.
2. With the thrusts fixed at the u that follows from the commands, so that the legs do what the thrusts do not do yet.

The thrust ℓ is not measured: it is what the commands so far make of it.
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
LEAST = 1e-6
"""Least magnitude of a command, which keeps its direction, N."""
CHANGE_SHARE = 0.8
"""s: share of a thrust's weight that is on its change. From 0.5 to 0.95 walks are alike; without noise they slip alike,
with noise less the larger it is, and with more thrust."""


class ThrustLagRecord(RecordOf):
    """What is known of the thrusts.

    Attributes:
        remaining: share of the distance to the command that a tick leaves.
        mean_share: m, that share in the mean of the tick.
        most: largest magnitude of a thruster, N.
        least: (thrust variables,) of a program without lag, N.
        largest: (thrust variables,) likewise.
        goal: (thrusters,) of the last command: a magnitude, of a rotor its thrust, N.
        level: (thrusters,) at the beginning of the tick, N.
        direction: (thrusters, 3) of the last command, world axes; not of rotors.
        kept: (thrust variables,) s ρ ℓ d, what the program's variables are counted from, N.
        present: (thrust variables,) in the mean of the tick, N.
        settled: 0 before the first command.
    """

    remaining: float
    mean_share: float
    most: float
    least: Vector
    largest: Vector
    goal: Vector = sized("thrusters")
    level: Vector = sized("thrusters")
    direction: Vector = sized("thrusters", 3)
    kept: Vector = sized("thrusts")
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
        most=robot.thrust_limit,
        least=least,
        largest=largest,
    )


@kernel
def advance_thrusts(r: ThrustLagRecord) -> None:
    """Thrusts at the beginning of the next tick, and what is kept of them."""
    count = r.goal.shape[0]
    free = (r.least.shape[0] - count) // 2  # three variables of each, one of each rotor
    for k in range(count):
        r.level[k] = r.goal[k] + r.remaining * (r.level[k] - r.goal[k])
        keep = CHANGE_SHARE * r.remaining * r.level[k] if r.settled else 0.0
        if k >= free:
            r.kept[2 * free + k] = keep
            continue
        for i in range(3):
            r.kept[3 * k + i] = keep * r.direction[k, i]


@kernel
def count_from_kept(r: ThrustLagRecord, d: DynamicsRecord, sign: float) -> None:
    """Make the thrusts beyond those kept the variables of the programs, by an external force; or undo it.

    Args:
        r: element of the record.
        d: of the robot's dynamics, whose bias changes.
        sign: 1, or −1 to undo it.
    """
    for i in range(d.bias.shape[0]):
        for c in range(r.kept.shape[0]):
            d.bias[i] -= sign * d.thruster_jacobian[c, i] * r.kept[c]


@kernel
def command_thrusts(r: ThrustLagRecord, d: DynamicsRecord, variables: Vector, command: Vector) -> None:
    """Command the thrusts of a program, and find those of this tick, ``present``.

    Args:
        r: element of the record.
        d: of the robot's dynamics.
        variables: (thrust variables, or more) of the program, N.
        command: (thrusters, 3) out: world axes, N.
    """
    count = r.goal.shape[0]
    free = (r.least.shape[0] - count) // 2
    for k in range(count):
        if k >= free:
            c = 2 * free + k
            r.goal[k] = _leading(r, k, variables[c] + r.kept[c], r.least[c], r.largest[c])
            r.present[c] = r.goal[k] + r.mean_share * (r.level[k] - r.goal[k])
            for i in range(3):
                command[k, i] = r.goal[k] * d.rotor_axis[k - free, i]
            continue
        size = 0.0
        for i in range(3):
            size += (variables[3 * k + i] + r.kept[3 * k + i]) ** 2
        size = np.sqrt(size)
        r.goal[k] = _leading(r, k, size, LEAST, r.most)
        now = r.goal[k] + r.mean_share * (r.level[k] - r.goal[k])
        for i in range(3):
            if size > SMALL:
                r.direction[k, i] = (variables[3 * k + i] + r.kept[3 * k + i]) / size
            r.present[3 * k + i] = now * r.direction[k, i]
            command[k, i] = r.goal[k] * r.direction[k, i]
    r.settled = 1


@kernel
def _leading(r: ThrustLagRecord, k: int, end: float, least: float, most: float) -> float:
    """Command of a thruster, within limits, by which its thrust is ``end`` at the end of the tick."""
    if r.settled == 0:
        r.level[k] = end
    goal: float = min(max((end - r.remaining * r.level[k]) / (1.0 - r.remaining), least), most)
    return goal


@kernel
def bound_thrusts(r: ThrustLagRecord, fixed: bool, lower: Vector, upper: Vector) -> None:
    """Bounds of a program: those of free thrusts, or the thrusts of this tick.

    Args:
        r: element of the record.
        fixed: whether they are those of this tick.
        lower: (thrust variables, or more) of the program, out.
        upper: likewise.
    """
    for c in range(r.present.shape[0]):
        lower[c] = (r.present[c] if fixed else r.least[c]) - r.kept[c]
        upper[c] = (r.present[c] if fixed else r.largest[c]) - r.kept[c]


@kernel
def add_kept(r: ThrustLagRecord, variables: Vector) -> None:
    """Make thrusts of a program's variables.

    Args:
        r: element of the record.
        variables: (thrust variables, or more) N.
    """
    for c in range(r.kept.shape[0]):
        variables[c] += r.kept[c]
