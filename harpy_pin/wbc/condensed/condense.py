"""The robot as six equations: limbs are eliminated, and the contact forces are the unknowns that
remain.

A limb has as many joints as its foot has directions: three for a point foot, six for a flat one. So
the accelerations of its joints follow from those of the root. For limb k, with J_k = [J_kr J_kl]
(columns of the root and of the limb) and α_k the desired acceleration of its foot,

    a_k = ā_k + T_k a_r + J_kl⁺ δ_k,    ā_k = J_kl⁺ (α_k − J̇v_k),    T_k = −J_kl⁺ J_kr

where δ_k is the free acceleration of a swing foot; that of a stance foot is zero. J_kl⁺ is the
inverse for a point foot. For a flat foot J_k has three rows for each corner and J_kl⁺ is the
pseudo-inverse: the corners of one rigid body cannot follow every set of accelerations, and the body
gets the nearest motion. Joints that are on no limb (arms, torso, head) have the acceleration of the
posture task and a free one: a_j = ā_j + ε_j.

No torque acts on the root, so its six rows of M a + n = S τ + Σ J_kᵀ f_k + J_tᵀ u become

    M_b a_r + n_b = G_f f + G_o o,    o = [u; ε; δ]

with M_b = M_rr + Σ M_rk T_k, n_b = n_r + Σ M_rk ā_k + Σ M_rj ā_j, G_f = [J_krᵀ], and G_o of the
thrusters' J_trᵀ, −M_rj and −M_rk J_kl⁺. For given f, the minimum of ‖a_r − a_d‖²_W + ‖o‖²_D under
this equation is

    λ = K⁻¹ (w − G_f f),    o = D⁻¹ G_oᵀ λ,    a_r = a_d − W⁻¹ M_bᵀ λ
    w = M_b a_d + n_b,      K = M_b W⁻¹ M_bᵀ + G_o D⁻¹ G_oᵀ

and costs (w − G_f f)ᵀ K⁻¹ (w − G_f f). The torques are the joints' rows. With them the contact
forces of the rigid robot are f, whichever f was chosen. Corner forces with the same net wrench are
equivalent for a rigid robot.

**Centre of mass.** With the limbs eliminated its acceleration c̈ is affine in that of the root and
in o,

    z = C a_r + C_o o + c,    z = [c̈_x, c̈_y, z̈ of the body's origin, angular acceleration]

and so is a_r in z. Where a gait demands c̈, the equations above are in z, with M_b C⁻¹, n_b − M_b
C⁻¹ c and G_o + M_b C⁻¹ C_o; the weights W are then on z − z_d, and all that follows stays as it is.

This file eliminates the limbs, and recovers motion and torques from given forces, which
:mod:`harpy_pin.wbc.newton` chooses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import kernel
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed, solve_vector
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.targets import ProblemRecord, TargetsRecord

MIN_DETERMINANT = 1e-6
"""Least determinant of a limb's J_kl, m³; below it (a straight leg) the inverse is damped and the
foot not held.
"""
MIN_PIVOT = 1e-8
"""Least pivot of J_klᵀ J_kl of a flat foot, m²."""
MIN_CENTRE_DETERMINANT = 1e-2
"""Least determinant of the part of C that maps the linear acceleration; below it the task is the
body's origin's.
"""


class CondensationRecord(RecordOf):
    """The equations of a robot with a limb of its own for each foot.

    In the shapes a limb has j joints and its foot r = 3 rows for each corner: 3 and 3 for points, 6
    and 12 for rectangles; ``thrusts`` is the number of thrust variables
    (:mod:`harpy_pin.model.rotor`), ``others`` that of the joints on no limb.
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
    free_map: Vector = sized("thrusts + others + 3 feet", 6)  # G_oᵀ; zero rows for stance feet
    free_acceleration: Vector = sized("thrusts + others + 3 feet")  # o
    inverse_weight: Vector = sized(
        "thrusts + others + 3 feet"
    )  # 1/D; zero for an entry of o that is fixed
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


@kernel
def eliminate_limbs(
    d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, e: CondensationRecord, v: Vector
) -> None:
    """Fill in the root's equations, after its desired acceleration."""
    thrusts, others = d.thruster_jacobian.shape[0], e.others.shape[0]
    first = thrusts + others
    e.bias[:] = d.bias[:6] + d.damping[:6] * v[:6]
    e.mass[:] = d.mass_matrix[:6, :6]
    e.free_map[:thrusts] = d.thruster_jacobian[:, :6]
    e.inverse_body_weight[:3], e.inverse_body_weight[3:] = 1.0 / p.w_body, 1.0 / p.w_orientation
    e.inverse_weight[:thrusts] = 1.0 / p.w_thrust
    for k in range(e.limb.shape[0]):
        _limb_motion(d, t, e, k)
        _add_limb(d, t, p, e, k, first)
    if others > 0:
        e.posture[:] = t.joints[e.others - 6]
        e.free_acceleration[thrusts:first] = 0.0
        e.inverse_weight[thrusts:first] = 1.0 / (p.w_arms * t.joint_share[e.others - 6])
        e.free_map[thrusts:first] = -d.mass_matrix[e.others, :6]
        e.bias -= e.free_map[thrusts:first].T @ e.posture
    e.centred = 0
    if t.centred:
        turn_to_centre(d, t, e, v)
    e.right_hand_side[:] = e.mass @ e.desired + e.bias


