"""An estimate of the friction in the joints that the model does not have.

The joints' rows of the equations of motion leave it over,

    φ = τ + J_fᵀ f + J_tᵀ u − M a − n − B v,    a = Δv / period,

from the last command, the measured contact forces and two measured velocities. For every joint,
least squares with exponential forgetting fit φ = b v + c tanh(v / ``KNEE``) with b, c ≥ 0: viscous
and Coulomb friction. The fit is drawn to zero where a joint has hardly moved. The controllers' bias
forces then contain it. Ticks in which a contact force changes by more than ``IMPACT`` are left out.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.stage import Stage
from harpy_pin.controllers.tick import TaskTickRecord
from harpy_pin.gaits.gait import Gait, GaitTargetRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import ZERO, RecordOf, fields, make_record, sized
from harpy_pin.model.state import Vector

MEMORY = 0.5
"""Time constant of the forgetting, s."""
KNEE = 0.05
"""Velocity at which Coulomb friction is mostly there, rad/s."""
RIDGE = 1.0
"""Sum of squares of a regressor, (rad/s)² or 1, that draws the fit half-way to zero."""
IMPACT = 20.0
"""N."""


class JointFrictionEstimateRecord(RecordOf):
    """Memory of the estimate."""

    period: float  # between ticks, s
    known: int = ZERO  # 1 where the last tick is known
    velocity: Vector = sized("nv")  # (nv,) of the last tick
    force: Vector = sized("feet", 3)  # (feet, 3) of the last tick, N
    # (thrust variables + joints,) [u; τ] of the last tick, N and N·m
    inputs: Vector = sized("thrusts + joints")
    # (joints, 5) of squares and products: v v, v s, s s, v φ and s φ, with s = tanh(v / KNEE)
    sums: Vector = sized("joints", 5)
    viscous: Vector = sized("joints")  # (joints,) b, N·m·s/rad
    coulomb: Vector = sized("joints")  # (joints,) c, N·m


class JointFrictionTickRecord(TaskTickRecord):
    """A whole-body controller with this estimate."""

    joint_friction: JointFrictionEstimateRecord


@kernel
def estimate_joint_friction(
    r: JointFrictionTickRecord, g: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The stage of a tick before its tasks: the estimate, in the bias forces of the state."""
    f = r.joint_friction
    size = f.force.size
    calm = np.all(abs(foot_force.reshape((size,)) - f.force.reshape((size,))) < IMPACT)
    f.force[:] = foot_force
    if calm and f.known != 0:
        _fit(f, r.dynamics, v, foot_force)
    f.velocity[:] = v
    f.known = 1
    r.dynamics.bias[6:] += f.viscous * v[6:] + f.coulomb * np.tanh(v[6:] / KNEE)


@kernel
def note_inputs(
    r: JointFrictionTickRecord, g: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The stage after the optimum: its inputs, for the next tick."""
    r.joint_friction.inputs[:] = r.inputs


def make_stage(gait: Gait, parameters: WholeBodyParameters) -> Stage:
    """The estimate in a whole-body controller."""
    sizes, period = gait.robot.sizes, parameters.period
    return Stage(
        name="joint_friction",
        memory=fields(make_record(JointFrictionEstimateRecord, sizes, period=period)),
        before_tasks=(estimate_joint_friction,),
        after_optimum=(note_inputs,),
        signals={"viscous_estimate": "viscous", "coulomb_estimate": "coulomb"},
    )


@kernel
def _fit(f: JointFrictionEstimateRecord, d: DynamicsRecord, v: Vector, foot_force: Vector) -> None:
    """Least squares with the residual of this tick."""
    thrusts, sums = d.thruster_jacobian.shape[0], f.sums
    residual = f.inputs[thrusts:] - d.bias[6:] - d.damping[6:] * v[6:]
    residual -= d.mass_matrix[6:] @ (v - f.velocity) / f.period
    residual += foot_force.reshape((f.force.size,)) @ d.foot_jacobian[:, 6:]
    residual += f.inputs[:thrusts] @ d.thruster_jacobian[:, 6:]
    speed = 0.5 * (v[6:] + f.velocity[6:])
    sign = np.tanh(speed / KNEE)
    sums *= 1.0 - min(f.period / MEMORY, 1.0)
    sums[:, 0] += speed * speed
    sums[:, 1] += speed * sign
    sums[:, 2] += sign * sign
    sums[:, 3] += speed * residual
    sums[:, 4] += sign * residual
    first, last = sums[:, 0] + RIDGE, sums[:, 2] + RIDGE
    determinant = first * last - sums[:, 1] * sums[:, 1]
    viscous = (last * sums[:, 3] - sums[:, 1] * sums[:, 4]) / determinant
    coulomb = (first * sums[:, 4] - sums[:, 1] * sums[:, 3]) / determinant
    # Where one of the two would be negative, it is zero and the other one is fitted alone.
    f.viscous[:] = np.maximum(np.where(coulomb < 0.0, sums[:, 3] / first, viscous), 0.0)
    f.viscous[:] = np.where(viscous < 0.0, 0.0, f.viscous)
    f.coulomb[:] = np.maximum(np.where(viscous < 0.0, sums[:, 4] / last, coulomb), 0.0)
