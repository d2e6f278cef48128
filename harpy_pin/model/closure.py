"""Kernels of closed loops: passive joints by Gauss–Newton from those of the last call, the
velocities that follow, and what they add to the equations of motion.

With the equations e(q_d, q_p) = 0 of driven and passive joints, A = ∂e/∂q_p and B = ∂e/∂q_d,

    v_p = −(AᵀA)⁻¹ Aᵀ B v_d,    a_p = −(AᵀA)⁻¹ Aᵀ (B a_d + ė's drift)

so that v_tree = T v. With the tree's M and n (n with the passive joints' drift) and the damping D
of passive joints the robot has the mass matrix Tᵀ M T and the bias Tᵀ (n + D T v). Equations are
relative to the base: it moves both ends of a loop alike. The loops of a plane have more equations
than passive joints, which least squares take.
"""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin

from harpy_pin.errors import InputError
from harpy_pin.kernels import ByPrecision, diagonal, kernel
from harpy_pin.model.cholesky import (
    add_product,
    factorise,
    solve_factor,
    solve_transposed,
    solve_vector,
)
from harpy_pin.model.loops import JUMP, Loops
from harpy_pin.model.placing import accelerated, place_body
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import TreeRecord, tree_record

SEARCHES = 20
"""Most steps of one search."""
FARTHEST = 100
"""Most searches on the way from the angles at which the loops are known to be closed."""
LARGEST_STEP = 0.5
"""Of a passive joint, rad."""
LAST_STEP = ByPrecision(1e-10, single=1e-5)
"""Step that is too small to be taken, rad."""
LEFT = ByPrecision(1e-8, single=1e-4)
"""Residual of loops that are closed, m or rad."""
DEAD = 1e-3
"""Least pivot of AᵀA, as a share of how far a joint moves the ends of loops: sin² of the
transmission angle of a linkage, which is zero at a dead point.
"""
MIN_PIVOT = 1e-12
"""Least pivot of AᵀA: it keeps numbers finite where a linkage is singular."""


@kernel
def close_loops(t: TreeRecord, q: Vector, v: Vector) -> None:
    """Configuration and velocity of the tree at a state q, v of base and driven joints, and
    placement and velocity of every body but the base.
    """
    c = t.loops
    driven, searches = c.move.shape[0], 1
    here, passive = c.q[7 : 7 + driven], c.q[7 + driven :]
    given = q[7 : 7 + driven]
    c.q[:7], c.v[:6] = q[:7], v[:6]
    far = np.max(abs(given - here))
    if c.closed == 0 or not far <= JUMP:
        c.q[7:] = c.start
        searches = 1 + int(min(np.max(abs(given - here)) / JUMP, FARTHEST))
        c.closed = _search(t)
    c.move[:] = (given - here) / searches
    for left in range(searches - 1, -1, -1):
        here[:] = given - left * c.move
        passive += c.spread[driven:] @ c.move
        c.closed = _search(t)
    c.v[6 : 6 + driven] = v[6 : 6 + driven]
    c.v[6 + driven :] = c.spread[driven:] @ v[6 : 6 + driven]
    for m in range(c.beyond.shape[0]):
        place_body(t, c.q, c.beyond[m])
    for i in range(1, t.parent.shape[0]):
        t.twist[i] = t.twist[t.parent[i]] + c.v[t.column[i]] * t.screw[i]


@kernel
def _search(t: TreeRecord) -> int:
    """Passive joints at the driven ones, and the velocities that follow; whether loops are closed,
    and not at a dead point.
    """
    c = t.loops
    driven = c.move.shape[0]
    for m in range(c.above.shape[0]):
        place_body(t, c.q, c.above[m])
    for _ in range(SEARCHES):
        for m in range(c.moved.shape[0]):
            place_body(t, c.q, c.moved[m])
        _equations(t)
        c.normal[:] = c.slope[:, driven:].T @ c.slope[:, driven:]
        c.step[:] = c.slope[:, driven:].T @ c.residual
        factorise(c.normal, c.normal, MIN_PIVOT)
        solve_vector(c.normal, c.step)
        if np.max(abs(c.step)) < LAST_STEP:
            break
        c.q[7 + driven :] -= np.clip(c.step, -LARGEST_STEP, LARGEST_STEP)
    spread = c.spread[driven:]
    spread[:] = 0.0
    add_product(c.slope[:, driven:].T, -c.slope[:, :driven], spread)
    solve_transposed(c.normal, spread, driven)
    solve_factor(c.normal, spread, driven)
    if not np.max(abs(c.residual)) < LEFT:
        return 0
    return 0 if np.any(c.reach[driven:] * diagonal(c.normal) ** 2 > 1.0 / DEAD) else 1


