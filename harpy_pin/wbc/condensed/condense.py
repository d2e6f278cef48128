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

This file eliminates the limbs, and recovers motion and torques from given forces, which
:mod:`~harpy_pin.wbc.condensed.force_program` chooses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed, solve_vector
from harpy_pin.model.record import ZERO, RecordOf, Records, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.centre import root_of_centre, turn_to_centre

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.wbc.problem import ProblemRecord
    from harpy_pin.wbc.weights import TargetsRecord

__all__ = ["condensation_record", "condensed_sizes"]

_JOINTS = {1: 3}
"""Joints of a limb by the contact points of its foot; six for all others."""
MIN_DETERMINANT = 1e-6
"""Least determinant of a limb's J_kl, m³. Below it (a straight or folded leg) the inverse is damped, and the foot is
not held exactly."""
MIN_PIVOT = 1e-8
"""Least pivot of J_klᵀ J_kl of a flat foot, m²."""


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
    # 1 where a_r is z, with the acceleration of the centre of mass (``centre.py``)
    centred: int = ZERO
    root_per_centre: Vector = sized(6, 6)  # C⁻¹
    centre_bias: Vector = sized(3)  # c, but for its zeros
    centre_free: Vector = sized(2, "thrusts + others + 3 feet")  # C_o, but for its zeros
    acceleration: Vector = sized("nv")  # a
    # o per unit of each variable of ``input_map``
    free_per_unit: Vector = sized("thrusts + others + 3 feet", "thrusts + others + 3 feet")
    motion_per_unit: Vector = sized("nv", "thrusts + others + 3 feet")  # a per unit of each of them


def condensation_record(robot: Robot) -> Records[CondensationRecord]:
    """A new :class:`CondensationRecord`.

    Raises:
        InputError: the feet do not hang on such limbs, or are of several kinds.
    """
    model, limbs = robot.model, _limbs(robot)
    columns = {column for limb in limbs for column in limb}
    corners = robot.corners[0] if limbs else 1
    joints = len(limbs[0]) if limbs else 3
    return make_record(
        CondensationRecord,
        {**condensed_sizes(robot), "limbs": len(limbs), "j": joints, "r": 3 * corners},
        limb=np.array(limbs, dtype=np.int64).reshape(-1, joints),
        others=np.array([c for c in range(6, model.nv) if c not in columns], dtype=np.int64),
    )


def condensed_sizes(robot: Robot) -> dict[str, int]:
    """Numbers by which shapes of the condensed program are named: those of the robot, and of its joints on no limb."""
    on_limbs = sum(_JOINTS.get(corners, 6) for corners in robot.corners)
    return {**robot.sizes, "others": len(robot.joints) - on_limbs}


def _limbs(robot: Robot) -> list[list[int]]:
    """Columns of the joints between the root and each foot.

    Raises:
        InputError: feet of several kinds, a limb of another number of joints, or a joint that belongs to several.
    """
    model = robot.model
    if len(set(robot.corners)) > 1:
        raise InputError(
            f"the feet of '{robot.name}' have {robot.corners} contact points: all must be points, or flat feet alike",
            name="robot",
        )
    starts = np.cumsum((0, *robot.corners))[:-1]
    feet = [robot.feet[first] for first in starts]
    supports = [model.supports[model.frames[robot.frame_id(foot)].parentJoint] for foot in feet]
    limbs = [[j for j in chain if j > 1] for chain in supports]
    used: dict[int, str] = {}
    for foot, limb in zip(feet, limbs, strict=True):
        for joint in limb:
            if joint in used:
                raise InputError(
                    f"joint '{model.names[joint]}' of '{robot.name}' moves the feet '{used[joint]}' and '{foot}': "
                    "limbs must not share joints, so every leg must begin at the base",
                    name="robot",
                )
            used[joint] = foot
    for foot, corners, limb in zip(feet, robot.corners, limbs, strict=True):
        desired = _JOINTS.get(corners, 6)
        if len(limb) != desired:
            kind = "point foot" if corners == 1 else "flat foot"
            names = ", ".join(model.names[j] for j in limb) or "none"
            raise InputError(
                f"the limb of a {kind} must have {desired} joints; that of '{foot}' of '{robot.name}' has "
                f"{len(limb)}: {names}",
                name="robot",
            )
    return [[model.joints[j].idx_v for j in limb] for limb in limbs]


