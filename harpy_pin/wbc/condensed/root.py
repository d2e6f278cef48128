"""The root's six equations solved for given contact forces (:mod:`harpy_pin.wbc.condensed.condense`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import factorise, solve_vector
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.centre import root_of_centre

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.wbc.condensed.condense import CondensationRecord

__all__: list[str] = []


@kernel
def root_factor(e: CondensationRecord) -> None:
    """Factor of K, with the entries of o whose inverse weight is zero taken as fixed."""
    for i in range(6):
        for j in range(i + 1):
            s = 0.0
            for c in range(6):
                s += e.mass[i, c] * e.inverse_body_weight[c] * e.mass[j, c]
            for c in range(e.inverse_weight.shape[0]):
                s += e.free_map[i, c] * e.inverse_weight[c] * e.free_map[j, c]
            e.factor[i, j] = s
    factorise(e.factor, e.factor)


@kernel
def recover(e: CondensationRecord, f: Vector) -> None:
    """λ, o and a for contact forces f; entries of o that are fixed stay as they are, part of the right-hand side."""
    for i in range(6):
        s = e.right_hand_side[i]
        for c in range(f.shape[0]):
            s -= e.force_map[i, c] * f[c]
        e.multiplier[i] = s
    solve_vector(e.factor, e.multiplier)
    first = e.inverse_weight.shape[0] - f.shape[0]
    for c in range(e.inverse_weight.shape[0]):
        if e.inverse_weight[c] != 0.0:
            s = 0.0
            for i in range(6):
                s += e.free_map[i, c] * e.multiplier[i]
            e.free_acceleration[c] = e.inverse_weight[c] * s
    a = e.acceleration
    for j in range(6):
        s = 0.0
        for i in range(6):
            s += e.mass[i, j] * e.multiplier[i]
        a[j] = e.desired[j] - e.inverse_body_weight[j] * s
    if e.centred:
        root_of_centre(e)
    limbs, joints, rows = e.inverse.shape
    for k in range(limbs):
        for x in range(joints):
            s = e.limb_bias[k, x]
            for j in range(6):
                s += e.limb_map[k, x, j] * a[j]
            for b in range(rows):
                s += e.inverse[k, x, b] * e.free_acceleration[first + rows * k + b]
            a[e.limb[k, x]] = s
    others = e.others.shape[0]
    for c in range(others):
        a[e.others[c]] = e.posture[c] + e.free_acceleration[first - others + c]


@kernel
def joint_torques(d: DynamicsRecord, e: CondensationRecord, v: Vector, f: Vector, torque: Vector) -> None:
    """Torques of the joints for contact forces f and what :func:`recover` computed for them."""
    nv = v.shape[0]
    for j in range(6, nv):
        s = d.bias[j] + d.damping[j] * v[j]
        for i in range(nv):
            s += d.mass_matrix[j, i] * e.acceleration[i]
        for c in range(d.thruster_jacobian.shape[0]):
            s -= d.thruster_jacobian[c, j] * e.free_acceleration[c]
        torque[j - 6] = s
    limbs, joints, rows = e.inverse.shape
    for k in range(limbs):
        for x in range(joints):
            j = e.limb[k, x]
            for b in range(rows):
                torque[j - 6] -= d.foot_jacobian[rows * k + b, j] * f[rows * k + b]
