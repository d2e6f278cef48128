"""The robot as six equations: limbs are eliminated, and the contact forces are the unknowns that remain.

A limb has as many joints as its foot has directions: three for a point foot, six for a flat one. So the accelerations
of its joints follow from those of the root. For limb k, with J_k = [J_kr J_kl] (columns of the root and of the limb)
and α_k the desired acceleration of its foot,

    a_k = ā_k + T_k a_r + J_kl⁺ δ_k,    ā_k = J_kl⁺ (α_k − J̇v_k),    T_k = −J_kl⁺ J_kr

where δ_k is the free acceleration of a swing foot; that of a stance foot is zero. J_kl⁺ is the inverse for a point
foot. For a flat foot J_k has three rows for each corner and J_kl⁺ is the pseudo-inverse: the corners of one rigid body
cannot follow every set of accelerations, and the body gets the nearest motion. Joints that are on no limb (arms, torso,
head) have the acceleration of the posture task and a free one: a_j = ā_j + ε_j.

No torque acts on the root, so its six rows of M a + n = S τ + Σ J_kᵀ f_k + J_tᵀ u become

    M_b a_r + n_b = G_f f + G_o o,    o = [u; ε; δ]

with M_b = M_rr + Σ M_rk T_k, n_b = n_r + Σ M_rk ā_k + Σ M_rj ā_j, G_f = [J_krᵀ], and G_o of the thrusters' J_trᵀ,
−M_rj and −M_rk J_kl⁺. For given f, the minimum of ‖a_r − a_d‖²_W + ‖o‖²_D under this equation is

    λ = K⁻¹ (w − G_f f),    o = D⁻¹ G_oᵀ λ,    a_r = a_d − W⁻¹ M_bᵀ λ
    w = M_b a_d + n_b,      K = M_b W⁻¹ M_bᵀ + G_o D⁻¹ G_oᵀ

and costs (w − G_f f)ᵀ K⁻¹ (w − G_f f). The torques are the joints' rows. With them the contact forces of the rigid
robot are f, whichever f was chosen. Corner forces with the same net wrench are equivalent for a rigid robot.

**Centre of mass.** With the limbs eliminated its acceleration c̈ is affine in that of the root and in o,

    z = C a_r + C_o o + c,    z = [c̈_x, c̈_y, z̈ of the body's origin, angular acceleration]

and so is a_r in z. Where a gait demands c̈, the equations above are in z, with M_b C⁻¹, n_b − M_b C⁻¹ c and
G_o + M_b C⁻¹ C_o; the weights W are then on z − z_d, and all that follows stays as it is.

This file eliminates the limbs, and recovers motion and torques from given forces, which
:mod:`~harpy_pin.wbc.condensed.force_program` chooses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed, solve_vector
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.force_program import ProblemRecord, TargetsRecord

MIN_DETERMINANT = 1e-6
"""Least determinant of a limb's J_kl, m³; below it (a straight leg) the inverse is damped and the foot not held."""
MIN_PIVOT = 1e-8
"""Least pivot of J_klᵀ J_kl of a flat foot, m²."""
MIN_CENTRE_DETERMINANT = 1e-2
"""Least determinant of the part of C that maps the linear acceleration; below it the task is the body's origin's."""


class CondensationRecord(RecordOf):
    """The equations of a robot with a limb of its own for each foot.

    In the shapes a limb has j joints and its foot r = 3 rows for each corner: 3 and 3 for points, 6 and 12 for
    rectangles; ``thrusts`` is the number of thrust variables (:mod:`harpy_pin.model.rotor`), ``others`` that of the
    joints on no limb.
    """

    limb: NDArray[np.int64]  # (limbs, j) columns of each limb's joints
    others: NDArray[np.int64]  # columns of the joints that are on no limb
    posture: Vector = sized("others")  # ā_j
    inverse: Vector = sized("limbs", "j", "r")  # J_kl⁺
    normal: Vector = sized("j", "j")  # factor of J_klᵀ J_kl, for flat feet
    limb_bias: Vector = sized("limbs", "j")  # ā_k
    limb_map: Vector = sized("limbs", "j", 6)  # T_k
    mass: Vector = sized(6, 6)  # M_b
    bias: Vector = sized(6)  # n_b
    force_map: Vector = sized(6, "3 feet")  # G_f; zero columns for swing feet
    free_map: Vector = sized(6, "thrusts + others + 3 feet")  # G_o; zero columns for stance feet
    free_acceleration: Vector = sized("thrusts + others + 3 feet")  # o
    inverse_weight: Vector = sized("thrusts + others + 3 feet")  # 1/D; zero for an entry of o that is fixed
    inverse_body_weight: Vector = sized(6)  # 1/W
    desired: Vector = sized(6)  # a_d
    right_hand_side: Vector = sized(6)  # w, less the part of what is fixed in o
    factor: Vector = sized(6, 6)  # of K
    multiplier: Vector = sized(6)  # λ
    # 1 where a_r is z, with the acceleration of the centre of mass
    centred: int = ZERO
    root_per_centre: Vector = sized(6, 6)  # C⁻¹
    centre_bias: Vector = sized(3)  # c, but for its zeros
    centre_free: Vector = sized(2, "thrusts + others + 3 feet")  # C_o, but for its zeros
    acceleration: Vector = sized("nv")  # a
    # o per unit of each variable of ``input_map``
    free_per_unit: Vector = sized("thrusts + others + 3 feet", "thrusts + others + 3 feet")
    motion_per_unit: Vector = sized("nv", "thrusts + others + 3 feet")  # a per unit of each of them