@kernel
def eliminate_limbs(d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, e: CondensationRecord, v: Vector) -> None:
    """Fill in the root's equations."""
    thrusts, others = d.thruster_jacobian.shape[0], e.others.shape[0]
    first = thrusts + others
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
        if e.inverse.shape[2] == 3:  # known when compiling: the other kernel is not part of the result
            _add_point_limb(d, t, e, k, first)
        else:
            _add_flat_limb(d, t, e, k, first)
        _weigh_free_acceleration(t, p, e, k, first)
    for c in range(others):
        column = e.others[c]
        e.posture[c] = t.joints[column - 6]
        e.free_acceleration[thrusts + c], e.inverse_weight[thrusts + c] = 0.0, 1.0 / p.w_arms
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
def _add_point_limb(d: DynamicsRecord, t: TargetsRecord, e: CondensationRecord, k: int, free_from: int) -> None:
    """What limb k of three joints adds to the root's equations: to M_b and n_b, and its columns of G_f and G_o."""
    limb, inverse, limb_map, limb_bias = e.limb[k], e.inverse[k], e.limb_map[k], e.limb_bias[k]
    jacobian = d.foot_jacobian[3 * k : 3 * k + 3]
    held = t.held[k] != 0.0
    for i in range(6):
        row = d.mass_matrix[i]
        m0, m1, m2 = row[limb[0]], row[limb[1]], row[limb[2]]
        e.bias[i] += m0 * limb_bias[0] + m1 * limb_bias[1] + m2 * limb_bias[2]
        for j in range(6):
            e.mass[i, j] += m0 * limb_map[0, j] + m1 * limb_map[1, j] + m2 * limb_map[2, j]
        for b in range(3):
            e.force_map[i, 3 * k + b] = jacobian[b, i] if held else 0.0
            free = -(m0 * inverse[0, b] + m1 * inverse[1, b] + m2 * inverse[2, b])
            e.free_map[i, free_from + 3 * k + b] = 0.0 if held else free


@kernel
def _add_flat_limb(d: DynamicsRecord, t: TargetsRecord, e: CondensationRecord, k: int, free_from: int) -> None:
    """What limb k of a flat foot adds to the root's equations, see :func:`_add_point_limb`."""
    limb, inverse, limb_map, limb_bias = e.limb[k], e.inverse[k], e.limb_map[k], e.limb_bias[k]
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
        e.bias[i] += s
        for j in range(6):
            s = 0.0
            for a in range(joints):
                s += mass[a] * limb_map[a, j]
            e.mass[i, j] += s
        for b in range(rows):
            e.force_map[i, first + b] = jacobian[b, i] if held else 0.0
            s = 0.0
            for a in range(joints):
                s += mass[a] * inverse[a, b]
            e.free_map[i, free_from + first + b] = 0.0 if held else -s


@kernel
def _weigh_free_acceleration(t: TargetsRecord, p: ProblemRecord, e: CondensationRecord, k: int, free_from: int) -> None:
    """Inverse weights of the free acceleration of limb k, which begins at zero; zero in stance."""
    rows = e.inverse.shape[2]
    held = t.held[rows * k // 3] != 0.0
    for b in range(free_from + rows * k, free_from + rows * (k + 1)):
        e.free_acceleration[b] = 0.0
        e.inverse_weight[b] = 0.0 if held or p.w_swing == 0.0 else 1.0 / p.w_swing


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
