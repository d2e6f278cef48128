"""The robot as six equations: limbs are eliminated, and the contact forces are what is left to choose.

A limb has as many joints as its foot has directions, three for a point and six for a patch, so the joints'
accelerations follow from the root's. Of limb k, with J_k = [J_kr J_kl] (columns of the root, its own) and α_k the
acceleration its foot is to have,

    a_k = ā_k + T_k a_r + J_kl⁺ δ_k,    ā_k = J_kl⁺ (α_k − J̇v_k),    T_k = −J_kl⁺ J_kr

where δ_k is by how much a foot in the air gives way; a held foot does not. J_kl⁺ is the inverse for a point. For a
patch J_k has three rows for each corner and J_kl⁺ is the pseudo-inverse: corners of one rigid body cannot do all that
is asked of each, and the body gets the nearest motion it can make. Joints that are on no limb, those of arms, torso and
head, have the acceleration that the posture task asks for, whatever the root does: a_j = ā_j.

No torque acts on the root, so its six rows of M a + n = S τ + Σ J_kᵀ f_k + J_tᵀ u become

    M_b a_r + n_b = G_f f + G_o o,    o = [u; δ]

with M_b = M_rr + Σ M_rk T_k, n_b = n_r + Σ M_rk ā_k + Σ M_rj ā_j, G_f = [J_krᵀ], and G_o holding the thrusters' J_trᵀ
and −M_rk J_kl⁺. For given f, the least of ‖a_r − a_d‖²_W + ‖o‖²_D under this equation is

    λ = K⁻¹ (w − G_f f),    o = D⁻¹ G_oᵀ λ,    a_r = a_d − W⁻¹ M_bᵀ λ
    w = M_b a_d + n_b,      K = M_b W⁻¹ M_bᵀ + G_o D⁻¹ G_oᵀ

and costs (w − G_f f)ᵀ K⁻¹ (w − G_f f). The torques are the joints' rows. With them the rigid robot's contact forces
*are* f, whichever f was chosen. The forces at the corners of a patch act on the robot by their wrench alone: of corner
forces with the same wrench the rigid robot knows no difference, and the chosen ones are one way to make it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed, solve_vector
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.wbc.weights import TargetsRecord, TaskWeightsRecord

__all__ = [
    "condensation_record",
    "eliminate_limbs",
    "fix_thrusts",
    "force_response",
    "input_map",
    "joint_torques",
    "recover",
    "root_factor",
    "solve_root",
]

MIN_DETERMINANT = 1e-6
"""Of a limb's J_kl, m³. Below it (a straight or folded leg) the inverse is damped, and the foot is not held exactly."""
MIN_PIVOT = 1e-8
"""Likewise for flat feet, of J_klᵀ J_kl, m²."""
_JOINTS = {1: 3}
"""Joints of a limb by the contact points of its foot; six for all others."""


class CondensationRecord(RecordOf):
    """A robot whose feet each hang on a limb of its own: of three joints for points, of six for flat feet.

    In the shapes a limb has j joints and its foot r = 3 rows for each corner: 3 and 3 for points, 6 and 12 for
    rectangles.

    ``thrusts`` is the number of thrust variables (:mod:`harpy_pin.model.rotor`).

    Attributes:
        limb: (limbs, j) columns of each limb's joints.
        others: columns of the joints that are on no limb.
        inverse: (limbs, j, r) J_kl⁺.
        normal: (j, j) factor of J_klᵀ J_kl, for flat feet.
        limb_bias: (limbs, j) ā_k.
        limb_map: (limbs, j, 6) T_k.
        mass: (6, 6) M_b.
        bias: (6,) n_b.
        force_map: (6, 3 feet) G_f; zero columns for feet in the air.
        free_map: (6, thrusts + 3 feet) G_o; zero columns for feet that are held.
        free_acceleration: (thrusts + 3 feet,) o.
        inverse_weight: (thrusts + 3 feet,) 1/D; zero for an entry of o that is fixed.
        inverse_body_weight: (6,) 1/W.
        desired: (6,) a_d.
        right_hand_side: (6,) w, less the part of what is fixed in o.
        factor: (6, 6) of K.
        multiplier: (6,) λ.
        acceleration: (nv,) a.
        push: (thrusts + 3 feet, thrusts + 3 feet) what units of the variables of :func:`input_map` do to o.
        motion: (nv, thrusts + 3 feet) what they do to a.
    """

    limb: NDArray[np.int64]
    others: NDArray[np.int64]
    inverse: Vector
    normal: Vector
    limb_bias: Vector
    limb_map: Vector
    mass: Vector
    bias: Vector
    force_map: Vector
    free_map: Vector
    free_acceleration: Vector
    inverse_weight: Vector
    inverse_body_weight: Vector
    desired: Vector
    right_hand_side: Vector
    factor: Vector
    multiplier: Vector
    acceleration: Vector
    push: Vector
    motion: Vector


