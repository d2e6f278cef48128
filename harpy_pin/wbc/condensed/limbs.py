"""The joints of the limbs eliminated from the equations of motion (:mod:`harpy_pin.wbc.condensed.condense`)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.centre import turn_to_centre

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.wbc.condensed.condense import CondensationRecord
    from harpy_pin.wbc.weights import TargetsRecord, TaskWeightsRecord

__all__: list[str] = []

MIN_DETERMINANT = 1e-6
"""Of a limb's J_kl, m³. Below it (a straight or folded leg) the inverse is damped, and the foot is not held exactly."""
MIN_PIVOT = 1e-8
"""The same for flat feet, of J_klᵀ J_kl, m²."""


@kernel
def eliminate_limbs(
    d: DynamicsRecord, t: TargetsRecord, p: TaskWeightsRecord, r: CondensationRecord, v: Vector
) -> None:
    """Fill in the root's equations.

    Args:
        d: element of the dynamics' record.
        t: of the targets' record.
        p: of a record with the weights.
        r: of the equations' record, out.
        v: (nv,) generalised velocity.
    """
    thrusts, others = d.thruster_jacobian.shape[0], r.others.shape[0]
    first = thrusts + others
    for i in range(6):
        r.bias[i] = d.bias[i] + d.damping[i] * v[i]
        r.inverse_body_weight[i] = 1.0 / (p.w_body if i < 3 else p.w_orientation)
        for j in range(6):
            r.mass[i, j] = d.mass_matrix[i, j]
        for c in range(thrusts):
            r.free_map[i, c] = d.thruster_jacobian[c, i]
    for c in range(thrusts):
        r.inverse_weight[c] = 1.0 / p.w_thrust
    for k in range(r.limb.shape[0]):
        _limb_motion(d, t, r, k)
        if r.inverse.shape[2] == 3:  # known when compiling: the other kernel is not part of the result
            _add_point_limb(d, t, r, k, first)
        else:
            _add_flat_limb(d, t, r, k, first)
        _weigh_free_acceleration(t, p, r, k, first)
    for c in range(others):
        column = r.others[c]
        r.posture[c] = t.joints[column - 6]
        r.free_acceleration[thrusts + c], r.inverse_weight[thrusts + c] = 0.0, 1.0 / p.w_arms
        for i in range(6):
            r.bias[i] += d.mass_matrix[i, column] * r.posture[c]
            r.free_map[i, thrusts + c] = -d.mass_matrix[i, column]
    r.centred = 0
    if t.centred:
        turn_to_centre(d, t, r, v)
    for i in range(6):
        s = r.bias[i]
        for j in range(6):
            s += r.mass[i, j] * r.desired[j]
        r.right_hand_side[i] = s


