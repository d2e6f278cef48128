"""The root's six equations solved for given contact forces (:mod:`harpy_pin.wbc.condensed.condense`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import factorise, solve_transposed, solve_vector
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.centre import root_of_centre

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.wbc.condensed.condense import CondensationRecord

__all__: list[str] = []


@kernel
def root_factor(r: CondensationRecord) -> None:
    """Factor of K, with the entries of o whose inverse weight is zero taken as fixed."""
    for i in range(6):
        for j in range(i + 1):
            s = 0.0
            for c in range(6):
                s += r.mass[i, c] * r.inverse_body_weight[c] * r.mass[j, c]
            for c in range(r.inverse_weight.shape[0]):
                s += r.free_map[i, c] * r.inverse_weight[c] * r.free_map[j, c]
            r.factor[i, j] = s
    factorise(r.factor, r.factor)


@kernel
def recover(r: CondensationRecord, f: Vector) -> None:
    """λ, o and a for contact forces f; entries of o that are fixed stay as they are, part of the right-hand side."""
    for i in range(6):
        s = r.right_hand_side[i]
        for c in range(f.shape[0]):
            s -= r.force_map[i, c] * f[c]
        r.multiplier[i] = s
    solve_vector(r.factor, r.multiplier)
    first = r.inverse_weight.shape[0] - f.shape[0]
    for c in range(r.inverse_weight.shape[0]):
        if r.inverse_weight[c] != 0.0:
            s = 0.0
            for i in range(6):
                s += r.free_map[i, c] * r.multiplier[i]
            r.free_acceleration[c] = r.inverse_weight[c] * s
    a = r.acceleration
    for j in range(6):
        s = 0.0
        for i in range(6):
            s += r.mass[i, j] * r.multiplier[i]
        a[j] = r.desired[j] - r.inverse_body_weight[j] * s
    if r.centred:
        root_of_centre(r)
    limbs, joints, rows = r.inverse.shape
    for k in range(limbs):
        for x in range(joints):
            s = r.limb_bias[k, x]
            for j in range(6):
                s += r.limb_map[k, x, j] * a[j]
            for b in range(rows):
                s += r.inverse[k, x, b] * r.free_acceleration[first + rows * k + b]
            a[r.limb[k, x]] = s
    others = r.others.shape[0]
    for c in range(others):
        a[r.others[c]] = r.posture[c] + r.free_acceleration[first - others + c]


@kernel
def joint_torques(d: DynamicsRecord, r: CondensationRecord, v: Vector, f: Vector, torque: Vector) -> None:
    """Torques of the joints for contact forces f and what :func:`recover` computed for them."""
    nv = v.shape[0]
    for j in range(6, nv):
        s = d.bias[j] + d.damping[j] * v[j]
        for i in range(nv):
            s += d.mass_matrix[j, i] * r.acceleration[i]
        for c in range(d.thruster_jacobian.shape[0]):
            s -= d.thruster_jacobian[c, j] * r.free_acceleration[c]
        torque[j - 6] = s
    limbs, joints, rows = r.inverse.shape
    for k in range(limbs):
        for x in range(joints):
            j = r.limb[k, x]
            for b in range(rows):
                torque[j - 6] -= d.foot_jacobian[rows * k + b, j] * f[rows * k + b]


@kernel
def force_response(r: CondensationRecord, out: Vector) -> None:
    """L⁻ᵀ G_f with K = Lᵀ L: its square is the Hessian of the cost in f.

    Args:
        r: record of the equation, factored.
        out: (6, 3 feet) out.
    """
    out[:] = r.force_map
    solve_transposed(r.factor, out, out.shape[1])


@kernel
def solve_root(r: CondensationRecord, x: Vector) -> None:
    """x ← L⁻ᵀ x with K = Lᵀ L, for a vector x (6,)."""
    lower = r.factor
    for i in range(5, -1, -1):
        x[i] *= lower[i, i]
        for k in range(i):
            x[k] -= lower[i, k] * x[i]


@kernel
def fix_thrusts(r: CondensationRecord, lower: Vector, upper: Vector) -> bool:
    """Fix the thrusts that are beyond their limits at these limits; the equation then needs a new factor.

    Args:
        r: record of the equation.
        lower: (thrust variables,) N.
        upper: (thrust variables,) N.

    Returns:
        Whether there were any.
    """
    found = False
    for c in range(lower.shape[0]):
        if r.inverse_weight[c] != 0.0 and (r.free_acceleration[c] < lower[c] or r.free_acceleration[c] > upper[c]):
            found = True
            r.free_acceleration[c] = upper[c] if r.free_acceleration[c] > upper[c] else lower[c]
            r.inverse_weight[c] = 0.0
            for i in range(6):
                r.right_hand_side[i] -= r.free_map[i, c] * r.free_acceleration[c]
    return found