def condensation_record(robot: Robot) -> Records[CondensationRecord]:
    """A new :class:`CondensationRecord`.

    Raises:
        InputError: the feet do not hang on such limbs, or are of several kinds.
    """
    model, feet, thrusts = robot.model, len(robot.feet), robot.n_thrust
    limbs = _limbs(robot)
    columns = {column for limb in limbs for column in limb}
    corners = robot.corners[0] if limbs else 1
    joints, rows = len(limbs[0]) if limbs else 3, 3 * corners
    return make_record(
        CondensationRecord,
        limb=np.array(limbs, dtype=np.int64).reshape(-1, joints),
        others=np.array([c for c in range(6, model.nv) if c not in columns], dtype=np.int64),
        inverse=np.zeros((len(limbs), joints, rows)),
        normal=np.zeros((joints, joints)),
        limb_bias=np.zeros((len(limbs), joints)),
        limb_map=np.zeros((len(limbs), joints, 6)),
        mass=np.zeros((6, 6)),
        bias=np.zeros(6),
        force_map=np.zeros((6, 3 * feet)),
        free_map=np.zeros((6, thrusts + 3 * feet)),
        free_acceleration=np.zeros(thrusts + 3 * feet),
        inverse_weight=np.zeros(thrusts + 3 * feet),
        inverse_body_weight=np.zeros(6),
        desired=np.zeros(6),
        right_hand_side=np.zeros(6),
        factor=np.zeros((6, 6)),
        multiplier=np.zeros(6),
        acceleration=np.zeros(model.nv),
        push=np.zeros((thrusts + 3 * feet, thrusts + 3 * feet)),
        motion=np.zeros((model.nv, thrusts + 3 * feet)),
    )


def _limbs(robot: Robot) -> list[list[int]]:
    """Columns of the joints between the root and each foot.

    Raises:
        InputError: feet of several kinds, a limb of another number of joints, or a joint that carries several feet.
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
                    f"joint '{model.names[joint]}' of '{robot.name}' carries the feet '{used[joint]}' and '{foot}': "
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
def eliminate_limbs(
    d: DynamicsRecord, t: TargetsRecord, p: TaskWeightsRecord, r: CondensationRecord, v: Vector
) -> None:
    """Fill in the equation, from records of the dynamics, the targets and the problem's weights."""
    thrusts = d.thruster_jacobian.shape[0]
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
        if r.inverse.shape[2] == 3:  # known when compiling: the other kernel is not part of the result
            _eliminate_point(d, t, p, r, k, thrusts)
        else:
            _eliminate_flat_foot(d, t, p, r, k, thrusts)
    for c in range(r.others.shape[0]):
        column = r.others[c]
        r.acceleration[column] = t.joints[column - 6]
        for i in range(6):
            r.bias[i] += d.mass_matrix[i, column] * r.acceleration[column]
    for i in range(6):
        s = r.bias[i]
        for j in range(6):
            s += r.mass[i, j] * r.desired[j]
        r.right_hand_side[i] = s