@kernel
def eliminate_limbs(d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, e: CondensationRecord, v: Vector) -> None:
    """Fill in the root's equations, after its desired acceleration."""
    thrusts, others = d.thruster_jacobian.shape[0], e.others.shape[0]
    for i in range(6):
        e.bias[i] = d.bias[i] + d.damping[i] * v[i]
        e.inverse_body_weight[i] = 1.0 / (p.w_body if i < 3 else p.w_orientation)
        for j in range(6):
            e.mass[i, j] = d.mass_matrix[i, j]
        for c in range(thrusts):
            e.free_map[i, c] = d.thruster_jacobian[c, i]
    for c in range(thrusts):
        e.inverse_weight[c] = 1.0 / p.w_thrust
    for k in range(e.limb.shape[0]):
        _limb_motion(d, t, e, k)
        _add_limb(d, t, p, e, k, thrusts + others)
    for c in range(others):
        column = e.others[c]
        e.posture[c] = t.joints[column - 6]
        e.free_acceleration[thrusts + c] = 0.0
        e.inverse_weight[thrusts + c] = 1.0 / (p.w_arms * t.joint_share[column - 6])
        for i in range(6):
            e.bias[i] += d.mass_matrix[i, column] * e.posture[c]
            e.free_map[i, thrusts + c] = -d.mass_matrix[i, column]
    e.centred = 0
    if t.centred:
        turn_to_centre(d, t, e, v)
    for i in range(6):
        s = e.bias[i]
        for j in range(6):
            s += e.mass[i, j] * e.desired[j]
        e.right_hand_side[i] = s


