"""The condensed controller's program where thrusts or torques are at their limits.

Without such limits, thrusts and the free accelerations of swing feet follow from the contact forces. With them they are
unknowns: y = [u; ε; y_1, y_2, …], in which ε are the free accelerations of the joints on no limb, and y_k is the
contact force of a stance foot and the free acceleration δ_k of a swing foot:

    minimise    ½ ‖L⁻ᵀ (w − G y)‖² + ½ w_u ‖u‖² + ½ w_ε ‖ε‖² + ½ Σ w_f ‖f_k‖² + ½ Σ w_δ ‖δ_k‖²
    subject to  pyramids and ranges of the f_k,  u_min ≤ u ≤ u_max,  |τ(y)| ≤ τ_max

with K = M_b W⁻¹ M_bᵀ = Lᵀ L, and τ affine in y. Where a torque is beyond its limit in the optimum without these limits,
the weight of swing feet and least forces are smaller (:mod:`harpy_pin.wbc.giving_way`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import solve_transposed
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.condense import CondensationRecord
from harpy_pin.wbc.condensed.input_map import input_map
from harpy_pin.wbc.condensed.root import root_factor, solve_root
from harpy_pin.wbc.problem import force_bounds

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.wbc.condensed.condensed_record import CondensedRecord
    from harpy_pin.wbc.program import ProgramRecord
    from harpy_pin.wbc.weights import TargetsRecord

__all__: list[str] = []


@kernel
def limited_program(d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord, v: Vector) -> None:
    """Fill in the program; all of o is fixed at zero from then on.

    It begins with the feet's shares.

    Args:
        d: element of the dynamics' record.
        t: of the targets' record.
        p: of the controller's record, its equations filled in.
        v: (nv,) generalised velocity.
    """
    r, qp, thrusts = p.root, p.limited.program, p.thrust_lower.shape[0]
    first = thrusts + r.others.shape[0]
    stiff = p.w_swing == 0.0  # swing feet have no free acceleration
    for c in range(r.inverse_weight.shape[0]):
        r.inverse_weight[c] = r.free_acceleration[c] = 0.0
    root_factor(r)
    for c in range(r.inverse_weight.shape[0]):
        for i in range(6):
            free = 0.0 if stiff and c >= first else r.free_map[i, c]
            p.wide_response[i, c] = free + (r.force_map[i, c - first] if c >= first else 0.0)
    _objective(t, p, r, qp, thrusts, stiff)
    if not stiff:
        _lower_swing_weight(t, p, qp)
    for c in range(thrusts):
        qp.lower[c], qp.upper[c] = p.thrust_lower[c], p.thrust_upper[c]
    faces = p.cones.pyramid.shape[1]
    force_bounds(t, faces, qp.lower[first:], qp.upper[first:])
    for k in range(t.held.shape[0]):
        qp.lower[first + (faces + 1) * k + faces] *= p.cones.least_share[k]
    _fit_rows_to_support(t, p, qp, first)
    input_map(d, t, r, v, p.wide_response, p.gain, p.at_rest, True)
    row = qp.lower.shape[0] - p.torque_limit.shape[0]
    for j in range(p.torque_limit.shape[0]):
        for a in range(p.gain.shape[1]):
            qp.inequality[row + j, a] = p.gain[thrusts + j, a]
        qp.lower[row + j] = -p.torque_limit[j] - p.at_rest[thrusts + j]
        qp.upper[row + j] = p.torque_limit[j] - p.at_rest[thrusts + j]


@kernel
def _lower_swing_weight(t: TargetsRecord, p: CondensedRecord, qp: ProgramRecord) -> None:
    """Leave each swing foot its share of the weight."""
    first = p.thrust_lower.shape[0] + p.root.others.shape[0]
    for a in range(first, p.unknowns.shape[0]):
        k = (a - first) // 3
        if t.held[k] == 0.0:
            qp.hessian[a, a] -= (1.0 - p.cones.swing_share[k]) * p.w_swing


@kernel
def _objective(
    t: TargetsRecord, p: CondensedRecord, r: CondensationRecord, qp: ProgramRecord, thrusts: int, stiff: bool
) -> None:
    """Hessian and gradient; turns the response from G into L⁻ᵀ G."""
    response, n, first = p.wide_response, p.wide_response.shape[1], thrusts + r.others.shape[0]
    solve_transposed(r.factor, response, n)
    for i in range(6):
        r.multiplier[i] = r.right_hand_side[i]
    solve_root(r, r.multiplier)
    for a in range(n):
        s = 0.0
        for i in range(6):
            s += response[i, a] * r.multiplier[i]
        qp.gradient[a] = -s
        for b in range(a + 1):
            s = 0.0
            for i in range(6):
                s += response[i, a] * response[i, b]
            qp.hessian[a, b] = qp.hessian[b, a] = s
        if a < thrusts:
            qp.hessian[a, a] += p.w_thrust
        elif a < first:
            qp.hessian[a, a] += p.w_arms
        elif t.held[(a - first) // 3] != 0.0:
            qp.hessian[a, a] += p.w_force
        else:
            qp.hessian[a, a] += 1.0 if stiff else p.w_swing


@kernel
def _fit_rows_to_support(t: TargetsRecord, p: CondensedRecord, qp: ProgramRecord, before: int) -> None:
    """Pyramids bound forces: their rows are zero for swing feet, whose unknowns are accelerations."""
    faces = p.cones.pyramid.shape[1]
    for k in range(t.held.shape[0]):
        held = t.held[k] != 0.0
        first, column = before + (faces + 1) * k, before + 3 * k
        for row in range(faces):
            for i in range(3):
                qp.inequality[first + row, column + i] = p.cones.pyramid[k, row, i] if held else 0.0
        qp.inequality[first + faces, column + 2] = 1.0 if held else 0.0
