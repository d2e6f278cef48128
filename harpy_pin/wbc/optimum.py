"""The optimum of forces, thrusts and limits: Newton's search, from the last tick's pieces to the
result.

**Limits.** A limit is the range of a quantity s that is linear in motion and forces, such as a
torque. It is an equation more, x a + n − J_xᵀ f = s, and its multiplier ν one unknown more. The
search begins with the limits that are entered at one end of their ranges, s fixed there. A limit
whose multiplier pulls beyond it is left, one that is violated again is returned to, until there is
none of either: then multipliers and limits are those of the optimum. Where the limits together ask
for too much, the search begins again without any, and they enter one by one. Contacts may fix a
torque, so that its ν has no compliance in K. So it yields by δ (ν − ν₀); ν₀ moves to where ν is and
δ falls, until the term is nothing: the proximal point method.

**Tasks of momentum** add ½ ‖X y − h‖²_V, a function of y alone. By Woodbury's identity they change
K and w:

    K ← K − K Xᵀ S⁻¹ X K,    w ← w + K Xᵀ S⁻¹ (h − X w),    S = V⁻¹ + X K Xᵀ

**Bounded.** Where ``STEPS`` do not suffice, the weight ε is raised and comes down again, with some
steps for each weight. Forces are projections always, so what is at hand when the bound is reached
is in its cones; the motion that belongs to it follows from λ = K⁻¹ (w − G f) all the same.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.kernels import ByPrecision, diagonal, kernel
from harpy_pin.model.cholesky import factorise, solve_transposed, solve_vector
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import all_finite
from harpy_pin.wbc.newton import MIN_PIVOT, NewtonRecord, descend, largest

STEPS = 24
"""Steps at the true weight of the forces, before it is raised."""
SOFTER, SOFT_STEPS, LAST_STEPS = 1e5, 8, 40
"""Factor on ε to begin with, steps with each weight on the way down by tens, and at the true
weight.
"""
YIELD = ByPrecision(1e-4, single=1e-2)
"""δ to begin with, relative to the compliance of forces and motion to the limit's multiplier."""
TOGETHER, MOVES, LEAST_YIELD = 6, 60, 1e-12
"""Changes of several limits together, before they change one by one; all changes and proximal
steps, at most; and least share of δ, which falls tenfold with each of these.
"""
BEYOND = ByPrecision(1e-9, single=1e-5)
"""How far a quantity must be beyond its range to be a violation, relative to 1 + the limit."""
SETTLED = ByPrecision(1e-11, single=1e-4)
"""How far limits may yield, relative to 1 + the limit."""


@kernel
def find_forces(n: NewtonRecord) -> bool:
    """Forces and thrusts of the optimum, and λ = K⁻¹ (w − G f); whether the root was found."""
    add_momentum(n)
    if not all_finite(n.target):
        return False
    n.yielding = 1.0
    if n.limits == 0:
        return _find_root(n, n.multiplier[: n.bare.shape[0]])  # of a size known when compiling
    multiplier = n.multiplier[: n.bare.shape[0] + n.limits]
    found, one_by_one = _find_root(n, multiplier), False
    for move in range(MOVES):
        if found and not _exchange_limits(n, one_by_one or move >= TOGETHER) and _move_limits(n):
            return True
        if found:
            found = descend(n, multiplier, 1.0, LAST_STEPS, False)
        elif one_by_one:
            return False
        else:
            one_by_one = True
            n.limit_piece[: n.limits] = 0
            multiplier[:] = 0.0
            n.yielding = 1.0
            found = _find_root(n, multiplier)
    return False


@kernel
def _find_root(n: NewtonRecord, multiplier: Vector) -> bool:
    """The root; where Newton's steps do not suffice, by forces of a larger weight."""
    found = descend(n, multiplier, 1.0, STEPS, True)
    if not found:
        multiplier[:] = 0.0
        softer = SOFTER
        while softer > 1.5:
            descend(n, multiplier, softer, SOFT_STEPS, False)
            softer *= 0.1
        found = descend(n, multiplier, 1.0, LAST_STEPS, False)
    return found