@kernel
def _eliminate_point(
    d: DynamicsRecord, t: TargetsRecord, p: TaskWeightsRecord, r: CondensationRecord, k: int, thrusts: int
) -> None:
    """One limb's accelerations from the root's, and what it adds to the root's rows; of three joints to a point."""
    limb, inverse, turn, drift = r.limb[k], r.inverse[k], r.limb_map[k], r.limb_bias[k]
    jacobian = d.foot_jacobian[3 * k : 3 * k + 3]
    held = t.held[k] != 0.0
    _invert_limb(jacobian, limb, inverse)
    for a in range(3):
        s = 0.0
        for b in range(3):
            s += inverse[a, b] * (t.feet[k, b] - d.foot_drift[3 * k + b])
        drift[a] = s
        for j in range(6):
            s = 0.0
            for b in range(3):
                s -= inverse[a, b] * jacobian[b, j]
            turn[a, j] = s
    for i in range(6):
        row = d.mass_matrix[i]
        m0, m1, m2 = row[limb[0]], row[limb[1]], row[limb[2]]
        r.bias[i] += m0 * drift[0] + m1 * drift[1] + m2 * drift[2]
        for j in range(6):
            r.mass[i, j] += m0 * turn[0, j] + m1 * turn[1, j] + m2 * turn[2, j]
        for b in range(3):
            r.force_map[i, 3 * k + b] = jacobian[b, i] if held else 0.0
            give = -(m0 * inverse[0, b] + m1 * inverse[1, b] + m2 * inverse[2, b])
            r.free_map[i, thrusts + 3 * k + b] = 0.0 if held else give
    for b in range(3):
        r.free_acceleration[thrusts + 3 * k + b] = 0.0
        r.inverse_weight[thrusts + 3 * k + b] = 0.0 if held or p.w_swing == 0.0 else 1.0 / p.w_swing


