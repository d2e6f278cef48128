"""The whole-body optimum as a program in the contact forces alone, solved in a bounded number of
operations.

A tick eliminates the limbs (:mod:`harpy_pin.wbc.condensed.condense`), fills in the program in the
contact forces (:mod:`harpy_pin.wbc.condensed.force_program`), finds its optimum, and recovers
thrusts and torques. The last tick's active set is tried, then exchanged; then follows the dual
active-set method. At the end every force is put into its pyramid.

Where thrusts or torques of that optimum exceed their limits, which is rare, the program is solved
again with thrusts and free accelerations as unknowns (:mod:`harpy_pin.wbc.condensed.limits`), so
that the result is the whole-body optimum in this case, too. What gives way there is said in that
file.

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
from harpy_pin.wbc.condensed.active_set import EXCHANGES, SearchRecord, dual_active_set, exchange
from harpy_pin.wbc.condensed.condense import (
    CondensationRecord,
    eliminate_limbs,
    joint_torques,
    recover,
    root_factor,
)
from harpy_pin.wbc.condensed.force_program import (
    ProblemRecord,
    TargetsRecord,
    force_bounds,
    force_objective,
    friction_rows,
    into_cones,
    root_acceleration,
)
from harpy_pin.wbc.condensed.limits import (
    limited_program,
    outside,
    share_of_least_force,
    share_of_swing,
)

AT_LIMIT = ByPrecision(1e-9, single=1e-6)
"""Distance below its limit, as a share of it, at which a torque counts as limited."""
BEYOND = ByPrecision(1e-6, single=1e-3)
"""Excess over its limit, as a share of it, that counts as rounding and not as clipped."""
THRUST_LIMITED, TORQUE_LIMITED, SUBOPTIMAL, TORQUE_CLIPPED = 1, 2, 4, 8
"""Bits of the status, see :class:`~harpy_pin.wbc.condensed.CondensedStatus`."""


class CondensedRecord(ProblemRecord):
    """Settings and work space of :class:`~harpy_pin.wbc.condensed.CondensedSolver`."""

    root: CondensationRecord  # the robot as six equations
    free: SearchRecord  # program on the forces alone
    limited: (
        SearchRecord  # program on thrusts, free accelerations and forces, with rows for the torques
    )
    least_share: Vector = sized(
        "feet", fill=1.0
    )  # share of its least normal force that each foot has to bear
    swing_share: Vector = sized(
        "feet", fill=1.0
    )  # share of its weight that each swing foot has at the motors' limits
    force: Vector = sized("3 feet")  # contact forces, world axes, N; zero in swing
    inputs: Vector = sized("thrusts + joints")  # [u; τ] of the last tick, N and N·m
    last_inputs: Vector = sized("thrusts + joints")  # those of the tick before
    response: Vector = sized(6, "3 feet")  # acceleration of the root per force
    unknowns: Vector = sized(
        "thrusts + others + 3 feet"
    )  # of the program with limits, N and rad/s²
    wide_response: Vector = sized(
        6, "thrusts + others + 3 feet"
    )  # acceleration of the root per unknown
    gain: Vector = sized("thrusts + joints", "thrusts + others + 3 feet")  # [u; τ] per unknown
    at_rest: Vector = sized("thrusts + joints")  # [u; τ] where the unknowns are zero
    # status of the last tick, and systems that were solved in it
    status_and_systems: NDArray[np.int64] = sized(2, whole=True)
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
    e, qp = p.root, p.free.program
    p.status_and_systems[:] = 0
    p.last_inputs[:] = p.inputs
    root_acceleration(v, rotation, t, e.desired)
    eliminate_limbs(d, t, p, e, v)
    root_factor(e)
    p.least_share[:] = 1.0
    if p.force.shape[0] > 0:
        force_bounds(t, p.pyramid.shape[0], qp.lower, qp.upper)
        force_objective(t, p, e, p.response, qp)
        friction_rows(t, p, qp, 0)
        search_active_set(p, p.free, p.force)
        into_cones(t, p)
    recover(e, p.force)
    thrusts = d.thruster_jacobian.shape[0]
    thrust, torque = e.free_acceleration[:thrusts], p.inputs[thrusts:]
    joint_torques(d, e, v, p.force, torque)
    beyond = outside(torque, p.input_lower[thrusts:], p.input_upper[thrusts:])
    if beyond or outside(thrust, p.input_lower, p.input_upper):
        _within_limits(d, t, p, v, beyond)
    else:  # where limits are reached next, their search begins with the rows of the pyramids
        first = p.limited.program.bounded
        p.limited.exchange.active[:] = 0
        last = first + p.free.exchange.active.shape[0]
        p.limited.exchange.active[first:last] = p.free.exchange.active
    p.inputs[:thrusts] = thrust


@kernel
def search_active_set(p: CondensedRecord, search: SearchRecord, z: Vector) -> None:
    """The optimum, by the last active set, its exchange, or the dual method; the status says
    whether one was found.
    """
    w, dual = search.exchange, search.dual
    systems, _ = exchange(search.program, w, z, EXCHANGES)
    p.status_and_systems[1] += systems
    if systems <= EXCHANGES:
        return
    outcome, exchanges = dual_active_set(search.program, dual, z)
    p.status_and_systems[1] += exchanges
    w.active[:] = dual.active
    finite = np.all(np.isfinite(z))
    if outcome == 0 and finite:
        return
    p.status_and_systems[0] |= SUBOPTIMAL
    w.active[:] = 0
    if not finite:
        z[:] = 0.0


@kernel
def _within_limits(
    d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord, v: Vector, beyond: bool
) -> None:
    """The optimum with bounds on the thrusts and rows of the torques, which may be beyond their
    limits without them.
    """
    e, qp, y, thrusts = p.root, p.limited.program, p.unknowns, d.thruster_jacobian.shape[0]
    first, torque = thrusts + e.others.shape[0], p.inputs[thrusts:]
    p.swing_share[:] = 1.0
    if p.give_way < 1.0 and beyond:
        for k in range(t.held.shape[0]):
            p.least_share[k] = share_of_least_force(d, torque, p.torque_limit, k)
            p.swing_share[k] = share_of_swing(d, torque, p.torque_limit, p.give_way, k)
    limited_program(d, t, p, v)
    search_active_set(p, p.limited, y)
    y[:thrusts] = np.clip(y[:thrusts], qp.lower[:thrusts], qp.upper[:thrusts])
    if np.any((y[:thrusts] <= p.input_lower[:thrusts]) | (y[:thrusts] >= p.input_upper[:thrusts])):
        p.status_and_systems[0] |= THRUST_LIMITED
    p.force[:] = y[first:]
    into_cones(t, p)
    e.free_acceleration[:first] = y[:first]
    e.free_acceleration[first:] = np.where(np.repeat(t.held, 3) != 0.0, 0.0, y[first:])
    e.right_hand_side -= e.free_map @ e.free_acceleration
    recover(e, p.force)
    joint_torques(d, e, v, p.force, torque)
    _clip_torques(p, torque)


@kernel
def _clip_torques(p: CondensedRecord, torque: Vector) -> None:
    """Clip the torques; says in the status which limits are reached, and whether more than rounding
    was clipped.
    """
    limit = p.torque_limit
    if not np.all(abs(torque) <= limit * (1.0 - AT_LIMIT)):
        p.status_and_systems[0] |= TORQUE_LIMITED
    if not np.all(abs(torque) <= limit * (1.0 + BEYOND)):
        p.status_and_systems[0] |= TORQUE_CLIPPED
    torque[:] = np.where(np.isfinite(torque), np.clip(torque, -limit, limit), 0.0)


@kernel
def hold_last(p: CondensedRecord) -> None:
    """The last inputs in the place of clipped torques, for a while."""
    if p.status_and_systems[0] & TORQUE_CLIPPED:
        p.clipped[0] += 1
        p.clipped[1] += 1
        if p.clipped[1] <= p.hold_ticks:
            p.inputs[:] = p.last_inputs
    else:
        p.clipped[1] = 0
