"""The contact forces: one equation in six unknowns, whatever the number of forces.

With the accelerations eliminated, what is left of a whole-body optimum minimises
½ (w − y)ᵀ K⁻¹ (w − y) + ½ ε ‖f‖² with y = G f and every f_k in its cone C_k; for K, w and G see
:mod:`~harpy_pin.wbc.condensed.elimination`. With λ = K⁻¹ (w − y), the first-order condition says
that f_k minimises ½ ε ‖f_k‖² − λᵀ G_k f_k on C_k: it is the point of C_k nearest to G_kᵀ λ / ε. So
the optimum is the root of

    F(λ) = Σ_k G_k Π_k(G_kᵀ λ / ε) + K λ − w = 0,    f_k = Π_k(G_kᵀ λ / ε)

Thrusts are forces with intervals as cones and a weight of their own. Where forces f* are planned,
the cost is ½ ε ‖f − f*‖², and f_k = Π_k(f*_k + G_kᵀ λ / ε). A limit that binds adds one unknown to
λ, a row and a column to K, an entry to w, and a column to every G_kᵀ
(:mod:`~harpy_pin.wbc.optimum`).

F is the gradient of a strictly convex function: K is positive definite, and Π_k is the gradient of
a convex one (Moreau). So the root is unique, and Newton's method with a search along each step
descends to it. F is linear as long as no force changes its piece of a cone's surface: a whole step
without such a change ends at the root itself. Pieces seldom change from tick to tick, so the first
step takes those of the last tick, and then is the only one.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import ByPrecision, diagonal, kernel
from harpy_pin.model.cholesky import factorise, solve_vector
from harpy_pin.model.record import ZERO, RecordOf, Records, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.cones import on_piece, project
from harpy_pin.wbc.weights import WholeBodyLimits

TOTAL = 500
"""Steps of all searches for one elimination, at most."""
EXACT = ByPrecision(1e-12, single=1e-6)
"""Residual, relative to the terms of the equation, that is rounding."""
GUESSED = ByPrecision(1e-13, single=1e-5)
"""Residual that a guess may leave: it does not begin at the root of the last step, and so is less
exact.
"""
SLOPE = 0.03
"""Share of the slope along a step that the search along it leaves."""
CUTS = 25
"""Points that the search along a step looks at."""
MIN_PIVOT = 1e-14
"""Least pivot of the Newton matrix, relative to its largest entry."""
APART = 1e30
"""Pivot of an equation that is left out: its unknown stays zero."""


class NewtonRecord(RecordOf):
    """The equation in λ, and its root: six unknowns, and one for each limit that binds."""

    limits: int = ZERO  # how many there are
    compliance: Vector = sized("6 + relative + joints", "6 + relative + joints")  # K
    demand: Vector = sized("6 + relative + joints")  # w
    soft: Vector = sized(
        "6 + relative + joints", "6 + relative + joints"
    )  # K with the tasks of momentum in it
    target: Vector = sized("6 + relative + joints")  # w with them
    momentum_map: Vector = sized("momenta", 6)  # X
    momentum_target: Vector = sized("momenta")  # h
    momentum_weight: Vector = sized("momenta")  # V
    momentum_work: Vector = sized("momenta", "7 + relative + joints")
    # Gᵀ of the contact forces, in the axes of their contacts
    force_map: Vector = sized("3 feet", "6 + relative + joints")
    held: Vector = sized("feet", fill=1.0)  # 1 for a force that acts
    friction: Vector = sized("feet")  # of the faces
    force_range: Vector = sized("feet", 2)  # N
    faces: Vector  # (n, 3) see :func:`~harpy_pin.wbc.cones.project`
    force_weight: float  # ε
    planned: Vector = sized("3 feet")  # f* in the axes of the contacts, N
    thrust_map: Vector = sized("thrusts", "6 + relative + joints")  # Gᵀ of the thrusts
    thrust_weight: float
    thrust_range: Vector = sized("thrusts", 2)  # N
    limit_range: Vector = sized("joints", 2)  # of each quantity at a limit
    limit_yield: Vector = sized("joints")  # δ to begin with
    yielding: float = 1.0  # share of it that is left
    limit_last: Vector = sized("joints")  # ν₀
    multiplier: Vector = sized("6 + relative + joints")  # λ
    residual: Vector = sized("6 + relative + joints")  # F
    step: Vector = sized("6 + relative + joints")
    start: Vector = sized("6 + relative + joints")
    matrix: Vector = sized("6 + relative + joints", "6 + relative + joints")  # derivative of F
    force: Vector = sized("3 feet")  # f in the axes of the contacts, N
    thrust: Vector = sized("thrusts")  # N
    limited: Vector = sized("joints")  # each quantity whose limit does not bind
    derivative: Vector = sized("feet", 3, 3)  # of Π_k
    turned: Vector = sized(3, "6 + relative + joints")  # Π_k' G_kᵀ
    piece: NDArray[np.int64] = sized("feet", whole=True)
    thrust_piece: NDArray[np.int64] = sized("thrusts", whole=True)
    # of each limit: 0 where it does not bind, 1 at the lower end of its range, 2 at the upper one
    limit_piece: NDArray[np.int64] = sized("joints", whole=True)
    # along a step: the linear part of the slope, and forces and thrusts before their projections,
    # each at the start and per step; and the share of the slope of each
    line: Vector = sized(2)
    line_force: Vector = sized("feet", 3, 3)
    line_thrust: Vector = sized(3, "thrusts")
    # λ without the tasks of momentum, and the multipliers of relative tasks
    bare: Vector = sized("6 + relative")
    steps: int = ZERO  # of the last solve, in all its searches


def newton_record(
    sizes: Mapping[str, int], limits: WholeBodyLimits, *, force_weight: float, thrust_weight: float
) -> Records[NewtonRecord]:
    """A new :class:`NewtonRecord`, with the faces and the friction of the limits.

    Args:
        sizes: of the robot, ``momenta``, the number of rows of momentum, and ``relative``, that of
            relative tasks.
        limits: friction of the ground and faces of the pyramids.
        force_weight: ε.
        thrust_weight: of the thrusts.
    """
    angle = 2.0 * np.pi * np.arange(int(limits.faces)) / limits.faces
    return make_record(
        NewtonRecord,
        sizes,
        friction=np.full(sizes["feet"], limits.friction_share * limits.mu * limits.inscribed),
        faces=np.column_stack(
            (np.cos(angle), np.sin(angle), np.full(len(angle), np.tan(np.pi / limits.faces)))
        ),
        force_weight=force_weight,
        thrust_weight=thrust_weight,
    )


@kernel
def descend(n: NewtonRecord, multiplier: Vector, softer: float, most: int, guess: bool) -> bool:
    """Newton's steps from ``multiplier``, with the weight of the forces times ``softer``; whether
    the root is found.

    With ``guess`` the first one does not begin there: it goes to the root, if every force were on
    the piece on which it is at hand.
    """
    s = multiplier.shape[0]
    start, step, residual, matrix = n.start[:s], n.step[:s], n.residual[:s], n.matrix[:s, :s]
    if not guess:
        _evaluate(n, multiplier, softer)
    for count in range(min(most, TOTAL - n.steps)):
        n.steps += 1
        start[:] = 0.0
        _linearise(n, step, softer)
        if not guess or count > 0:
            start[:] = multiplier
            step[:] = -residual
        solve_vector(matrix, step)
        slope = step @ residual
        multiplier[:] = start + step
        changed = _evaluate(n, multiplier, softer)
        guessed = guess and count == 0
        if changed == 0 and not guessed:
            return True
        if _settled(n, multiplier, GUESSED if changed == 0 else EXACT):
            return True
        ahead = step @ residual
        if not guessed:
            if ahead > -SLOPE * slope:
                _search_along(n, multiplier, softer, slope)
        else:
            left, nothing = np.max(abs(residual)), np.max(abs(n.target[:s]))
            if left > nothing:  # worse than no guess
                multiplier[:] = 0.0
                _evaluate(n, multiplier, softer)
    return False


@kernel
def _settled(n: NewtonRecord, multiplier: Vector, share: float) -> bool:
    """Whether the residual is at most a share of the terms of the equation."""
    s = multiplier.shape[0]
    size = np.max(abs(n.target[:s]) + abs(diagonal(n.soft[:s, :s]) * multiplier))
    return bool(np.max(abs(n.residual[:s])) <= share * size)


@kernel
def _evaluate(n: NewtonRecord, multiplier: Vector, softer: float) -> int:
    """Forces and residual at ``multiplier``; how many forces are on another piece of their cone
    than before.
    """
    s, changed, per_force = multiplier.shape[0], 0, 1.0 / (softer * n.force_weight)
    first = n.bare.shape[0]
    residual = n.residual[:s]
    residual[:] = n.soft[:s, :s] @ multiplier - n.target[:s]
    for k in range(n.held.shape[0]):
        if n.held[k] != 0.0:
            pull, force = n.force_map[3 * k : 3 * k + 3, :s], n.force[3 * k : 3 * k + 3]
            g = per_force * (pull @ multiplier) + n.planned[3 * k : 3 * k + 3]
            lower, upper = n.force_range[k]
            piece = project(g, n.friction[k], lower, upper, n.faces, force)
            changed += 1 if piece != n.piece[k] else 0
            n.piece[k] = piece
            residual += pull.T @ force
        else:
            n.force[3 * k : 3 * k + 3] = 0.0
    if n.thrust.shape[0] > 0:
        g = n.thrust_map[:, :s] @ multiplier / (softer * n.thrust_weight)
        lower, upper = n.thrust_range[:, 0], n.thrust_range[:, 1]
        ends = np.where(g < lower, 1, np.where(g > upper, 2, 0))
        changed += int(np.sum(ends != n.thrust_piece))
        n.thrust_piece[:], n.thrust[:] = ends, np.clip(g, lower, upper)
        residual += n.thrust @ n.thrust_map[:, :s]
    for k in range(s - first):
        if n.limit_piece[k] == 0:
            n.limited[k] = -residual[first + k]
            residual[first + k] = 0.0
        else:
            away = multiplier[first + k] - n.limit_last[k]
            limit = n.limit_range[k, n.limit_piece[k] - 1]
            residual[first + k] += limit + n.yielding * n.limit_yield[k] * away
    return changed


@kernel
def _linearise(n: NewtonRecord, root: Vector, softer: float) -> None:
    """F, if every force were on its piece wherever λ is: the factor of its derivative, and the
    right-hand side whose solution is its root.
    """
    s, first, per_force = root.shape[0], n.bare.shape[0], 1.0 / (softer * n.force_weight)
    matrix, turned, offset = n.matrix[:s, :s], n.turned[:, :s], np.empty((3,))
    matrix[:] = n.soft[:s, :s]
    root[:] = n.target[:s]
    for k in range(n.held.shape[0]):
        if n.held[k] != 0.0:
            pull, slope = n.force_map[3 * k : 3 * k + 3, :s], n.derivative[k]
            lower, upper = n.force_range[k]
            on_piece(n.piece[k], n.friction[k], lower, upper, n.faces, offset, slope)
            offset += slope @ n.planned[3 * k : 3 * k + 3]
            root -= pull.T @ offset
            turned[:] = per_force * (slope @ pull)
            matrix += pull.T @ turned
    for k in range(n.thrust.shape[0]):
        column, end = n.thrust_map[k, :s], n.thrust_piece[k]
        if end == 0:
            matrix += 1.0 / (softer * n.thrust_weight) * np.outer(column, column)
        else:
            root -= n.thrust_range[k, end - 1] * column
    for k in range(s - first):
        if n.limit_piece[k] == 0:
            matrix[first + k, first + k] = APART
        else:
            matrix[first + k, first + k] += n.yielding * n.limit_yield[k]
            root[first + k] += n.yielding * n.limit_yield[k] * n.limit_last[k]
            root[first + k] -= n.limit_range[k, n.limit_piece[k] - 1]
    factorise(matrix, matrix, MIN_PIVOT * largest(matrix))


@kernel
def _search_along(n: NewtonRecord, multiplier: Vector, softer: float, slope: float) -> None:
    """Go back to where the slope step · F, which grows along the step, is nearly zero (regula
    falsi, Illinois).
    """
    s = multiplier.shape[0]
    start, step, share = n.start[:s], n.step[:s], 1.0
    _begin_line(n, multiplier, softer)
    low, high, below, above = 0.0, 1.0, slope, _slope_along(n, 1.0)
    for cut in range(CUTS):
        share = low - below * (high - low) / (above - below) if cut < 7 else 0.5 * (low + high)
        here = _slope_along(n, share)
        if abs(here) <= -SLOPE * slope:
            break
        if here < 0.0:
            low, below, above = share, here, 0.5 * above
        else:
            high, above, below = share, here, 0.5 * below
    multiplier[:] = start + share * step
    _evaluate(n, multiplier, softer)


@kernel
def _begin_line(n: NewtonRecord, multiplier: Vector, softer: float) -> None:
    """What is linear along the step: part of the slope, and the forces before their projections."""
    s, first, per_force = multiplier.shape[0], n.bare.shape[0], 1.0 / (softer * n.force_weight)
    start, step = n.start[:s], n.step[:s]
    residual = n.residual[:s]  # work space: it is evaluated again at the end
    residual[:] = n.soft[:s, :s] @ start - n.target[:s]
    n.line[0] = step @ residual
    residual[:] = n.soft[:s, :s] @ step
    n.line[1] = step @ residual
    for k in range(s - first):
        at, end = first + k, n.limit_piece[k]
        if end != 0:  # without it the step is zero there
            yielding = n.yielding * n.limit_yield[k]
            away = n.limit_range[k, end - 1] + yielding * (start[at] - n.limit_last[k])
            n.line[0] += step[at] * away
            n.line[1] += step[at] * yielding * step[at]
    for k in range(n.held.shape[0]):
        pull, line = n.force_map[3 * k : 3 * k + 3, :s], n.line_force[k]
        line[0] = per_force * (pull @ start) + n.planned[3 * k : 3 * k + 3]
        line[2] = pull @ step
        line[1] = per_force * line[2]
    per_thrust = 1.0 / (softer * n.thrust_weight)
    n.line_thrust[0] = per_thrust * (n.thrust_map[:, :s] @ start)
    n.line_thrust[2] = n.thrust_map[:, :s] @ step
    n.line_thrust[1] = per_thrust * n.line_thrust[2]


@kernel
def _slope_along(n: NewtonRecord, share: float) -> float:
    """step · F at a share of the step."""
    force = np.empty((3,))
    slope: float = n.line[0] + share * n.line[1]
    for k in range(n.held.shape[0]):
        if n.held[k] != 0.0:
            g = n.line_force[k, 0] + share * n.line_force[k, 1]
            lower, upper = n.force_range[k]
            project(g, n.friction[k], lower, upper, n.faces, force)
            slope += n.line_force[k, 2] @ force
    if n.thrust.shape[0] > 0:
        u = n.line_thrust[0] + share * n.line_thrust[1]
        slope += n.line_thrust[2] @ np.clip(u, n.thrust_range[:, 0], n.thrust_range[:, 1])
    return slope


@kernel
def largest(matrix: Vector) -> float:
    """Largest of the first six entries of the diagonal."""
    return float(np.max(diagonal(matrix[:6, :6]), initial=0.0))