@kernel
def _equations(t: TreeRecord) -> None:
    """Residual of the equations, and its derivative by the joints."""
    c = t.loops
    c.reach[:] = 0.0
    for n in range(c.length.shape[0]):
        for end in range(2):
            i = c.body[n, end]
            c.end[n, end] = t.position[i] + t.axes[i] @ c.offset[n, end]
        first, length, apart = c.first_row[n], c.length[n], c.end[n, 0] - c.end[n, 1]
        _slopes(t, n, 0, 1.0, apart)
        _slopes(t, n, 1, -1.0, apart)
        if length == 0.0:
            c.residual[first : first + 3] = apart
        else:
            c.residual[first] = 0.5 * (apart @ apart / length - length)
    rows = c.residual.shape[0] - c.ratio.shape[0]
    for n in range(c.ratio.shape[0]):
        follower, leader = c.coupling[n]
        c.reach[follower] += 1.0
        c.residual[rows + n] = c.q[7 + follower] - c.ratio[n] * c.q[7 + leader] - c.shift[n]


@kernel
def _slopes(t: TreeRecord, n: int, end: int, sign: float, apart: Vector) -> None:
    """Derivative of the rows of loop n by the joints on the way to one of its ends."""
    c = t.loops
    i, first, length, p = c.body[n, end], c.first_row[n], c.length[n], c.end[n, end]
    while i > c.top[n]:
        s, k = t.screw[i], t.column[i] - 6
        motion = sign * (s[:3] + np.cross(s[3:], p))
        c.reach[k] += motion @ motion
        if length == 0.0:
            c.slope[first : first + 3, k] = motion
        else:
            c.slope[first, k] = apart @ motion / length
        i = t.parent[i]


@kernel
def _end_velocity(t: TreeRecord, n: int, end: int) -> Vector:
    """Velocity of one end of loop n, base axes."""
    u = t.twist[t.loops.body[n, end]]
    velocity: Vector = u[:3] + np.cross(u[3:], t.loops.end[n, end])
    return velocity


@kernel
def _end_drift(t: TreeRecord, n: int, end: int) -> Vector:
    """Acceleration of one end of loop n, less gravity, base axes."""
    i = t.loops.body[n, end]
    a, turning = t.drift[i], t.twist[i, 3:]
    drift: Vector = (
        a[:3] + np.cross(a[3:], t.loops.end[n, end]) + np.cross(turning, _end_velocity(t, n, end))
    )
    return drift


@kernel
def accelerate_passive(t: TreeRecord) -> None:
    """Accelerations of the passive joints where base and driven ones have none, into ``step``;
    ``t.drift`` is that of the bodies where no joint accelerates.
    """
    c = t.loops
    driven = c.move.shape[0]
    c.residual[:] = 0.0
    for n in range(c.length.shape[0]):
        first, length = c.first_row[n], c.length[n]
        drift = _end_drift(t, n, 0) - _end_drift(t, n, 1)
        if length == 0.0:
            c.residual[first : first + 3] = drift
        else:
            moving = _end_velocity(t, n, 0) - _end_velocity(t, n, 1)
            c.residual[first] = ((c.end[n, 0] - c.end[n, 1]) @ drift + moving @ moving) / length
    c.step[:] = -(c.slope[:, driven:].T @ c.residual)
    solve_vector(c.normal, c.step)