@kernel
def _exchange_limits(n: NewtonRecord, one: bool) -> bool:
    """Leave limits whose multipliers pull beyond them, and return to those that are violated: all,
    or ``one``; whether there are any.
    """
    changed = False
    for k in range(n.limits):
        if changed and one:
            return True
        at, end = n.bare.shape[0] + k, n.limit_piece[k]
        lower, upper = n.limit_range[k]
        if end == 0:
            s = n.limited[k]
            end = 1 if s < lower - BEYOND * (1.0 + abs(lower)) else 0
            if s > upper + BEYOND * (1.0 + abs(upper)):
                end = 2
        elif n.multiplier[at] * (1.0 if end == 1 else -1.0) > 0.0:
            end = 0
            n.multiplier[at] = 0.0
        if end != n.limit_piece[k]:
            changed = True
            n.limit_piece[k] = end
            n.limit_last[k] = 0.0
    return changed


@kernel
def _move_limits(n: NewtonRecord) -> bool:
    """ν₀ of all limits to where ν is; whether it was there."""
    settled, first = True, n.bare.shape[0]
    for k in range(n.limits):
        if n.limit_piece[k] != 0:
            nu, limit = n.multiplier[first + k], n.limit_range[k, n.limit_piece[k] - 1]
            gap = n.yielding * n.limit_yield[k] * abs(nu - n.limit_last[k])
            settled = settled and gap <= SETTLED * (1.0 + abs(limit))
            n.limit_last[k] = nu
    n.yielding = max(0.1 * n.yielding, LEAST_YIELD)
    return settled


@kernel
def enter_limit(n: NewtonRecord, lower: float, upper: float, end: int) -> None:
    """One limit more, at its lower end, 1, or its upper one, 2, where it binds: its row of K, entry
    of w, columns of the maps and multiplier are there already.
    """
    k, at = n.limits, n.bare.shape[0] + n.limits
    n.limit_range[k, 0], n.limit_range[k, 1] = lower, upper
    n.limit_piece[k] = end
    n.limit_last[k] = n.multiplier[at]
    column = n.force_map[:, at]
    n.limit_yield[k] = YIELD * (n.compliance[at, at] + column @ column / n.force_weight)
    n.limits += 1


@kernel
def forget(n: NewtonRecord) -> None:
    """The next search starts without limits, and with every force inside its cone."""
    n.piece[:] = 0
    n.thrust_piece[:] = 0
    n.multiplier[:] = 0.0
    n.limits = 0


@kernel
def root_multiplier(n: NewtonRecord, found: bool) -> None:
    """``bare``: with it the root's equations and relative tasks hold for the forces and the
    multipliers of limits at hand, whichever they are; where the root was ``found``, and there is no
    task of momentum, it is that.
    """
    first, without = n.bare.shape[0], np.max(n.momentum_weight) == 0.0
    if found and without:
        n.bare[:] = n.multiplier[:first]
        return
    s, matrix = first + n.limits, n.matrix[:first, :first]
    n.bare[:] = n.demand[:first] - n.force_map[:, :first].T @ n.force
    if n.thrust.shape[0] > 0:
        n.bare[:] -= n.thrust_map[:, :first].T @ n.thrust
    if n.limit_range.shape[0] > 0:
        n.bare[:] -= n.multiplier[first:s] @ n.compliance[first:s, :first]
    factorise(n.compliance[:first, :first], matrix, MIN_PIVOT * largest(n.compliance))
    solve_vector(matrix, n.bare)


@kernel
def add_momentum(n: NewtonRecord) -> None:
    """``soft`` and ``target``: K and w with the tasks of momentum in them."""
    s = n.bare.shape[0] + n.limits
    n.soft[:s, :s] = n.compliance[:s, :s]
    n.target[:s] = n.demand[:s]
    n.target[s:] = 0.0
    if np.max(n.momentum_weight) == 0.0:
        return
    rows = n.momentum_weight.shape[0]
    schur, right = np.empty((rows, rows)), n.momentum_work[:, : s + 1]
    right[:, :s] = n.momentum_map @ n.compliance[:6, :s]
    right[:, s] = n.momentum_target - n.momentum_map @ n.demand[:6]
    schur[:] = right[:, :6] @ n.momentum_map.T
    diagonal(schur)[:] += 1.0 / np.maximum(n.momentum_weight, 1e-30)
    factorise(schur, schur)
    solve_transposed(schur, right, s + 1)
    n.soft[:s, :s] -= right[:, :s].T @ right[:, :s]
    n.target[:s] += right[:, :s].T @ right[:, s]
