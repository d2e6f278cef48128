"""The contact forces: one equation in six unknowns, whatever the number of forces.

The optimum of :mod:`~harpy_pin.wbc.tree.elimination` minimises ½ (w − y)ᵀ K⁻¹ (w − y) + ½ ε ‖f‖²
with y = G f and every f_k in its cone C_k. With λ = K⁻¹ (w − y), the first-order condition says
that f_k minimises ½ ε ‖f_k‖² − λᵀ G_k f_k on C_k: it is the point of C_k nearest to G_kᵀ λ / ε. So
the optimum is the root of

    F(λ) = Σ_k G_k Π_k(G_kᵀ λ / ε) + K λ − w = 0,    f_k = Π_k(G_kᵀ λ / ε)

Thrusts are forces with intervals as cones and a weight of their own. F is the gradient of a
strictly convex function: K is positive definite, and Π_k is the gradient of a convex one (Moreau).
So the root is unique, and Newton's method with a search along each step descends to it. F is linear
as long as no force changes its piece of a cone's surface: a whole step without such a change ends
at the root itself.

**Tasks of momentum** add ½ ‖X y − h‖²_V, a function of y alone. By Woodbury's identity they change
K and w:

    K ← K − K Xᵀ S⁻¹ X K,    w ← w + K Xᵀ S⁻¹ (h − X w),    S = V⁻¹ + X K Xᵀ

**Bounded.** Where ``STEPS`` do not suffice, the weight ε is raised and comes down again, with some
steps for each weight. Forces are projections always, so what is at hand when the bound is reached
is in its cones; the motion that belongs to it follows from λ = K⁻¹ (w − G f) all the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import kernel
from harpy_pin.model.cholesky import factorise, solve_transposed, solve_vector
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import all_finite
from harpy_pin.wbc.tree.cones import project

STEPS = 12
"""Steps at the true weight of the forces, before it is raised."""
SOFTER, SOFT_STEPS, LAST_STEPS = 1e5, 8, 40
"""Factor on ε to begin with, steps with each weight on the way down by tens, and at the true
weight.
"""
EXACT = 1e-12
"""Residual, relative to the terms of the equation, that is rounding."""
SLOPE = 0.1
"""Share of the slope along a step that the search along it leaves."""
CUTS = 25
"""Points that the search along a step looks at."""
MIN_PIVOT = 1e-14
"""Least pivot of the Newton matrix, relative to its largest entry."""


class NewtonRecord(RecordOf):
    """The equation in λ, and its root."""

    compliance: Vector = sized(6, 6)  # K
    demand: Vector = sized(6)  # w
    soft: Vector = sized(6, 6)  # K with the tasks of momentum in it
    target: Vector = sized(6)  # w with them
    momentum_map: Vector = sized(6, 6)  # X
    momentum_target: Vector = sized(6)  # h
    momentum_weight: Vector = sized(6)  # V
    force_map: Vector = sized(
        "3 feet", 6
    )  # Gᵀ of the contact forces, in the axes of their contacts
    held: Vector = sized("feet", fill=1.0)  # 1 for a force that acts
    friction: Vector = sized("feet")  # of the faces
    force_range: Vector = sized("feet", 2)  # N
    faces: Vector  # (n, 3) see :func:`~harpy_pin.wbc.tree.cones.project`
    force_weight: float  # ε
    thrust_map: Vector = sized("thrusts", 6)  # Gᵀ of the thrusts
    thrust_weight: float
    thrust_range: Vector  # (thrusts, 2) N
    multiplier: Vector = sized(6)  # λ of the last tick, where the next one begins
    residual: Vector = sized(6)  # F
    step: Vector = sized(6)
    start: Vector = sized(6)
    matrix: Vector = sized(6, 6)  # derivative of F
    force: Vector = sized("3 feet")  # f in the axes of the contacts, N
    thrust: Vector = sized("thrusts")  # N
    derivative: Vector = sized("feet", 3, 3)  # of Π_k
    piece: NDArray[np.int64] = sized("feet", whole=True)
    thrust_piece: NDArray[np.int64] = sized("thrusts", whole=True)
    steps: int = ZERO  # of the last tick


@kernel
def find_forces(n: NewtonRecord) -> bool:
    """Forces and thrusts of the optimum, and λ = K⁻¹ (w − G f); whether the root was found."""
    add_momentum(n)
    n.steps = 0
    if not all_finite(n.target):
        return False
    found = _descend(n, 1.0, STEPS)
    if not found:
        n.multiplier[:] = 0.0
        softer = SOFTER
        while softer > 1.5:
            _descend(n, softer, SOFT_STEPS)
            softer *= 0.1
        found = _descend(n, 1.0, LAST_STEPS)
    return found


@kernel
def multiplier_of_forces(n: NewtonRecord, multiplier: Vector) -> None:
    """λ = K⁻¹ (w − G f): with it the root's equations hold for the forces at hand, whichever they
    are.
    """
    multiplier[:] = n.demand - n.force_map.T @ n.force
    if n.thrust.shape[0] > 0:
        multiplier -= n.thrust_map.T @ n.thrust
    factorise(n.compliance, n.matrix, MIN_PIVOT * _largest(n.compliance))
    solve_vector(n.matrix, multiplier)


@kernel
def add_momentum(n: NewtonRecord) -> None:
    """``soft`` and ``target``: K and w with the tasks of momentum in them."""
    n.soft[:] = n.compliance
    n.target[:] = n.demand
    if np.max(n.momentum_weight) == 0.0:
        return
    schur, right = np.empty((6, 6)), np.empty((6, 7))
    right[:, :6] = n.momentum_map @ n.compliance
    right[:, 6] = n.momentum_target - n.momentum_map @ n.demand
    schur[:] = right[:, :6] @ n.momentum_map.T
    for i in range(6):
        schur[i, i] += 1.0 / max(n.momentum_weight[i], 1e-30)
    factorise(schur, schur)
    solve_transposed(schur, right, 7)
    n.soft -= right[:, :6].T @ right[:, :6]
    n.target += right[:, :6].T @ right[:, 6]


@kernel
def _largest(matrix: Vector) -> float:
    """Largest entry of the diagonal (6, 6)."""
    largest = 0.0
    for i in range(6):
        largest = max(largest, matrix[i, i])
    return largest


@kernel
def _descend(n: NewtonRecord, softer: float, most: int) -> bool:
    """Newton's steps from ``multiplier``, with the weight of the forces times ``softer``; whether
    the root is found.
    """
    _evaluate(n, softer)
    for _ in range(most):
        size = np.max(abs(n.target)) + np.max(abs(n.soft @ n.multiplier))
        if np.max(abs(n.residual)) <= EXACT * size:
            return True
        n.steps += 1
        _newton_step(n, softer)
        n.start[:] = n.multiplier
        slope = n.step @ n.residual
        n.multiplier[:] = n.start + n.step
        if _evaluate(n, softer) == 0:
            return True
        if n.step @ n.residual > -SLOPE * slope:
            _search_along(n, softer, slope)
    return False


@kernel
def _evaluate(n: NewtonRecord, softer: float) -> int:
    """Forces and residual at ``multiplier``; how many forces are on another piece of their cone
    than before.
    """
    changed = 0
    n.residual[:] = n.soft @ n.multiplier - n.target
    for k in range(n.held.shape[0]):
        if n.held[k] != 0.0:
            pull, force = n.force_map[3 * k : 3 * k + 3], n.force[3 * k : 3 * k + 3]
            g = pull @ n.multiplier / (softer * n.force_weight)
            lower, upper = n.force_range[k]
            piece = project(g, n.friction[k], lower, upper, n.faces, force, n.derivative[k])
            changed += 1 if piece != n.piece[k] else 0
            n.piece[k] = piece
            n.residual += pull.T @ force
        else:
            n.force[3 * k : 3 * k + 3] = 0.0
    for k in range(n.thrust.shape[0]):
        g = n.thrust_map[k] @ n.multiplier / (softer * n.thrust_weight)
        lower, upper = n.thrust_range[k]
        piece = 1 if g < lower else 2 if g > upper else 0
        changed += 1 if piece != n.thrust_piece[k] else 0
        n.thrust_piece[k], n.thrust[k] = piece, min(max(g, lower), upper)
        n.residual += n.thrust[k] * n.thrust_map[k]
    return changed


@kernel
def _newton_step(n: NewtonRecord, softer: float) -> None:
    """``step`` = −(K + Σ G_k Π_k' G_kᵀ / ε)⁻¹ F."""
    n.matrix[:] = n.soft
    for k in range(n.held.shape[0]):
        if n.held[k] != 0.0:
            pull = n.force_map[3 * k : 3 * k + 3]
            turned = n.derivative[k] @ pull
            n.matrix += (pull.T @ turned) / (softer * n.force_weight)
    for k in range(n.thrust.shape[0]):
        if n.thrust_piece[k] == 0:
            n.matrix += np.outer(n.thrust_map[k], n.thrust_map[k]) / (softer * n.thrust_weight)
    factorise(n.matrix, n.matrix, MIN_PIVOT * _largest(n.matrix))
    n.step[:] = -n.residual
    solve_vector(n.matrix, n.step)


@kernel
def _search_along(n: NewtonRecord, softer: float, slope: float) -> None:
    """Go back to where the slope step · F, which grows along the step, is nearly zero (regula
    falsi, Illinois).
    """
    low, high, below, above = 0.0, 1.0, slope, np.dot(n.step, n.residual)
    for cut in range(CUTS):
        share = low - below * (high - low) / (above - below) if cut < 7 else 0.5 * (low + high)
        n.multiplier[:] = n.start + share * n.step
        _evaluate(n, softer)
        here = np.dot(n.step, n.residual)
        if abs(here) <= -SLOPE * slope:
            return
        if here < 0.0:
            low, below, above = share, here, 0.5 * above
        else:
            high, above, below = share, here, 0.5 * below
