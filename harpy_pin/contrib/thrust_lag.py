"""Thrusts that follow their commands by a lag: commands that lead, and legs that make up for the
rest.

With the magnitude's time constant T, a thrust of ℓ under the constant command c has after a tick h,
and in its mean,

    ℓ' = c + ρ (ℓ − c),    ρ = e^(−h/T);        u = c + m (ℓ − c),    m = (1 − ρ) T / h.

A controller solves its program twice:

1. With thrusts free. Commands lead: as far as limits allow, thrusts follow the program's by the lag
   T_f = 10 ms in place of T, c = ℓ + (1 − ρ_f)/(1 − ρ) (|u| − ℓ) with ρ_f = e^(−h/T_f). Noise is
   commanded some T/T_f times as large. The cost of a thrust is w ((1 − s) |u|² + s |u − ρ ℓ d|²):
   the first part is its price, the second that of its change from what is there without a command,
   in the last direction d. Up to a constant this is w |u − s ρ ℓ d|², so the program has the
   thrusts beyond s ρ ℓ d as variables. Without the second part a thrust that is needed no more, and
   is still there, points somewhere else in each tick.
2. With the thrusts fixed at the u that follows from the commands, so that the legs do what the
   thrusts do not do yet.

Where directions lag, too, their commands lead, too: they are farther on the great circle to where
they should be. Neither thrust nor direction is measured: they are what the commands so far make of
them.
"""

from __future__ import annotations

import math

import numpy as np

from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.stage import Stage
from harpy_pin.controllers.tick import TaskTickRecord
from harpy_pin.gaits.gait import Gait, GaitTargetRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import ZERO, RecordOf, Records, fields, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.simulation.thrusters import NO_THRUST, turn
from harpy_pin.wbc.weights import thrust_box

LEAST = 1e-6
"""Least magnitude of a command, which keeps its direction, N."""
FOLLOWED = 0.01
"""T_f, s: lag that leading commands leave."""
FARTHEST = 2.5
"""Largest angle between a thrust's direction and that of its command, rad: near π rounding chooses
the great circle.
"""
CHANGE_SHARE = 0.8
"""s: share of a thrust's weight that is on its change."""


class ThrustLagRecord(RecordOf):
    """What is known of the thrusts."""

    remaining: float  # share of the distance to the command that a tick leaves
    mean_share: float  # m, that share in the mean of the tick
    lead: float  # (1 − ρ_f)/(1 − ρ); 1 where the lag is shorter than T_f
    turn_lead: float  # the same of directions
    most: float  # largest magnitude of a thruster, N
    turn_remaining: float  # share of the angle to the command's direction that a tick leaves
    least: Vector  # (thrust variables,) least ones of a program without lag, N
    largest: Vector  # (thrust variables,) the largest ones, N
    goal: Vector = sized(
        "thrusters"
    )  # (thrusters,) of the last command: a magnitude, of a rotor its thrust, N
    level: Vector = sized("thrusters")  # (thrusters,) at the beginning of the tick, N
    direction: Vector = sized(
        "thrusters", 3
    )  # (thrusters, 3) at the end of the last tick, body axes; not of rotors
    kept: Vector = sized(
        "thrusts"
    )  # (thrust variables,) s ρ ℓ d, what the program's variables are counted from, N
    present: Vector = sized("thrusts")  # (thrust variables,) in the mean of the tick, N
    settled: int = ZERO  # 0 before the first command


def thrust_lag_record(robot: Robot, parameters: WholeBodyParameters) -> Records[ThrustLagRecord]:
    """What is known of a robot's thrusts."""
    lag, turning, period = parameters.thrust_lag, parameters.thrust_turning_lag, parameters.period
    least, largest = thrust_box(robot, parameters.limits)
    return make_record(
        ThrustLagRecord,
        robot.sizes,
        remaining=math.exp(-period / lag) if lag > 0.0 else 0.0,
        mean_share=-math.expm1(-period / lag) * lag / period if lag > 0.0 else 0.0,
        lead=_lead(lag, period),
        turn_lead=_lead(turning, period),
        turn_remaining=math.exp(-period / turning) if turning > 0.0 else 0.0,
        most=robot.thrust_limit,
        least=least,
        largest=largest,
    )


def _lead(lag: float, period: float) -> float:
    """How far commands go beyond what is desired, as a factor."""
    return math.expm1(-period / FOLLOWED) / math.expm1(-period / lag) if lag > FOLLOWED else 1.0


@kernel
def advance_thrusts(r: ThrustLagRecord) -> None:
    """Thrusts at the beginning of the next tick."""
    r.level[:] = r.goal + r.remaining * (r.level - r.goal)


@kernel
def keep_thrusts(r: ThrustLagRecord, rotation: Vector) -> None:
    """What is kept of the thrusts, for a body of this rotation (3, 3) to world axes."""
    count = r.goal.shape[0]
    free = (r.least.shape[0] - count) // 2  # three variables of each, one of each rotor
    share = CHANGE_SHARE * r.remaining if r.settled else 0.0
    level = (share * r.level[:free])[:, None]
    r.kept[: 3 * free].reshape((free, 3))[:] = level * (r.direction[:free] @ rotation.T)
    r.kept[3 * free :] = share * r.level[free:]


