"""The whole-body optimum by six equations of the root, solved in a bounded number of operations.

A tick eliminates the limbs (:mod:`harpy_pin.wbc.condensed.condense`), finds the contact forces and
thrusts (:mod:`harpy_pin.wbc.optimum`), and recovers motion and torques. Where that optimum exceeds
limits of thrusts or torques, which is rare, it is found again with them
(:mod:`harpy_pin.wbc.condensed.limits`), so that the result is the whole-body optimum in this case,
too. What gives way there is said in :mod:`harpy_pin.wbc.giving_way`.

For the rigid robot with regular limbs, at every state and for every target: with the torques and
thrusts returned, the force on each stance foot is f, and f is in its pyramid and range. There are
two exceptions: within limits a leg bears less than the least normal force where its motors cannot
bear that, and torques are clipped, as the status says, where the search found no force in the
pyramids that the motors can reach.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import ByPrecision, kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.condense import (
    CondensationRecord,
    eliminate_limbs,
    joint_torques,
    move_limbs,
    move_root,
    root_compliance,
)
from harpy_pin.wbc.condensed.limits import (
    TorqueLimitsRecord,
    add_violated,
    begin_limits,
    note_limits,
)
from harpy_pin.wbc.giving_way import outside, share_of_least_force, share_of_swing
from harpy_pin.wbc.newton import NewtonRecord
from harpy_pin.wbc.optimum import find_forces, root_multiplier
from harpy_pin.wbc.targets import ProblemRecord, TargetsRecord, friction_limits, root_acceleration

ROUNDS = 4
"""How often limits that are violated enter, at most."""
AT_LIMIT = ByPrecision(1e-9, single=1e-6)
"""Distance below its limit, as a share of it, at which a torque counts as limited."""
BEYOND = ByPrecision(1e-6, single=1e-3)
"""Excess over its limit, as a share of it, that counts as rounding and not as clipped."""
THRUST_LIMITED, TORQUE_LIMITED, SUBOPTIMAL, TORQUE_CLIPPED = 1, 2, 4, 8
"""Bits of the status, see :class:`~harpy_pin.wbc.condensed.CondensedStatus`."""


class CondensedRecord(ProblemRecord):
    """Settings and work space of :class:`~harpy_pin.wbc.condensed.CondensedSolver`."""

    root: CondensationRecord  # the robot as six equations
    newton: NewtonRecord  # the search for the forces
    limits: TorqueLimitsRecord  # that bind
    # pieces of their cones on which the forces were in the last optimum without limits, and in the
    # last one with limits
    free_piece: NDArray[np.int64] = sized("feet", whole=True)
    limited_piece: NDArray[np.int64] = sized("feet", whole=True)
    least_share: Vector = sized(
        "feet", fill=1.0
    )  # share of its least normal force that each foot has to bear
    force: Vector = sized("3 feet")  # contact forces, world axes, N; zero in swing
    inputs: Vector = sized("thrusts + joints")  # [u; τ] of the last tick, N and N·m
    last_inputs: Vector = sized("thrusts + joints")  # those of the tick before
    # status of the last tick, and Newton's steps in it
    status_and_steps: NDArray[np.int64] = sized(2, whole=True)
    hold_ticks: (
        int  # ticks in a row for which the last inputs are held in the place of clipped ones
    )
    clipped: NDArray[np.int64] = sized(
        2, whole=True
    )  # ticks with clipped torques: all, and in a row


@kernel
def solve_condensed(
    d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord, v: Vector, rotation: Vector
) -> None:
    """One tick, on elements of the records; see
    :class:`~harpy_pin.wbc.condensed.CondensedSolver`.
    """
    e, n, thrusts = p.root, p.newton, d.thruster_jacobian.shape[0]
    torque = p.inputs[thrusts:]
    p.status_and_steps[:] = 0
    p.last_inputs[:] = p.inputs
    root_acceleration(v, rotation, t, e.desired)
    eliminate_limbs(d, t, p, e, v)
    e.inverse_weight[:thrusts] = 0.0  # thrusts are found as the forces are
    _begin_search(d, t, p)
    found = find_forces(n)
    p.free_piece[:] = n.piece
    _move(d, p, v, torque, found)
    beyond = outside(torque, p.input_lower[thrusts:], p.input_upper[thrusts:])
    if beyond or outside(n.thrust, p.input_lower, p.input_upper):
        found = _within_limits(d, t, p, v, torque, beyond)
    note_limits(p.limits, n)
    if not found:
        p.status_and_steps[0] |= SUBOPTIMAL
        p.free_piece[:] = p.limited_piece[:] = 0
        p.limits.last_end[:] = 0
    p.status_and_steps[1] = n.steps
    p.force[:] = n.force
    p.inputs[:thrusts] = n.thrust
    if np.any(n.thrust_piece > 0):
        p.status_and_steps[0] |= THRUST_LIMITED
    if np.any(p.limits.last_end > 0):
        p.status_and_steps[0] |= TORQUE_LIMITED
    _clip_torques(p, torque)


@kernel
def _begin_search(d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord) -> None:
    """The equation in λ without limits of thrusts and torques: K, w, maps, cones and ranges."""
    e, n = p.root, p.newton
    root_compliance(e, n.compliance)
    n.demand[:6] = e.right_hand_side
    n.force_map[:, :6] = e.force_map.T
    n.thrust_map[:, :6] = d.thruster_jacobian[:, :6]
    n.thrust_range[:, 0], n.thrust_range[:, 1] = -np.inf, np.inf
    friction_limits(t, p)
    n.friction[:] = p.inscribed * p.friction
    n.force_range[:] = t.force_range
    n.held[:] = t.held
    n.planned[:] = t.force.reshape((n.planned.shape[0],))
    n.piece[:] = p.free_piece
    n.thrust_piece[:] = 0
    n.limits = n.steps = 0
    p.least_share[:] = 1.0


@kernel
def _within_limits(
    d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord, v: Vector, torque: Vector, beyond: bool
) -> bool:
    """The optimum with limits, which that without them exceeds, by torques where it is ``beyond``;
    whether it was found.
    """
    e, n, thrusts = p.root, p.newton, p.newton.thrust.shape[0]
    n.thrust_range[:, 0], n.thrust_range[:, 1] = p.input_lower[:thrusts], p.input_upper[:thrusts]
    if p.give_way < 1.0 and beyond:
        first = e.inverse_weight.shape[0] - t.held.shape[0] * 3
        for k in range(t.held.shape[0]):
            p.least_share[k] = share_of_least_force(d, torque, p.torque_limit, k)
            share = share_of_swing(d, torque, p.torque_limit, p.give_way, k)
            e.inverse_weight[first + 3 * k : first + 3 * k + 3] /= share
        n.force_range[:, 0] = p.least_share * t.force_range[:, 0]
        root_compliance(e, n.compliance)
    if np.any(p.limits.last_end > 0):
        n.piece[:] = p.limited_piece
    begin_limits(d, t, e, p.limits, n, v, p.torque_limit)
    add_violated(d, t, e, p.limits, n, v, torque, p.torque_limit)
    found, more = True, True
    for _ in range(ROUNDS):
        if found and more:
            found = find_forces(n)
            _move(d, p, v, torque, found)
            more = add_violated(d, t, e, p.limits, n, v, torque, p.torque_limit)
    p.limited_piece[:] = n.piece
    return found and not more


@kernel
def _move(d: DynamicsRecord, p: CondensedRecord, v: Vector, torque: Vector, found: bool) -> None:
    """λ, motion and torques of the forces at hand."""
    e, n, m, last = p.root, p.newton, p.limits, p.newton.limits
    e.multiplier[:] = n.multiplier[:6]
    if not found:
        root_multiplier(n, e.multiplier)
    body, free = e.mass.T @ e.multiplier, e.free_map @ e.multiplier
    if m.joint.shape[0] > 0 and last > 0:
        body += m.mass[:last].T @ n.multiplier[6 : 6 + last]
        free += m.free_map[:last].T @ n.multiplier[6 : 6 + last]
    move_root(e, body, free)
    e.free_acceleration[: n.thrust.shape[0]] = n.thrust
    move_limbs(e)
    joint_torques(d, e, v, n.force, torque)


@kernel
def _clip_torques(p: CondensedRecord, torque: Vector) -> None:
    """Clip the torques; says in the status which limits are reached, and whether more than rounding
    was clipped.
    """
    limit = p.torque_limit
    if not np.all(abs(torque) <= limit * (1.0 - AT_LIMIT)):
        p.status_and_steps[0] |= TORQUE_LIMITED
    if not np.all(abs(torque) <= limit * (1.0 + BEYOND)):
        p.status_and_steps[0] |= TORQUE_CLIPPED
    torque[:] = np.where(np.isfinite(torque), np.clip(torque, -limit, limit), 0.0)


@kernel
def hold_last(p: CondensedRecord) -> None:
    """The last inputs in the place of clipped torques, for a while."""
    if p.status_and_steps[0] & TORQUE_CLIPPED:
        p.clipped[0] += 1
        p.clipped[1] += 1
        if p.clipped[1] <= p.hold_ticks:
            p.inputs[:] = p.last_inputs
    else:
        p.clipped[1] = 0
