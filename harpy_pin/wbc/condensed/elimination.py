"""Accelerations eliminated along the tree: what tasks and contacts ask for, as six equations of the
root.

The whole-body optimum. With generalised accelerations a, contact forces and thrusts f,

    minimise    ½ Σ_i ‖J_i a − b_i‖²_W_i + ½ ‖X y − h‖²_V + ½ ‖J_c a − c‖² / ρ + ½ ε ‖f‖²
    subject to  M_r a + n_r = G f = y,    every f_k in its cone

where tasks are rows J_i of one path of the tree (frames, joints), contact rows J_c are held up to a
compliance ρ, y is the wrench of all outer forces on the root, and tasks of momentum are functions
of y alone (m c̈ = Σ f + m g). For given y, a is the least squares solution under six equations:

    H a + J_cᵀ μ + M_rᵀ λ = g,    J_c a − ρ μ = c,    M_r a = y − n_r
    H = Σ J_iᵀ W_i J_i,    g = Σ J_iᵀ W_i b_i

With z = [λ; 1] the first two are a system in (a, μ) with seven right-hand sides [−M_rᵀ, g; 0, c] z.
Once it is eliminated, ½ zᵀ Φ z is what is left of the Lagrangian, and its derivative by λ is

    y = w − K λ,    K = −Φ_λλ,    w = Φ_λ1 + n_r

so the cost of y is ½ (w − y)ᵀ K⁻¹ (w − y), with K (6, 6) whatever robot, tasks and contacts are.
:mod:`~harpy_pin.wbc.newton` chooses y and f; :func:`back_substitute` gives a for its λ.

**No fill-in.** A row on the path from the root to a joint adds to H entries between ancestors
alone. So H has the zeros of the mass matrix, and H = Lᵀ D L, from the tips to the root, keeps them
(Featherstone, Rigid Body Dynamics Algorithms, 2008, section 6.5). Row k of H has the entries of the
ancestors of joint k, packed by their depth: entry (k, e) is that of ``path[k, e]``. So what joint k
adds to an ancestor's row is the beginning of its own. The seven right-hand sides stand in front of
each row, since they are treated alike.

**Contact rows** of a branch at the root are one block. It is eliminated at the first joint of the
branch, after all its joints:

    S = ρ 1 + Σ_j y_j y_jᵀ / d_j,    H += Eᵀ S⁻¹ E,    X += Eᵀ S⁻¹ Z,    Φ += Zᵀ S⁻¹ Z

with y_j the entries of the rows when joint j was eliminated, E what is left of them at the root,
and Z their right-hand sides. S is positive definite: straight knees, redundant corners and
contradictory contacts need no case of their own. A row whose ρ is not small is a task with the
weight 1/ρ, which fills no row of H.

Limbs whose foot determines the accelerations of their joints are eliminated before, by
:mod:`~harpy_pin.wbc.condensed.limbs`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import kernel
from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector

ROOT = 6
"""Degrees of freedom of the root, which come first."""
SIDES = 7
"""Right-hand sides, which stand in front of each row: six of λ, and that of the targets."""
TARGETS = SIDES - 1
"""The right-hand side of the targets."""


class EliminationRecord(RecordOf):
    """The system in a and μ: as tasks and contacts write it, then eliminated in place."""

    # degrees of freedom of the joints that are eliminated along the tree, from the root to the tips
    order: NDArray[np.int64]
    depth: NDArray[np.int64]  # (nv,) of each degree of freedom
    # (nv, width) degrees of freedom from the root to each one, itself included
    path: NDArray[np.int64]
    filled: NDArray[np.int64]  # (nv,) 1 where the task of a frame may fill the row of H
    branch: NDArray[np.int64]  # (nv,) the branch with contacts that each joint is on; −1 for none
    first_row: NDArray[np.int64]  # (branches + 1,) where the contact rows of each branch begin
    row_end: NDArray[np.int64]  # (rows,) the last degree of freedom that each row depends on
    bias: Vector = sized("nv")  # n, with the damping of the joints
    compliance: Vector = sized("rows")  # ρ; those who write the rows write it
    # [X, H] with X = [M_rᵀ, −g]; then [D⁻¹ L⁻ᵀ X, L], of the root with D = 1
    matrix: Vector = sized("nv", "7 + width")
    inverse_pivot: Vector = sized("nv", fill=1.0)  # D⁻¹
    # [0, −c, J_c], packed alike; then [L_S⁻ᵀ Z, L_S⁻ᵀ E, y_j]
    rows: Vector = sized("rows", "7 + width")
    schur: Vector = sized("rows", "rows")  # factors of S = L_Sᵀ L_S, one below the other
    remainder: Vector = sized(7, 7)  # Φ
    # D⁻¹ L⁻ᵀ x of each row that is eliminated last: of relative tasks, and of limits that bind
    last_sides: Vector = sized("relative + joints", "nv")
    last_rows: Vector = sized("relative + joints", "rows")  # of the contact rows, L_S⁻ᵀ z
    multiplier: Vector = sized("rows")  # μ
    acceleration: Vector = sized("nv")  # a


@kernel
def begin_elimination(d: DynamicsRecord, e: EliminationRecord, v: Vector) -> None:
    """Φ, and n with the damping of the joints."""
    e.bias[:] = d.bias + d.damping * v
    e.remainder[:] = 0.0


@kernel
def begin_row(
    d: DynamicsRecord, e: EliminationRecord, k: int, weight: float, desired: float
) -> None:
    """The row of degree of freedom k, with the weight of its own task: no other one, no contact."""
    row = e.matrix[k]
    row[:ROOT], row[ROOT:] = d.mass_matrix[:ROOT, k], 0.0
    row[TARGETS], row[SIDES + e.depth[k]] = -weight * desired, weight


@kernel
def eliminate(e: EliminationRecord) -> None:
    """Φ, from the tips to the root."""
    for n in range(e.order.shape[0] - 1, -1, -1):
        k = e.order[n]
        _eliminate_joint(e, k)
        if e.depth[k] == ROOT and e.branch[k] >= 0:
            _eliminate_contacts(e, e.first_row[e.branch[k]], e.first_row[e.branch[k] + 1])
    root, sides = e.matrix[:ROOT, SIDES : SIDES + ROOT], e.matrix[:ROOT, :SIDES]
    factorise(root, root)
    solve_transposed(root, sides, SIDES)
    e.remainder -= sides.T @ sides


@kernel
def _eliminate_joint(e: EliminationRecord, k: int) -> None:
    """Degree of freedom k out of the rows of its ancestors, of its contacts, and of Φ."""
    d, h = SIDES + e.depth[k], np.array(e.matrix[k])
    inverse = 1.0 / h[d]
    e.inverse_pivot[k] = inverse
    if e.branch[k] >= 0:
        for r in range(e.first_row[e.branch[k]], e.first_row[e.branch[k] + 1]):
            if e.path[e.row_end[r], e.depth[k]] == k:
                share = inverse * e.rows[r, d]
                e.rows[r, :d] -= share * h[:d]
    if e.filled[k]:
        for i in range(e.depth[k]):
            share = inverse * h[SIDES + i]
            e.matrix[e.path[k, i]] -= share * h  # beyond its own depth a row is never read
    e.remainder -= inverse * np.outer(h[:SIDES], h[:SIDES])
    e.matrix[k] = inverse * h


@kernel
def _eliminate_contacts(e: EliminationRecord, first: int, last: int) -> None:
    """The contact rows of a branch, all of whose joints are eliminated."""
    schur = e.schur[first:last, : last - first]
    for r in range(first, last):
        for s in range(first, r + 1):
            schur[r - first, s - first] = _schur_entry(e, r, s) + (
                e.compliance[r] if r == s else 0.0
            )
    factorise(schur, schur)
    solve_transposed(schur, e.rows[first:last], SIDES + ROOT)
    left = e.rows[first:last, : SIDES + ROOT]
    e.matrix[:ROOT, : SIDES + ROOT] += left[:, SIDES:].T @ left
    e.remainder += left[:, :SIDES].T @ left[:, :SIDES]


@kernel
def _schur_entry(e: EliminationRecord, r: int, s: int) -> float:
    """Σ_j y_j y_jᵀ / d_j of two rows of a branch, over the joints that both depend on."""
    end, other, total = e.row_end[r], e.row_end[s], 0.0
    for n in range(ROOT, min(e.depth[end], e.depth[other]) + 1):
        if e.path[end, n] != e.path[other, n]:
            break
        total += e.rows[r, SIDES + n] * e.rows[s, SIDES + n] * e.inverse_pivot[e.path[end, n]]
    return total


@kernel
def root_equations(e: EliminationRecord, compliance: Vector, demand: Vector) -> None:
    """K (6, 6) and w (6,) of y = w − K λ, after :func:`eliminate`."""
    demand[:ROOT] = e.remainder[ROOT, :ROOT] + e.bias[:ROOT]
    compliance[:ROOT, :ROOT] = -e.remainder[:ROOT, :ROOT]


@kernel
def eliminate_last(e: EliminationRecord, n: int, row: Vector) -> None:
    """The right-hand side of row n of those that are last, after :func:`eliminate`: of a quantity
    x a, with ``row`` x (nv,).
    """
    side, rows = e.last_sides[n], e.last_rows[n]
    side[:] = row
    rows[:] = 0.0
    for m in range(e.order.shape[0] - 1, -1, -1):
        k = e.order[m]
        d, branch, here = e.depth[k], e.branch[k], side[k]
        side[k] = e.inverse_pivot[k] * here
        if branch >= 0:
            first, last = e.first_row[branch], e.first_row[branch + 1]
            for r in range(first, last):
                if e.path[e.row_end[r], d] == k:
                    rows[r] -= side[k] * e.rows[r, SIDES + d]
        if e.filled[k]:
            for i in range(d):
                side[e.path[k, i]] -= here * e.matrix[k, SIDES + i]
        if d == ROOT and branch >= 0:
            schur, own = e.schur[first:last, : last - first], rows[first:last]
            solve_transposed(schur, own.reshape((last - first, 1)), 1)
            side[:ROOT] += own @ e.rows[first:last, SIDES : SIDES + ROOT]
    root = e.matrix[:ROOT, SIDES : SIDES + ROOT]
    solve_transposed(root, side[:ROOT].reshape((ROOT, 1)), 1)


@kernel
def last_equation(e: EliminationRecord, n: int, compliance: Vector, demand: Vector) -> None:
    """Row and column of K, and entry of w, of that quantity; ``demand`` is without its bias."""
    side, rows, at = e.last_sides[n], e.last_rows[n], ROOT + n
    freed = side / e.inverse_pivot
    entry = rows @ e.rows[:, :SIDES] - freed @ e.matrix[:, :SIDES]
    demand[at] = entry[ROOT]
    compliance[at, :ROOT] = compliance[:ROOT, at] = -entry[:ROOT]
    row, column = compliance[at, ROOT : at + 1], compliance[ROOT : at + 1, at]
    row[:] = column[:] = e.last_sides[: n + 1] @ freed - e.last_rows[: n + 1] @ rows


@kernel
def back_substitute(e: EliminationRecord, z: Vector, others: Vector) -> None:
    """a and μ of z = [λ; 1] (7,) and multipliers of the last rows, from the root to the tips."""
    base = e.acceleration[:ROOT]
    base[:] = -(e.matrix[:ROOT, :SIDES] @ z) - others @ e.last_sides[: others.shape[0], :ROOT]
    solve_factor(e.matrix[:ROOT, SIDES : SIDES + ROOT], base.reshape((ROOT, 1)), 1)
    for m in range(e.order.shape[0]):
        k = e.order[m]
        d, branch, pull = e.depth[k], e.branch[k], 0.0
        if branch >= 0:
            first, last = e.first_row[branch], e.first_row[branch + 1]
            if d == ROOT:
                mu = e.multiplier[first:last]
                mu[:] = e.rows[first:last, :SIDES] @ z
                mu += e.rows[first:last, SIDES : SIDES + ROOT] @ base
                mu += others @ e.last_rows[: others.shape[0], first:last]
                solve_factor(e.schur[first:last, : last - first], mu.reshape((last - first, 1)), 1)
            for r in range(first, last):
                if e.path[e.row_end[r], d] == k:
                    pull += e.rows[r, SIDES + d] * e.multiplier[r]
        pull = e.inverse_pivot[k] * pull + e.matrix[k, :SIDES] @ z
        pull += others @ e.last_sides[: others.shape[0], k]
        if e.filled[k]:
            for i in range(d):
                pull += e.matrix[k, SIDES + i] * e.acceleration[e.path[k, i]]
        e.acceleration[k] = -pull
