"""Limbs whose foot determines the accelerations of their joints.

A limb of three joints with a point foot, or of six with a sole, has as many joints as its foot has
directions. So the accelerations of its joints follow from those of the root. For limb k, with J_k =
[J_kr J_kl] (columns of the root and of the limb) and α_k the desired acceleration of its foot,

    a_k = ā_k + T_k a_r + J_kl⁺ δ_k,    ā_k = J_kl⁺ (α_k − J̇v_k),    T_k = −J_kl⁺ J_kr

where δ_k is the free acceleration of a swing foot, with the cost ½ w ‖δ_k‖²; that of a stance foot
is zero. J_kl⁺ is the inverse for a point foot. For a sole J_k has three rows for each corner and
J_kl⁺ is the pseudo-inverse: the corners of one rigid body cannot follow every set of accelerations,
and the body gets the nearest motion.

In the root's equations M_r a + n_r = y the limb leaves

    M_rr + Σ M_rk T_k,    n_r + Σ M_rk ā_k,    Σ M_rk J_kl⁺ δ_k,    δ_k = −(M_rk J_kl⁺)ᵀ λ / w

that is, with z = [λ; 1] of :mod:`~harpy_pin.wbc.condensed.elimination`, additions to the rows X of
the root and to Φ. Nothing cancels in single precision, as contact rows beside the small
weight of a leg's posture would. A row x a of a limit is eliminated in the same way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import kernel
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.elimination import ROOT, TARGETS, EliminationRecord
from harpy_pin.wbc.targets import TargetsRecord

MIN_DETERMINANT = 1e-6
"""Least determinant of a limb's J_kl, m³; below it (a straight leg) the inverse is damped and the
foot not held.
"""
MIN_PIVOT = 1e-8
"""Least pivot of J_klᵀ J_kl of a sole, m²."""


class LimbsRecord(RecordOf):
    """The limbs. In the shapes a limb has j joints and its foot r = 3 rows for each contact point:
    3 and 3, or 6 and 12.
    """

    joint: NDArray[np.int64]  # (limbs, j) columns of each limb's joints
    foot: NDArray[np.int64]  # (limbs,) first contact point of each
    beside: NDArray[np.int64]  # contact points on no such limb
    inverse: Vector = sized("limbs", "j", "r")  # J_kl⁺
    normal: Vector = sized("j", "j")  # factor of J_klᵀ J_kl, of soles
    motion: Vector = sized("limbs", "j")  # ā_k
    turn: Vector = sized("limbs", "j", 6)  # T_k
    softness: Vector = sized("limbs")  # 1/w; zero for a foot that is held
    free_map: Vector = sized("limbs", "r", 6)  # −(M_rk J_kl⁺)ᵀ; of a foot that is not held
    free_acceleration: Vector = sized("limbs", "r")  # δ_k
    # −(x J_kl⁺)ᵀ of each limit that binds, behind the rows of relative tasks, which are on no limb
    limit_map: Vector = sized("relative + joints", "limbs", "r")


@kernel
def eliminate_limbs(
    d: DynamicsRecord, t: TargetsRecord, m: LimbsRecord, e: EliminationRecord
) -> None:
    """All limbs, out of the rows of the root and of Φ."""
    for k in range(m.joint.shape[0]):
        mass = d.mass_matrix[:ROOT, m.joint[k]]
        _limb_motion(d, t, m, k)
        e.matrix[:ROOT, :ROOT] += m.turn[k].T @ mass.T
        e.remainder[TARGETS, :ROOT] += mass @ m.motion[k]
        if m.softness[k] != 0.0:
            free = m.free_map[k]
            free[:] = -(m.inverse[k].T @ mass.T)
            e.remainder[:ROOT, :ROOT] -= m.softness[k] * (free.T @ free)


@kernel
def _limb_motion(d: DynamicsRecord, t: TargetsRecord, m: LimbsRecord, k: int) -> None:
    """J_kl⁺, ā_k and T_k of limb k: its accelerations from the root's."""
    rows = m.inverse.shape[2]
    points, foot, first = rows // 3, m.foot[k], 3 * m.foot[k]
    jacobian = d.foot_jacobian[first : first + rows]
    if rows == 3:  # known when compiling: the other kernel is not part of the result
        _invert_limb(jacobian[:, m.joint[k]], m.inverse[k])
    else:
        _invert_sole(jacobian, m.joint[k], m.normal, m.inverse[k])
    desired = t.feet[foot : foot + points].reshape((rows,))
    m.motion[k] = m.inverse[k] @ (desired - d.foot_drift[first : first + rows])
    m.turn[k] = -(m.inverse[k] @ jacobian[:, :ROOT])


@kernel
def _invert_limb(jacobian: Vector, out: Vector) -> None:
    """J_kl⁻¹ of J_kl (3, 3) by cofactors; damped where the limb is singular."""
    x, y, z = jacobian[:, 0], jacobian[:, 1], jacobian[:, 2]
    out[0], out[1], out[2] = np.cross(y, z), np.cross(z, x), np.cross(x, y)
    determinant = x @ out[0]
    out *= determinant / max(determinant * determinant, MIN_DETERMINANT**2)


@kernel
def _invert_sole(jacobian: Vector, joint: NDArray[np.int64], normal: Vector, out: Vector) -> None:
    """J_kl⁺ = (J_klᵀ J_kl)⁻¹ J_klᵀ; bounded where the limb is singular."""
    out[:] = jacobian[:, joint].T
    normal[:] = out @ out.T
    factorise(normal, normal, MIN_PIVOT)
    solve_transposed(normal, out, out.shape[1])
    solve_factor(normal, out, out.shape[1])


@kernel
def move_limbs(m: LimbsRecord, e: EliminationRecord, multiplier: Vector, limits: Vector) -> None:
    """Accelerations of the limbs, from those of the root, λ (6,), and the multipliers of limits."""
    for k in range(m.joint.shape[0]):
        motion = m.motion[k] + m.turn[k] @ e.acceleration[:ROOT]
        if m.softness[k] != 0.0:
            free = m.free_acceleration[k]
            free[:] = m.softness[k] * (m.free_map[k] @ multiplier)
            for n in range(limits.shape[0]):
                free += m.softness[k] * limits[n] * m.limit_map[n, k]
            motion += m.inverse[k] @ free
        e.acceleration[m.joint[k]] = motion


@kernel
def limbs_of_limit(m: LimbsRecord, n: int, row: Vector) -> float:
    """The limbs out of limit n, a row (nv,) of a quantity ``row`` a; returns what they add to the
    quantity without motion of the root.
    """
    bias = 0.0
    for k in range(m.joint.shape[0]):
        own = row[m.joint[k]]
        bias += own @ m.motion[k]
        row[:ROOT] += own @ m.turn[k]
        if m.softness[k] != 0.0:
            m.limit_map[n, k] = -(own @ m.inverse[k])
        row[m.joint[k]] = 0.0
    return bias


@kernel
def limbs_equation(m: LimbsRecord, n: int, compliance: Vector) -> None:
    """What free feet add to row and column of K of limit n."""
    at = ROOT + n
    for k in range(m.joint.shape[0]):
        if m.softness[k] != 0.0:
            own = m.softness[k] * m.limit_map[n, k]
            compliance[at, :ROOT] += own @ m.free_map[k]
            compliance[:ROOT, at] = compliance[at, :ROOT]
            for other in range(n + 1):
                compliance[at, ROOT + other] += own @ m.limit_map[other, k]
                compliance[ROOT + other, at] = compliance[at, ROOT + other]
