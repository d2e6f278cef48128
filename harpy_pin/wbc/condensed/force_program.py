"""The program in the contact forces alone: what this package is about.

With the limbs eliminated (:mod:`harpy_pin.wbc.condensed.condense`) the whole-body problem is

    minimise    ½ fᵀ H f + gᵀ f,    H = G_fᵀ K⁻¹ G_f + w_f I,    g = −G_fᵀ K⁻¹ w
    subject to  every f_k in its friction pyramid and its range of normal force

with three unknowns for each foot: the cost of given forces is what the root's six equations leave of the tasks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import solve_transposed
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set_warm_start import EXCHANGES, exchange
from harpy_pin.wbc.dual import dual_active_set

if TYPE_CHECKING:
    from harpy_pin.wbc.condensed.condense import CondensationRecord
    from harpy_pin.wbc.condensed.condensed_solver import CondensedRecord, SearchRecord
    from harpy_pin.wbc.problem import ProblemRecord
    from harpy_pin.wbc.program import ProgramRecord
    from harpy_pin.wbc.weights import TargetsRecord

__all__: list[str] = []


@kernel
def force_objective(
    t: TargetsRecord, p: ProblemRecord, e: CondensationRecord, response: Vector, qp: ProgramRecord
) -> None:
    """H and g; the identity for the force of a swing foot, which is zero.

    Args:
        t: see :mod:`harpy_pin.wbc.problem`.
        p: see there.
        e: factored.
        response: (6, 3 feet) out: L⁻ᵀ G_f with K = Lᵀ L.
        qp: out.
    """
    response[:] = e.force_map
    root_cost(e, response, qp)
    for a in range(response.shape[1]):
        qp.hessian[a, a] += p.w_force if t.held[a // 3] != 0.0 else 1.0


@kernel
def root_cost(e: CondensationRecord, response: Vector, qp: ProgramRecord) -> None:
    """H = Gᵀ K⁻¹ G and g = −Gᵀ K⁻¹ w, with K = Lᵀ L.

    Args:
        e: factored.
        response: (6, n) G; becomes L⁻ᵀ G.
        qp: out.
    """
    n = response.shape[1]
    solve_transposed(e.factor, response, n)
    for i in range(6):
        e.multiplier[i] = e.right_hand_side[i]
    _solve_transposed(e.factor, e.multiplier)
    for a in range(n):
        s = 0.0
        for i in range(6):
            s += response[i, a] * e.multiplier[i]
        qp.gradient[a] = -s
        for b in range(a + 1):
            s = 0.0
            for i in range(6):
                s += response[i, a] * response[i, b]
            qp.hessian[a, b] = qp.hessian[b, a] = s


@kernel
def _solve_transposed(factor: Vector, x: Vector) -> None:
    """x ← L⁻ᵀ x for one vector x (6,)."""
    for i in range(5, -1, -1):
        x[i] *= factor[i, i]
        for k in range(i):
            x[k] -= factor[i, k] * x[i]


@kernel
def search_active_set(p: CondensedRecord, search: SearchRecord, z: Vector) -> None:
    """The optimum, by the last active set, its exchange, or the dual method; the status says whether one was found."""
    w, dual = search.exchange, search.dual
    systems, _ = exchange(search.program, w, z, EXCHANGES)
    p.status_and_systems[1] += systems
    if systems <= EXCHANGES:
        return
    outcome, exchanges = dual_active_set(search.program, dual, z)
    p.status_and_systems[1] += exchanges
    w.active[:] = dual.active
    finite = True
    for c in range(z.shape[0]):
        finite = finite and np.isfinite(z[c])
    if outcome == 0 and finite:
        return
    p.status_and_systems[0] |= 4
    w.active[:] = 0
    if not finite:
        z[:] = 0.0


@kernel
def into_cones(t: TargetsRecord, p: CondensedRecord) -> None:
    """Put every force into its range and cone: it changes only what is outside, and little after a good search."""
    for k in range(t.held.shape[0]):
        f = p.force[3 * k : 3 * k + 3]
        if t.held[k] == 0.0:
            f[:] = 0.0
            continue
        f[2] = min(max(f[2], p.least_share[k] * t.force_range[k, 0]), t.force_range[k, 1])
        inside, share = p.friction[k] * p.inscribed * f[2], 1.0
        for face in range(p.pyramid.shape[0]):
            outward = -(p.pyramid[face, 0] * f[0] + p.pyramid[face, 1] * f[1])
            if outward * share > inside:
                share = max(inside, 0.0) / outward
        f[0] *= share
        f[1] *= share
