"""Friction in the joints that the model does not have, estimated while walking.

The joints' rows of the equations of motion leave the friction over,

    φ = τ + J_fᵀ f + J_tᵀ u − M a − n − B v,    a = Δv / period,

from the last command, the measured contact forces and two measured velocities. For every joint, least squares with
exponential forgetting fit φ = b v + c tanh(v / ``KNEE``) with b, c ≥ 0: viscous and Coulomb friction. The fit is drawn
to zero where a joint has hardly moved. The controllers' bias forces then contain it. Ticks in which a contact force
changes by more than ``IMPACT`` are left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.record import ZERO, RecordOf, Records, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord

__all__: list[str] = []

MEMORY = 0.5
"""Time constant of the forgetting, s."""
KNEE = 0.05
"""Velocity at which Coulomb friction is mostly there, rad/s."""
RIDGE = 1.0
"""Sum of squares of a regressor, (rad/s)² or 1, that draws the fit half-way to zero."""
IMPACT = 20.0
"""N."""


class JointFrictionEstimateRecord(RecordOf):
    """The estimate of :mod:`harpy_pin.controllers.joint_friction`."""

    on: int  # 1 where there is an estimate
    period: float  # between ticks, s
    known: int = ZERO  # 1 where the last tick is known
    velocity: Vector = sized("nv")  # (nv,) of the last tick
    force: Vector = sized("feet", 3)  # (feet, 3) of the last tick, N
    inputs: Vector = sized("thrusts + joints")  # (thrust variables + joints,) [u; τ] of the last tick, N and N·m
    # (joints, 5) of squares and products: v v, v s, s s, v φ and s φ, with s = tanh(v / KNEE)
    sums: Vector = sized("joints", 5)
    viscous: Vector = sized("joints")  # (joints,) b, N·m·s/rad
    coulomb: Vector = sized("joints")  # (joints,) c, N·m


def joint_friction_estimate(robot: Robot, *, period: float, on: bool) -> Records[JointFrictionEstimateRecord]:
    """A new :class:`JointFrictionEstimateRecord`."""
    return make_record(JointFrictionEstimateRecord, robot.sizes, on=np.int64(on), period=period)


@kernel
def note_inputs(f: JointFrictionEstimateRecord, inputs: Vector) -> None:
    """Keep the command of a tick, [u; τ], for the next."""
    if f.on:
        for c in range(inputs.shape[0]):
            f.inputs[c] = inputs[c]


@kernel
def add_joint_friction(f: JointFrictionEstimateRecord, d: DynamicsRecord, v: Vector, foot_force: Vector) -> None:
    """Update the estimate, and add it to the bias forces.

    Args:
        f: element of the record.
        d: of the dynamics' record, at this tick's state.
        v: (nv,) generalised velocity.
        foot_force: (feet, 3) as measured, N.
    """
    calm = f.known != 0
    for k in range(foot_force.shape[0]):
        for i in range(3):
            calm = calm and abs(foot_force[k, i] - f.force[k, i]) < IMPACT
            f.force[k, i] = foot_force[k, i]
    if calm:
        _fit(f, d, v, foot_force)
    for i in range(v.shape[0]):
        f.velocity[i] = v[i]
    f.known = 1
    for j in range(f.viscous.shape[0]):
        d.bias[6 + j] += f.viscous[j] * v[6 + j] + f.coulomb[j] * np.tanh(v[6 + j] / KNEE)


@kernel
def _fit(f: JointFrictionEstimateRecord, d: DynamicsRecord, v: Vector, foot_force: Vector) -> None:
    """Least squares with the residual of this tick."""
    nv, thrusts = v.shape[0], d.thruster_jacobian.shape[0]
    keep = 1.0 - min(f.period / MEMORY, 1.0)
    for j in range(f.viscous.shape[0]):
        row = 6 + j
        residual = f.inputs[thrusts + j] - d.bias[row] - d.damping[row] * v[row]
        for i in range(nv):
            residual -= d.mass_matrix[row, i] * (v[i] - f.velocity[i]) / f.period
        for c in range(d.foot_jacobian.shape[0]):
            residual += d.foot_jacobian[c, row] * foot_force[c // 3, c % 3]
        for c in range(thrusts):
            residual += d.thruster_jacobian[c, row] * f.inputs[c]
        speed = 0.5 * (v[row] + f.velocity[row])
        sign = np.tanh(speed / KNEE)
        s = f.sums[j]
        s[0] = keep * s[0] + speed * speed
        s[1] = keep * s[1] + speed * sign
        s[2] = keep * s[2] + sign * sign
        s[3] = keep * s[3] + speed * residual
        s[4] = keep * s[4] + sign * residual
        first, last = s[0] + RIDGE, s[2] + RIDGE
        determinant = first * last - s[1] * s[1]
        viscous = (last * s[3] - s[1] * s[4]) / determinant
        coulomb = (first * s[4] - s[1] * s[3]) / determinant
        if viscous < 0.0:
            viscous, coulomb = 0.0, s[4] / last
        elif coulomb < 0.0:
            viscous, coulomb = s[3] / first, 0.0
        f.viscous[j], f.coulomb[j] = max(viscous, 0.0), max(coulomb, 0.0)