@kernel
def accelerate_loops(t: TreeRecord, acceleration: Vector) -> None:
    """Acceleration of the tree at one (nv,) of base and driven joints, after the bodies are
    placed.
    """
    c = t.loops
    t.drift[0, :3], t.drift[0, 3:] = -(t.rotation.T @ t.gravity), 0.0
    for m in range(c.above.shape[0]):
        i = c.above[m]
        t.drift[i] = accelerated(t, i, c.v[t.column[i]])
    for m in range(c.moved.shape[0]):
        i = c.moved[m]
        t.drift[i] = accelerated(t, i, c.v[t.column[i]])
    accelerate_passive(t)
    c.acceleration[:6] = acceleration[:6]
    c.acceleration[6:] = c.spread @ acceleration[6:]
    c.acceleration[acceleration.shape[0] :] += c.step


@kernel
def follow_loops(t: TreeRecord) -> None:
    """Add what the accelerations of the passive joints do to the bias and the drift of the tree,
    where base and driven joints have none.
    """
    c = t.loops
    first = c.v.shape[0] - c.step.shape[0]
    accelerate_passive(t)
    c.bias += c.mass_matrix[:, first:] @ c.step
    for i in range(1, t.parent.shape[0]):
        k = i
        while k > 0:
            if t.column[k] >= first:
                t.drift[i] += c.step[t.column[k] - first] * t.screw[k]
            k = t.parent[k]


@kernel
def reduce_force(t: TreeRecord, out: Vector) -> None:
    """Force (nv,) on base and driven joints of that on the tree, ``bias``, and of the damping of
    passive joints.
    """
    c = t.loops
    nv = out.shape[0]
    c.bias[nv:] += c.damping * c.v[nv:]
    out[:] = c.bias[:nv]
    out[6:] += c.bias[nv:] @ c.spread[nv - 6 :]


@kernel
def reduce_mass(t: TreeRecord, out: Vector) -> None:
    """Mass matrix Tᵀ M T (nv, nv) of base and driven joints of that of the tree."""
    c = t.loops
    nv = out.shape[0]
    m, spread = c.mass_matrix, c.spread[nv - 6 :]
    # With v_tree = [v; S v]: M + (M_p S)ᵀ + M_p S + Sᵀ M_pp S, of which half of the last is in each
    c.side[:] = m[nv:, 6:nv]
    add_product(m[nv:, nv:], 0.5 * spread, c.side)
    c.cross[:] = 0.0
    add_product(spread.T, c.side, c.cross)
    out[:] = m[:nv, :nv]
    out[6:, 6:] += c.cross + c.cross.T
    out[:6, 6:] += m[:6, nv:] @ spread
    out[6:, :6] += spread.T @ m[nv:, :6]


@kernel
def _close_anew(t: TreeRecord, q: Vector, v: Vector) -> int:
    """:func:`close_loops` from the angles at which the loops are known to be closed; whether they
    are closed.
    """
    t.loops.closed = 0
    close_loops(t, q, v)
    return t.loops.closed


def closed_tree(model: pin.Model, loops: Loops, q: Vector) -> tuple[Vector, Vector]:
    """A configuration of the tree (model.nq,) with its loops closed, and T (model.nv, nv) with
    v_tree = T v.

    Args:
        model: the tree.
        loops: of it.
        q: (nq,) of base and driven joints.

    Raises:
        InputError: the loops cannot be closed there, or are at a dead point.
    """
    record = _RECORDS.setdefault(loops, None)
    if record is None:
        record = _RECORDS[loops] = tree_record(model, loops)
    own, column = record["loops"], record["column"][0, 1:]
    closed = _close_anew(record, np.array(q, dtype=np.float64), np.zeros(len(q) - 1))
    if not closed:
        left = np.abs(own["residual"]).max()
        why = f"cannot be closed at these joint angles: {left:.2g} m or rad are left"
        raise InputError(
            f"the loops of '{model.name}' {'are at a dead point' if left < LEFT else why}",
            name="q",
            value=q,
        )
    spread = np.eye(model.nv, len(q) - 1)
    spread[6:, 6:] = own["spread"][0][column - 6]
    return np.append(q[:7], own["q"][0][column + 1]), spread


_RECORDS: WeakKeyDictionary[Loops, Any] = WeakKeyDictionary()
"""Where loops of robots are closed from Python."""