@kernel
def _limb_motion(d: DynamicsRecord, t: TargetsRecord, e: CondensationRecord, k: int) -> None:
    """J_kl⁺, ā_k and T_k of limb k: its accelerations from the root's."""
    rows = e.inverse.shape[2]
    points, first = rows // 3, rows * k
    jacobian = d.foot_jacobian[first : first + rows]
    if rows == 3:  # known when compiling: the other kernel is not part of the result
        _invert_limb(jacobian[:, e.limb[k]], e.inverse[k])
    else:
        _invert_flat_limb(jacobian, e.limb[k], e.normal, e.inverse[k])
    desired = t.feet[points * k : points * (k + 1)].reshape((rows,))
    e.limb_bias[k] = e.inverse[k] @ (desired - d.foot_drift[first : first + rows])
    e.limb_map[k] = -(e.inverse[k] @ jacobian[:, :6])


@kernel
def _add_limb(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: ProblemRecord,
    e: CondensationRecord,
    k: int,
    free_from: int,
) -> None:
    """What limb k adds to the root's equations: to M_b and n_b, and its columns of G_f and G_o with
    their weights.
    """
    rows = e.inverse.shape[2]
    first = rows * k
    free = free_from + first
    mass = d.mass_matrix[:6, e.limb[k]]
    e.bias += mass @ e.limb_bias[k]
    e.mass += mass @ e.limb_map[k]
    e.free_acceleration[free : free + rows] = 0.0
    if t.held[first // 3] != 0.0:
        e.inverse_weight[free : free + rows] = 0.0
        e.force_map[:, first : first + rows] = d.foot_jacobian[first : first + rows, :6].T
        e.free_map[free : free + rows] = 0.0
    else:
        e.inverse_weight[free : free + rows] = 0.0 if p.w_swing == 0.0 else 1.0 / p.w_swing
        e.force_map[:, first : first + rows] = 0.0
        e.free_map[free : free + rows] = -(e.inverse[k].T @ mass.T)


@kernel
def _invert_limb(jacobian: Vector, out: Vector) -> None:
    """J_kl⁻¹ of J_kl (3, 3) by cofactors; damped where the limb is singular."""
    x, y, z = jacobian[:, 0], jacobian[:, 1], jacobian[:, 2]
    out[0], out[1], out[2] = np.cross(y, z), np.cross(z, x), np.cross(x, y)
    determinant = x @ out[0]
    out *= determinant / max(determinant * determinant, MIN_DETERMINANT**2)


@kernel
def _invert_flat_limb(
    jacobian: Vector, limb: NDArray[np.int64], normal: Vector, out: Vector
) -> None:
    """J_kl⁺ = (J_klᵀ J_kl)⁻¹ J_klᵀ; bounded where the limb is singular."""
    out[:] = jacobian[:, limb].T
    normal[:] = out @ out.T
    factorise(normal, normal, MIN_PIVOT)
    solve_transposed(normal, out, out.shape[1])
    solve_factor(normal, out, out.shape[1])


@kernel
def root_compliance(e: CondensationRecord, compliance: Vector) -> None:
    """K into the first six rows and columns, with the entries of o whose inverse weight is zero
    taken as fixed.
    """
    compliance[:6, :6] = (e.mass * e.inverse_body_weight) @ e.mass.T
    for c in range(e.inverse_weight.shape[0]):
        if e.inverse_weight[c] != 0.0:
            compliance[:6, :6] += e.inverse_weight[c] * np.outer(e.free_map[c], e.free_map[c])


@kernel
def root_factor(e: CondensationRecord) -> None:
    """Factor of K."""
    root_compliance(e, e.factor)
    factorise(e.factor, e.factor)


@kernel
def recover(e: CondensationRecord, f: Vector) -> None:
    """λ, o and a for contact forces f; entries of o that are fixed stay as they are, part of the
    right-hand side.
    """
    e.multiplier[:] = e.right_hand_side - e.force_map @ f
    solve_vector(e.factor, e.multiplier)
    move_root(e, e.mass.T @ e.multiplier, e.free_map @ e.multiplier)
    move_limbs(e)


@kernel
def move_root(e: CondensationRecord, body: Vector, free: Vector) -> None:
    """o and what is free of the root, from M_bᵀ λ (6,) and G_oᵀ λ of all equations."""
    e.acceleration[:6] = e.desired - e.inverse_body_weight * body
    o = e.free_acceleration
    o[:] = np.where(e.inverse_weight != 0.0, e.inverse_weight * free, o)


@kernel
def move_limbs(e: CondensationRecord) -> None:
    """a, from o and what is free of the root."""
    a, o = e.acceleration, e.free_acceleration
    first = o.shape[0] - e.force_map.shape[1]
    if e.centred:
        root_of_centre(e, a.reshape((a.shape[0], 1)), o.reshape((o.shape[0], 1)), 1.0)
    rows = e.inverse.shape[2]
    for k in range(e.limb.shape[0]):
        free = o[first + rows * k : first + rows * (k + 1)]
        a[e.limb[k]] = e.limb_bias[k] + e.limb_map[k] @ a[:6] + e.inverse[k] @ free
    if e.others.shape[0] > 0:
        a[e.others] = e.posture + o[first - e.others.shape[0] : first]


@kernel
def joint_torques(
    d: DynamicsRecord, e: CondensationRecord, v: Vector, f: Vector, torque: Vector
) -> None:
    """Torques of the joints for contact forces f and what :func:`recover` computed for them."""
    thrust = e.free_acceleration[: d.thruster_jacobian.shape[0]]
    torque[:] = d.bias[6:] + d.damping[6:] * v[6:] + d.mass_matrix[6:] @ e.acceleration
    if d.thruster_jacobian.shape[0] > 0:
        torque -= d.thruster_jacobian[:, 6:].T @ thrust
    rows = e.inverse.shape[2]
    for k in range(e.limb.shape[0]):
        jacobian = d.foot_jacobian[rows * k : rows * (k + 1)]
        torque[e.limb[k] - 6] -= jacobian[:, e.limb[k]].T @ f[rows * k : rows * (k + 1)]


@kernel
def turn_to_centre(d: DynamicsRecord, t: TargetsRecord, e: CondensationRecord, v: Vector) -> None:
    """Change the root's equations, with the limbs eliminated, and what is demanded, to z."""
    rotation, mass, thrusts = d.tree.rotation, d.mass_matrix[0, 0], d.thruster_jacobian.shape[0]
    e.centred = 0
    e.root_per_centre[:2] = rotation[:2] @ e.mass[:3] / mass
    e.root_per_centre[2, :3], e.root_per_centre[2, 3:] = rotation[2], 0.0
    if not _invert(e):
        return
    e.centred = 1
    e.centre_bias[:2] = t.centre_drift[:2] + rotation[:2] @ (e.bias[:3] - d.bias[:3]) / mass
    e.centre_bias[2] = rotation[2] @ np.cross(v[3:6], v[:3])
    e.centre_free[:, :thrusts] = 0.0
    e.centre_free[:, thrusts:] = -(rotation[:2] @ e.free_map[thrusts:, :3].T) / mass
    e.desired[:3] = t.body
    e.mass[:] = e.mass @ e.root_per_centre
    e.bias -= e.mass[:, :3] @ e.centre_bias
    e.free_map += e.centre_free.T @ e.mass[:, :2].T


@kernel
def _invert(e: CondensationRecord) -> bool:
    """C⁻¹ in the place of C = [[A, B], [0, 1]]: [[A⁻¹, −A⁻¹ B], [0, 1]]; whether there is one."""
    c = e.root_per_centre
    x, y, z = c[:3, 0], c[:3, 1], c[:3, 2]
    inverse = np.array([np.cross(y, z), np.cross(z, x), np.cross(x, y)])
    determinant = x @ inverse[0]
    if not abs(determinant) > MIN_CENTRE_DETERMINANT:
        return False
    inverse /= determinant
    c[:3, 3:] = -(inverse @ c[:3, 3:])
    c[:3, :3] = inverse
    c[3:, :3], c[3:, 3:] = 0.0, np.eye(3)
    return True


@kernel
def root_of_centre(e: CondensationRecord, motion: Vector, free: Vector, bias: float) -> None:
    """The root's accelerations C⁻¹ (z − c − C_o o) from z, in the first six rows of ``motion``.

    It is (≥ 6, n), ``free`` are n columns of o, and ``bias`` says how much of c.
    """
    z = motion[:6] + 0.0
    z[:3] -= bias * e.centre_bias[:, None]
    z[:2] -= e.centre_free @ free
    motion[:6] = e.root_per_centre @ z