@kernel
def _eliminate_flat_foot(
    d: DynamicsRecord, t: TargetsRecord, p: TaskWeightsRecord, r: CondensationRecord, k: int, thrusts: int
) -> None:
    """Likewise, of six joints to a patch."""
    limb, inverse, turn, drift = r.limb[k], r.inverse[k], r.limb_map[k], r.limb_bias[k]
    joints, rows = inverse.shape
    first = rows * k
    jacobian = d.foot_jacobian[first : first + rows]
    held = t.held[first // 3] != 0.0
    _invert_flat_limb(jacobian, limb, r.normal, inverse)
    for a in range(joints):
        s = 0.0
        for b in range(rows):
            s += inverse[a, b] * (t.feet[(first + b) // 3, b % 3] - d.foot_drift[first + b])
        drift[a] = s
        for j in range(6):
            s = 0.0
            for b in range(rows):
                s -= inverse[a, b] * jacobian[b, j]
            turn[a, j] = s
    for i in range(6):
        row = d.mass_matrix[i]
        s = 0.0
        for a in range(joints):
            s += row[limb[a]] * drift[a]
        r.bias[i] += s
        for j in range(6):
            s = 0.0
            for a in range(joints):
                s += row[limb[a]] * turn[a, j]
            r.mass[i, j] += s
        for b in range(rows):
            r.force_map[i, first + b] = jacobian[b, i] if held else 0.0
            s = 0.0
            for a in range(joints):
                s += row[limb[a]] * inverse[a, b]
            r.free_map[i, thrusts + first + b] = 0.0 if held else -s
    for b in range(rows):
        r.free_acceleration[thrusts + first + b] = 0.0
        r.inverse_weight[thrusts + first + b] = 0.0 if held or p.w_swing == 0.0 else 1.0 / p.w_swing


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
def root_factor(r: CondensationRecord) -> None:
    """Factor of K, with the entries of o whose ``ease`` is zero taken as fixed."""
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
    """λ, o and a for contact forces f; entries of o that are fixed stay as they are (and are part of the load)."""
    for i in range(6):
        s = r.right_hand_side[i]
        for c in range(f.shape[0]):
            s -= r.force_map[i, c] * f[c]
        r.multiplier[i] = s
    solve_vector(r.factor, r.multiplier)
    thrusts = r.inverse_weight.shape[0] - f.shape[0]
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
    limbs, joints, rows = r.inverse.shape
    for k in range(limbs):
        for x in range(joints):
            s = r.limb_bias[k, x]
            for j in range(6):
                s += r.limb_map[k, x, j] * a[j]
            for b in range(rows):
                s += r.inverse[k, x, b] * r.free_acceleration[thrusts + rows * k + b]
            a[r.limb[k, x]] = s


@kernel
def joint_torques(d: DynamicsRecord, r: CondensationRecord, v: Vector, f: Vector, torque: Vector) -> None:
    """Torques of the joints for contact forces f and what :func:`recover` made of them."""
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
    """Fix the thrusts that are beyond their limits there; the equation then wants a new factor.

    Args:
        r: record of the equation.
        lower: (thrust variables,) least thrusts, N.
        upper: likewise the largest.

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


@kernel
def input_map(
    d: DynamicsRecord,
    t: TargetsRecord,
    r: CondensationRecord,
    v: Vector,
    response: Vector,
    gain: Vector,
    at_rest: Vector,
    fixed: bool,
) -> None:
    """Thrusts and torques as an affine function of the contact forces: [u; τ] = at_rest + gain f.

    With all of o fixed, at zero, as one of y = [u; …], in which a foot has its force where it is held, and its give-way
    where it is in the air: [u; τ] = at_rest + gain y.

    Args:
        d: element of the dynamics' record.
        t: of the targets' record.
        r: of the equation, factored.
        v: (nv,) generalised velocity.
        response: (6, n) L⁻ᵀ G of these variables; becomes K⁻¹ G.
        gain: (thrusts + joints, n) out; zero columns for the forces of feet in the air.
        at_rest: (thrusts + joints,) out.
        fixed: whether all of o is.
    """
    n, nv, thrusts = response.shape[1], v.shape[0], d.thruster_jacobian.shape[0]
    first = thrusts if fixed else 0  # of the feet's columns
    nothing = np.zeros(n - first)
    recover(r, nothing)
    for c in range(thrusts):
        at_rest[c] = r.free_acceleration[c]
    joint_torques(d, r, v, nothing, at_rest[thrusts:])
    solve_factor(r.factor, response, n)
    # What units of the variables do: to o (into ``push``), to the accelerations (``motion``), to the torques.
    push, motion = r.push, r.motion
    for c in range(r.inverse_weight.shape[0]):
        for a in range(n):
            push[c, a] = 0.0
        if r.inverse_weight[c] != 0.0:
            for i in range(6):
                x = -r.inverse_weight[c] * r.free_map[i, c]
                for a in range(n):
                    push[c, a] += x * response[i, a]
        elif fixed and (c < thrusts or t.held[(c - thrusts) // 3] == 0.0):
            push[c, c] = 1.0
    for j in range(6):
        for a in range(n):
            motion[j, a] = 0.0
        for i in range(6):
            x = r.inverse_body_weight[j] * r.mass[i, j]
            for a in range(n):
                motion[j, a] += x * response[i, a]
    limbs, joints, rows = r.inverse.shape
    for k in range(limbs):
        held = t.held[rows * k // 3] != 0.0
        for b in range(joints):
            row = r.limb[k, b]
            for a in range(n):
                motion[row, a] = 0.0
            for j in range(6):
                x = r.limb_map[k, b, j]
                for a in range(n):
                    motion[row, a] += x * motion[j, a]
            if not held:
                for j in range(rows):
                    x = r.inverse[k, b, j]
                    for a in range(n):
                        motion[row, a] += x * push[thrusts + rows * k + j, a]
    for c in range(thrusts):
        for a in range(n):
            gain[c, a] = push[c, a]
    for j in range(6, nv):
        row = thrusts + j - 6
        for a in range(n):
            gain[row, a] = 0.0
        for i in range(nv):
            x = d.mass_matrix[j, i]
            if x != 0.0:  # limbs do not feel each other
                for a in range(n):
                    gain[row, a] += x * motion[i, a]
        for c in range(thrusts):
            x = d.thruster_jacobian[c, j]
            if x != 0.0:
                for a in range(n):
                    gain[row, a] -= x * push[c, a]
    for k in range(limbs):
        if t.held[rows * k // 3] != 0.0:
            for b in range(joints):
                j = r.limb[k, b]
                for a in range(rows):
                    gain[thrusts + j - 6, first + rows * k + a] -= d.foot_jacobian[rows * k + a, j]