@kernel
def _limb_motion(d: DynamicsRecord, t: TargetsRecord, r: CondensationRecord, k: int) -> None:
    """J_kl⁺, ā_k and T_k of limb k: its accelerations from the root's."""
    limb, inverse, limb_map, limb_bias = r.limb[k], r.inverse[k], r.limb_map[k], r.limb_bias[k]
    joints, rows = inverse.shape
    first = rows * k
    jacobian = d.foot_jacobian[first : first + rows]
    if r.inverse.shape[2] == 3:  # known when compiling: the other kernel is not part of the result
        _invert_limb(jacobian, limb, inverse)
    else:
        _invert_flat_limb(jacobian, limb, r.normal, inverse)
    for a in range(joints):
        s = 0.0
        for b in range(rows):
            s += inverse[a, b] * (t.feet[(first + b) // 3, b % 3] - d.foot_drift[first + b])
        limb_bias[a] = s
        for j in range(6):
            s = 0.0
            for b in range(rows):
                s -= inverse[a, b] * jacobian[b, j]
            limb_map[a, j] = s


@kernel
def _add_point_limb(d: DynamicsRecord, t: TargetsRecord, r: CondensationRecord, k: int, free_from: int) -> None:
    """What limb k of three joints adds to the root's equations: to M_b and n_b, and its columns of G_f and G_o."""
    limb, inverse, limb_map, limb_bias = r.limb[k], r.inverse[k], r.limb_map[k], r.limb_bias[k]
    jacobian = d.foot_jacobian[3 * k : 3 * k + 3]
    held = t.held[k] != 0.0
    for i in range(6):
        row = d.mass_matrix[i]
        m0, m1, m2 = row[limb[0]], row[limb[1]], row[limb[2]]
        r.bias[i] += m0 * limb_bias[0] + m1 * limb_bias[1] + m2 * limb_bias[2]
        for j in range(6):
            r.mass[i, j] += m0 * limb_map[0, j] + m1 * limb_map[1, j] + m2 * limb_map[2, j]
        for b in range(3):
            r.force_map[i, 3 * k + b] = jacobian[b, i] if held else 0.0
            free = -(m0 * inverse[0, b] + m1 * inverse[1, b] + m2 * inverse[2, b])
            r.free_map[i, free_from + 3 * k + b] = 0.0 if held else free


@kernel
def _add_flat_limb(d: DynamicsRecord, t: TargetsRecord, r: CondensationRecord, k: int, free_from: int) -> None:
    """The same for a limb of a flat foot."""
    limb, inverse, limb_map, limb_bias = r.limb[k], r.inverse[k], r.limb_map[k], r.limb_bias[k]
    joints, rows = inverse.shape
    first = rows * k
    jacobian = d.foot_jacobian[first : first + rows]
    held = t.held[first // 3] != 0.0
    mass = np.empty(joints)
    for i in range(6):
        for a in range(joints):
            mass[a] = d.mass_matrix[i, limb[a]]
        s = 0.0
        for a in range(joints):
            s += mass[a] * limb_bias[a]
        r.bias[i] += s
        for j in range(6):
            s = 0.0
            for a in range(joints):
                s += mass[a] * limb_map[a, j]
            r.mass[i, j] += s
        for b in range(rows):
            r.force_map[i, first + b] = jacobian[b, i] if held else 0.0
            s = 0.0
            for a in range(joints):
                s += mass[a] * inverse[a, b]
            r.free_map[i, free_from + first + b] = 0.0 if held else -s


@kernel
def _weigh_free_acceleration(
    t: TargetsRecord, p: TaskWeightsRecord, r: CondensationRecord, k: int, free_from: int
) -> None:
    """Inverse weights of the free acceleration of limb k, which begins at zero; zero in stance."""
    rows = r.inverse.shape[2]
    held = t.held[rows * k // 3] != 0.0
    for b in range(free_from + rows * k, free_from + rows * (k + 1)):
        r.free_acceleration[b] = 0.0
        r.inverse_weight[b] = 0.0 if held or p.w_swing == 0.0 else 1.0 / p.w_swing


@kernel
def _invert_limb(jacobian: Vector, limb: NDArray[np.int64], out: Vector) -> None:
    """J_kl⁻¹ by cofactors; damped where the limb is singular."""
    x, y, z = limb[0], limb[1], limb[2]
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        out[0, a] = jacobian[b, y] * jacobian[c, z] - jacobian[b, z] * jacobian[c, y]
        out[1, a] = jacobian[b, z] * jacobian[c, x] - jacobian[b, x] * jacobian[c, z]
        out[2, a] = jacobian[b, x] * jacobian[c, y] - jacobian[b, y] * jacobian[c, x]
    determinant = jacobian[0, x] * out[0, 0] + jacobian[1, x] * out[0, 1] + jacobian[2, x] * out[0, 2]
    scale = determinant / max(determinant * determinant, MIN_DETERMINANT**2)
    for a in range(3):
        for b in range(3):
            out[a, b] *= scale


@kernel
def _invert_flat_limb(jacobian: Vector, limb: NDArray[np.int64], normal: Vector, out: Vector) -> None:
    """J_kl⁺ = (J_klᵀ J_kl)⁻¹ J_klᵀ; bounded where the limb is singular."""
    joints, rows = out.shape
    for a in range(joints):
        for b in range(rows):
            out[a, b] = jacobian[b, limb[a]]
        for c in range(a + 1):
            s = 0.0
            for b in range(rows):
                s += out[a, b] * out[c, b]
            normal[a, c] = s
    factorise(normal, normal, MIN_PIVOT)
    solve_transposed(normal, out, rows)
    solve_factor(normal, out, rows)