@kernel
def count_from_kept(r: ThrustLagRecord, d: DynamicsRecord, sign: float) -> None:
    """Make the thrusts beyond those kept the variables of the programs, by an external force in the
    bias.

    The sign is 1, or −1 to undo it.
    """
    d.bias -= sign * (d.thruster_jacobian.T @ r.kept)


@kernel
def command_thrusts(
    r: ThrustLagRecord, d: DynamicsRecord, variables: Vector, command: Vector
) -> None:
    """Command the thrusts of a program's variables, N, and find those of this tick, ``present``.

    ``command`` (thrusters, 3) is written: world axes, N.
    """
    count = r.goal.shape[0]
    free = (r.least.shape[0] - count) // 2
    for k in range(free):
        command[k] = variables[3 * k : 3 * k + 3] + r.kept[3 * k : 3 * k + 3]
        size = np.sqrt(command[k] @ command[k])
        r.goal[k] = _leading(r, k, size, LEAST, r.most)
        now = r.goal[k] + r.mean_share * (r.level[k] - r.goal[k])
        _lead_direction(r, k, d.tree.rotation, size, command[k])
        r.present[3 * k : 3 * k + 3] = now * (d.tree.rotation @ r.direction[k])
        command[k] *= r.goal[k]
    for k in range(free, count):
        c = 2 * free + k
        r.goal[k] = _leading(r, k, variables[c] + r.kept[c], r.least[c], r.largest[c])
        r.present[c] = r.goal[k] + r.mean_share * (r.level[k] - r.goal[k])
        command[k] = r.goal[k] * d.rotor_axis[k - free]
    r.settled = 1


@kernel
def _leading(r: ThrustLagRecord, k: int, desired: float, least: float, most: float) -> float:
    """Command of a thruster, within limits, by which its thrust follows the desired one."""
    if r.settled == 0:
        r.level[k] = desired
    goal: float = min(max(r.level[k] + r.lead * (desired - r.level[k]), least), most)
    return goal


@kernel
def _lead_direction(
    r: ThrustLagRecord, k: int, rotation: Vector, size: float, command: Vector
) -> None:
    """Make a command (3,) the direction, of length one, by which the thrust's follows its own.

    It is on the great circle through both, at most :data:`FARTHEST` from the thrust's.
    """
    old = rotation @ r.direction[k]
    if size <= NO_THRUST:
        command[:] = old
        return
    command /= size
    angle = np.arccos(min(max(command @ old, -1.0), 1.0))
    sine = np.sin(angle)
    if r.turn_remaining > 0.0 and r.settled and sine > 1e-6:
        ahead = min(angle * r.turn_lead, FARTHEST)
        command[:] = (np.sin(angle - ahead) * old + np.sin(ahead) * command) / sine
        turn(r.direction[k], rotation, command, 1.0, r.turn_remaining)
        r.direction[k] /= np.sqrt(r.direction[k] @ r.direction[k])
    else:
        turn(r.direction[k], rotation, command, 1.0, 0.0)


@kernel
def free_thrusts(r: ThrustLagRecord, d: DynamicsRecord, lower: Vector, upper: Vector) -> None:
    """Before the first program, with these bounds of its thrusts, N: they are free."""
    keep_thrusts(r, d.tree.rotation)
    thrusts = r.present.shape[0]
    lower[:thrusts], upper[:thrusts] = r.least - r.kept, r.largest - r.kept
    count_from_kept(r, d, 1.0)


@kernel
def fix_thrusts(r: ThrustLagRecord, lower: Vector, upper: Vector) -> None:
    """Before the second program: its thrusts are those of this tick."""
    thrusts = r.present.shape[0]
    lower[:thrusts] = upper[:thrusts] = r.present - r.kept


@kernel
def release_thrusts(r: ThrustLagRecord, d: DynamicsRecord, variables: Vector) -> None:
    """After it: make thrusts, N, of its variables."""
    variables[: r.kept.shape[0]] += r.kept
    count_from_kept(r, d, -1.0)


class LaggedTickRecord(TaskTickRecord):
    """A whole-body controller of a robot whose thrusts lag."""

    lag: ThrustLagRecord  # what is known of them


@kernel
def free(r: LaggedTickRecord, lower: Vector, upper: Vector, inputs: Vector, usable: bool) -> None:
    """Before the first optimum."""
    free_thrusts(r.lag, r.dynamics, lower, upper)


@kernel
def fix(r: LaggedTickRecord, lower: Vector, upper: Vector, inputs: Vector, usable: bool) -> None:
    """Between both: the command, where the first one is ``usable``."""
    if usable:
        command_thrusts(r.lag, r.dynamics, inputs, r.thrust)
    fix_thrusts(r.lag, lower, upper)


@kernel
def release(
    r: LaggedTickRecord, lower: Vector, upper: Vector, inputs: Vector, usable: bool
) -> None:
    """After the second one."""
    release_thrusts(r.lag, r.dynamics, inputs)


@kernel
def advance(
    r: LaggedTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The stage that closes a tick: thrusts at the beginning of the next."""
    advance_thrusts(r.lag)


def make_stage(gait: Gait, parameters: WholeBodyParameters) -> Stage | None:
    """What a whole-body controller of a robot with thrusts does about their lag."""
    if not gait.robot.n_thrust:
        return None
    return Stage(
        name="lag",
        memory=fields(thrust_lag_record(gait.robot, parameters)),
        around_optimum=(free, fix, release),
        closing=(advance,),
    )
