"""The condensed controller's program where thrusts or torques are at their limits.

Without such limits, thrusts and the free accelerations of swing feet follow from the contact
forces. With them they are unknowns: y = [u; ε; y_1, y_2, …], in which ε are the free accelerations
of the joints on no limb, and y_k is the contact force of a stance foot and the free acceleration
δ_k of a swing foot:

    minimise    ½ ‖L⁻ᵀ (w − G y)‖² + ½ w_u ‖u‖² + ½ w_ε ‖ε‖² + ½ Σ w_f ‖f_k‖² + ½ Σ w_δ ‖δ_k‖²
    subject to  pyramids and ranges of the f_k,  u_min ≤ u ≤ u_max,  |τ(y)| ≤ τ_max

with K = M_b W⁻¹ M_bᵀ = Lᵀ L, and τ affine in y.

**What gives way.** A motor that cannot follow a swing foot would otherwise make the body pay: the
swing task's weight is several times that of the body, and its error grows with the square of what
is missing. So where the optimum without limits of thrusts and torques needs torques τ° beyond
theirs, the program that is solved with all limits has

- for a swing foot, only the share σ of its weight. σ falls from one to ``give_way`` while the
  largest |τ°| / τ_max of the joints that move the foot grows from 1 to 1 + ``SPAN``, so that
  nothing jumps.
- for a stance foot, ρ f_min in place of f_min, ρ = min τ_max / max(|τ°|, τ_max) over the joints
  that move the foot: a leg whose motors would need twice their limits has to bear half of the least
  force.

No torque at its limit: the program, and every digit of its solution, are those without all this.
The formulations of the whole-body QP give way alike.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import ByPrecision, kernel
from harpy_pin.model.cholesky import solve_factor
from harpy_pin.model.dynamics import DynamicsRecord, EquationsRecord
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.active_set import ProgramRecord
from harpy_pin.wbc.condensed.condense import (
    CondensationRecord,
    joint_torques,
    recover,
    root_factor,
    root_of_centre,
)
from harpy_pin.wbc.condensed.force_program import (
    ProblemRecord,
    TargetsRecord,
    force_bounds,
    root_cost,
)

if TYPE_CHECKING:
    from harpy_pin.wbc.condensed.solve import CondensedRecord

SPAN = 0.1
"""Excess of a torque over its limit, as a share of it, over which swing feet give way."""
NEAR = ByPrecision(1e-6, single=1e-3)
"""Distance of a thrust or torque from its limit, N and N·m, at which the optimum without limits is
looked at.
"""


@kernel
def limited_program(d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord, v: Vector) -> None:
    """Fill in the program, with the shares of each foot; all of o is fixed at zero from then on."""
    e, qp, thrusts, faces = (
        p.root,
        p.limited.program,
        d.thruster_jacobian.shape[0],
        p.pyramid.shape[0],
    )
    first = thrusts + e.others.shape[0]
    stiff = p.w_swing == 0.0  # swing feet have no free acceleration
    e.inverse_weight[:] = 0.0
    e.free_acceleration[:] = 0.0
    root_factor(e)
    p.wide_response[:, :first] = e.free_map[:, :first]
    p.wide_response[:, first:] = np.where(stiff, 0.0, e.free_map[:, first:]) + e.force_map
    root_cost(e, p.wide_response, qp)
    _add_weights(t, p, qp, e.others, thrusts)
    qp.lower[:thrusts], qp.upper[:thrusts] = p.input_lower[:thrusts], p.input_upper[:thrusts]
    force_bounds(t, faces, qp.lower[first:], qp.upper[first:])
    for k in range(t.held.shape[0]):
        qp.lower[first + (faces + 1) * k + faces] *= p.least_share[k]
    _fit_rows_to_support(t, p, qp, first)
    input_map(d, t, e, v, p.wide_response, p.gain, p.at_rest, True)
    row = qp.lower.shape[0] - p.torque_limit.shape[0]
    qp.inequality[row:, : p.gain.shape[1]] = p.gain[thrusts:]
    qp.lower[row:] = -p.torque_limit - p.at_rest[thrusts:]
    qp.upper[row:] = p.torque_limit - p.at_rest[thrusts:]


@kernel
def _add_weights(
    t: TargetsRecord, p: CondensedRecord, qp: ProgramRecord, others: NDArray[np.int64], thrusts: int
) -> None:
    """Add the weights of the variables; of its own each swing foot is left a share."""
    first = thrusts + others.shape[0]
    for a in range(qp.gradient.shape[0]):
        if a < thrusts:
            qp.hessian[a, a] += p.w_thrust
        elif a < first:
            qp.hessian[a, a] += p.w_arms * t.joint_share[others[a - thrusts] - 6]
        elif t.held[(a - first) // 3] != 0.0:
            qp.hessian[a, a] += p.w_force
            qp.gradient[a] -= p.w_force * t.force[(a - first) // 3, (a - first) % 3]
        elif p.w_swing == 0.0:
            qp.hessian[a, a] += 1.0
        else:
            qp.hessian[a, a] += p.w_swing
            qp.hessian[a, a] -= (1.0 - p.swing_share[(a - first) // 3]) * p.w_swing


@kernel
def _fit_rows_to_support(
    t: TargetsRecord, p: CondensedRecord, qp: ProgramRecord, before: int
) -> None:
    """Pyramids bound forces: their rows are zero for swing feet, whose unknowns are
    accelerations.
    """
    faces = p.pyramid.shape[0]
    for k in range(t.held.shape[0]):
        held, up = t.held[k] != 0.0, p.friction[k] * p.inscribed
        first, x = before + (faces + 1) * k, before + 3 * k
        qp.inequality[first : first + faces, x : x + 2] = np.where(held, p.pyramid[:, :2], 0.0)
        qp.inequality[first : first + faces, x + 2] = up if held else 0.0
        qp.inequality[first + faces, x + 2] = 1.0 if held else 0.0


@kernel
def input_map(
    d: DynamicsRecord,
    t: TargetsRecord,
    e: CondensationRecord,
    v: Vector,
    response: Vector,
    gain: Vector,
    at_rest: Vector,
    fixed: bool,
) -> None:
    """Thrusts and torques as an affine function of the contact forces: [u; τ] = at_rest + gain f.

    With all of o fixed at zero, they are a function of y = [u; …], which holds the force of a
    stance foot and the free acceleration of a swing foot: [u; τ] = at_rest + gain y. Between them
    are the free accelerations ε.

    ``response`` (6, n) is L⁻ᵀ G of these variables and becomes K⁻¹ G; ``gain`` (thrusts + joints,
    n) and ``at_rest`` (thrusts + joints,) are written; ``fixed`` says whether all of o is.
    """
    n, thrusts = response.shape[1], d.thruster_jacobian.shape[0]
    first = thrusts + e.others.shape[0]
    nothing = np.zeros(n - first if fixed else n)
    recover(e, nothing)
    at_rest[:thrusts] = e.free_acceleration[:thrusts]
    joint_torques(d, e, v, nothing, at_rest[thrusts:])
    solve_factor(e.factor, response, n)
    _free_per_unit(t, e, response, first, fixed)
    _motion_per_unit(t, e, response, thrusts)
    _input_per_unit(d, t, e, gain, first if fixed else 0)


@kernel
def _free_per_unit(
    t: TargetsRecord, e: CondensationRecord, response: Vector, first: int, fixed: bool
) -> None:
    """Entries of o per unit of each variable, into ``free_per_unit``."""
    free, n = e.free_per_unit, response.shape[1]
    for c in range(e.inverse_weight.shape[0]):
        free[c, :n] = -e.inverse_weight[c] * (e.free_map[:, c] @ response)
        if e.inverse_weight[c] != 0.0:
            continue
        if fixed and (c < first or t.held[(c - first) // 3] == 0.0):
            free[c, c] = 1.0


@kernel
def _motion_per_unit(
    t: TargetsRecord, e: CondensationRecord, response: Vector, thrusts: int
) -> None:
    """Generalised accelerations per unit of each variable, into ``motion_per_unit``."""
    free, motion, n = e.free_per_unit, e.motion_per_unit, response.shape[1]
    for j in range(6):
        motion[j, :n] = e.inverse_body_weight[j] * e.mass[:, j] @ response
    if e.centred:
        root_of_centre(e, motion, free, n, 0.0)
    others = e.others.shape[0]
    first = thrusts + others
    for c in range(others):
        motion[e.others[c], :n] = free[thrusts + c, :n]
    limbs, joints, rows = e.inverse.shape
    for k in range(limbs):
        held = t.held[rows * k // 3] != 0.0
        for b in range(joints):
            row = motion[e.limb[k, b], :n]
            row[:] = e.limb_map[k, b] @ motion[:6, :n]
            if not held:
                row += e.inverse[k, b] @ free[first + rows * k : first + rows * (k + 1), :n]


@kernel
def _input_per_unit(
    d: DynamicsRecord, t: TargetsRecord, e: CondensationRecord, gain: Vector, first: int
) -> None:
    """Thrusts and torques per unit of each variable; the columns of the feet begin at ``first``."""
    free, motion, n = e.free_per_unit, e.motion_per_unit, gain.shape[1]
    nv, thrusts = d.bias.shape[0], d.thruster_jacobian.shape[0]
    gain[:thrusts] = free[:thrusts, :n]
    gain[thrusts:] = 0.0
    for j in range(6, nv):
        row = gain[thrusts + j - 6]
        for i in range(nv):
            if d.mass_matrix[j, i] != 0.0:  # limbs do not feel each other
                row += d.mass_matrix[j, i] * motion[i, :n]
        for c in range(thrusts):
            if d.thruster_jacobian[c, j] != 0.0:
                row -= d.thruster_jacobian[c, j] * free[c, :n]
    limbs, joints, rows = e.inverse.shape
    for k in range(limbs):
        if t.held[rows * k // 3] != 0.0:
            jacobian, column = d.foot_jacobian[rows * k : rows * (k + 1)], first + rows * k
            for b in range(joints):
                j = e.limb[k, b]
                gain[thrusts + j - 6, column : column + rows] -= jacobian[:, j]


@kernel
def at_a_limit(inputs: Vector, p: ProblemRecord) -> bool:
    """Whether a thrust or torque is at its limit, or not a number."""
    found = False
    for c in range(inputs.shape[0]):
        found = found or not p.input_lower[c] + NEAR < inputs[c] < p.input_upper[c] - NEAR
    return found


@kernel
def outside(values: Vector, lower: Vector, upper: Vector) -> bool:
    """Whether one of the values is out of its range, or not a number."""
    found = False
    for c in range(values.shape[0]):
        found = found or not lower[c] <= values[c] <= upper[c]
    return found


@kernel
def share_of_swing(
    d: EquationsRecord, torque: Vector, limit: Vector, give_way: float, k: int
) -> float:
    """σ of a contact point, with ``give_way`` the least share; the others as of
    :func:`share_of_least_force`.
    """
    excess = 1.0 / share_of_least_force(d, torque, limit, k) - 1.0
    return 1.0 - (1.0 - give_way) * min(excess / SPAN, 1.0)


@kernel
def share_of_least_force(d: EquationsRecord, torque: Vector, limit: Vector, k: int) -> float:
    """ρ of a contact point; the torques are τ° and the limits τ_max, N·m."""
    share = 1.0
    for j in range(limit.shape[0]):
        moves = np.sum(abs(d.foot_jacobian[3 * k : 3 * k + 3, 6 + j]))
        if moves > 0.0 and abs(torque[j]) > limit[j]:
            share = min(share, limit[j] / abs(torque[j]))
    return share