@kernel
def _limb_motion(d: DynamicsRecord, t: TargetsRecord, e: CondensationRecord, k: int) -> None:
    """J_kl⁺, ā_k and T_k of limb k: its accelerations from the root's."""
    limb, inverse, limb_map, limb_bias = e.limb[k], e.inverse[k], e.limb_map[k], e.limb_bias[k]
    joints, rows = inverse.shape
    first = rows * k
    jacobian = d.foot_jacobian[first : first + rows]
    if e.inverse.shape[2] == 3:  # known when compiling: the other kernel is not part of the result
        _invert_limb(jacobian, limb, inverse)
    else:
        _invert_flat_limb(jacobian, limb, e.normal, inverse)
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
def _add_limb(
    d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, e: CondensationRecord, k: int, free_from: int
) -> None:
    """What limb k adds to the root's equations: to M_b and n_b, and its columns of G_f and G_o with their weights."""
    limb, inverse, limb_map, limb_bias = e.limb[k], e.inverse[k], e.limb_map[k], e.limb_bias[k]
    joints, rows = inverse.shape
    first = rows * k
    jacobian = d.foot_jacobian[first : first + rows]
    held = t.held[first // 3] != 0.0
    mass = np.empty(joints)
    for b in range(free_from + first, free_from + first + rows):
        e.free_acceleration[b] = 0.0
        e.inverse_weight[b] = 0.0 if held or p.w_swing == 0.0 else 1.0 / p.w_swing
    for i in range(6):
        for a in range(joints):
            mass[a] = d.mass_matrix[i, limb[a]]
        s = 0.0
        for a in range(joints):
            s += mass[a] * limb_bias[a]
        e.bias[i] += s
        for j in range(6):
            s = 0.0
            for a in range(joints):
                s += mass[a] * limb_map[a, j]
            e.mass[i, j] += s
        for b in range(rows):
            e.force_map[i, first + b] = jacobian[b, i] if held else 0.0
            s = 0.0
            if not held:
                for a in range(joints):
                    s += mass[a] * inverse[a, b]
            e.free_map[i, free_from + first + b] = 0.0 if held else -s


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
        root_of_centre(
            e, a.reshape((a.shape[0], 1)), e.free_acceleration.reshape((e.inverse_weight.shape[0], 1)), 1, 1.0
        )
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


@kernel
def turn_to_centre(d: DynamicsRecord, t: TargetsRecord, e: CondensationRecord, v: Vector) -> None:
    """Change the root's equations, with the limbs eliminated, and what is demanded, to z."""
    rotation, mass, thrusts = d.tree.rotation, d.mass_matrix[0, 0], d.thruster_jacobian.shape[0]
    e.centred = 0
    _linear_rows(e, rotation, mass)
    if not _invert(e):
        return
    e.centred = 1
    free = e.free_map.shape[1]
    for k in range(2):
        s = t.centre_drift[k]
        for i in range(3):
            s += rotation[k, i] * (e.bias[i] - d.bias[i]) / mass
        e.centre_bias[k] = s
        for c in range(free):
            s = 0.0
            for i in range(3):
                s -= rotation[k, i] * e.free_map[i, c] / mass
            e.centre_free[k, c] = s if c >= thrusts else 0.0
    e.centre_bias[2] = 0.0
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        e.centre_bias[2] += rotation[2, i] * (v[3 + a] * v[b] - v[3 + b] * v[a])
        e.desired[i] = t.body[i]
    row = np.empty(6)
    for i in range(6):
        for j in range(6):
            row[j] = 0.0
            for k in range(6):
                row[j] += e.mass[i, k] * e.root_per_centre[k, j]
        for j in range(6):
            e.mass[i, j] = row[j]
        for k in range(3):
            e.bias[i] -= row[k] * e.centre_bias[k]
        for c in range(free):
            e.free_map[i, c] += row[0] * e.centre_free[0, c] + row[1] * e.centre_free[1, c]


@kernel
def _linear_rows(e: CondensationRecord, rotation: Vector, mass: float) -> None:
    """The first three rows of C, into ``root_per_centre``."""
    for k in range(3):
        for j in range(6):
            s = 0.0
            for i in range(3):
                s += rotation[k, i] * e.mass[i, j] / mass
            e.root_per_centre[k, j] = s
    for j in range(6):
        e.root_per_centre[2, j] = rotation[2, j] if j < 3 else 0.0


@kernel
def _invert(e: CondensationRecord) -> bool:
    """C⁻¹ in the place of C = [[A, B], [0, 1]]: [[A⁻¹, −A⁻¹ B], [0, 1]]; whether there is one."""
    m = e.root_per_centre
    inverse, product = np.empty((3, 3)), np.empty((3, 3))
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        inverse[0, a] = m[b, 1] * m[c, 2] - m[b, 2] * m[c, 1]
        inverse[1, a] = m[b, 2] * m[c, 0] - m[b, 0] * m[c, 2]
        inverse[2, a] = m[b, 0] * m[c, 1] - m[b, 1] * m[c, 0]
    determinant = m[0, 0] * inverse[0, 0] + m[1, 0] * inverse[0, 1] + m[2, 0] * inverse[0, 2]
    if not abs(determinant) > MIN_CENTRE_DETERMINANT:
        return False
    for a in range(3):
        for b in range(3):
            product[a, b] = 0.0
            for c in range(3):
                product[a, b] += inverse[a, c] * m[c, 3 + b] / determinant
    for a in range(3):
        for b in range(3):
            m[a, b], m[a, 3 + b] = inverse[a, b] / determinant, -product[a, b]
            m[3 + a, b], m[3 + a, 3 + b] = 0.0, 1.0 if a == b else 0.0
    return True


@kernel
def root_of_centre(e: CondensationRecord, motion: Vector, free: Vector, n: int, bias: float) -> None:
    """The root's acceleration from z, in the first six rows of ``motion`` (≥ 6, ≥ n); ``bias`` says how much of c."""
    x = np.empty(6)
    for a in range(n):
        for j in range(6):
            x[j] = motion[j, a] - (bias * e.centre_bias[j] if j < 3 else 0.0)
        for k in range(2):
            for c in range(e.free_acceleration.shape[0]):
                x[k] -= e.centre_free[k, c] * free[c, a]
        for i in range(6):
            motion[i, a] = 0.0
            for j in range(6):
                motion[i, a] += e.root_per_centre[i, j] * x[j]
