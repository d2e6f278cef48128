"""The whole-body optimum of a gait's tasks, in a bounded number of operations.

A tick eliminates the accelerations (:mod:`~harpy_pin.wbc.condensed.limbs`,
:mod:`~harpy_pin.wbc.condensed.elimination`), finds contact forces and thrusts
(:mod:`~harpy_pin.wbc.optimum`), and recovers motion and torques
(:mod:`~harpy_pin.wbc.condensed.motion`). Where that optimum exceeds limits of thrusts or torques,
which is rare, it is found again with them (:mod:`~harpy_pin.wbc.condensed.limits`), so that the
result is the whole-body optimum in this case, too. What gives way there is said in
:mod:`~harpy_pin.wbc.giving_way`.

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
from harpy_pin.wbc.condensed.elimination import EliminationRecord, eliminate, root_equations
from harpy_pin.wbc.condensed.gait_tasks import FeetRecord, add_feet, assemble_gait, soften_limbs
from harpy_pin.wbc.condensed.limbs import LimbsRecord, eliminate_limbs
from harpy_pin.wbc.condensed.limits import LimitsRecord, add_violated, begin_limits
from harpy_pin.wbc.condensed.motion import move
from harpy_pin.wbc.condensed.tasks import (
    MOMENTA,
    FrameTasksRecord,
    JointTasksRecord,
    MomentumTasksRecord,
    add_frame,
    add_joints,
    add_relative,
    momentum_rows,
)
from harpy_pin.wbc.giving_way import outside, share_of_least_force, share_of_swing
from harpy_pin.wbc.newton import NewtonRecord
from harpy_pin.wbc.optimum import find_forces
from harpy_pin.wbc.targets import ProblemRecord, TargetsRecord, friction_limits

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

    limbs: LimbsRecord  # that their feet determine
    others: FeetRecord  # feet on other limbs
    system: EliminationRecord  # all other accelerations
    newton: NewtonRecord  # the search for the forces
    limits: LimitsRecord  # of torques
    frames: FrameTasksRecord  # tasks of one's own
    joints: JointTasksRecord
    momentum: MomentumTasksRecord
    configuration: Vector  # (nq,) q, which they need
    # pieces of their cones on which the forces were in the last optimum without limits, and in the
    # last one with limits
    free_piece: NDArray[np.int64] = sized("feet", whole=True)
    limited_piece: NDArray[np.int64] = sized("feet", whole=True)
    # shares that each foot has of its least normal force, and of the weight of its swing
    least_share: Vector = sized("feet", fill=1.0)
    swing_share: Vector = sized("feet", fill=1.0)
    force: Vector = sized("3 feet")  # contact forces, world axes, N; zero in swing
    inputs: Vector = sized("thrusts + joints")  # [u; τ] of the last tick, N and N·m
    last_inputs: Vector = sized("thrusts + joints")  # those of the tick before
    # status of the last tick, and Newton's steps in it
    status_and_steps: NDArray[np.int64] = sized(2, whole=True)
    # ticks in a row for which the last inputs are held in the place of clipped ones
    hold_ticks: int
    # ticks with clipped torques: all, and in a row
    clipped: NDArray[np.int64] = sized(2, whole=True)


@kernel
def solve_condensed(d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord, v: Vector) -> None:
    """One tick, on elements of the records; see
    :class:`~harpy_pin.wbc.condensed.CondensedSolver`.
    """
    n, thrusts = p.newton, d.thruster_jacobian.shape[0]
    torque, last = p.inputs[thrusts:], n.limits
    p.status_and_steps[:] = 0
    p.last_inputs[:] = p.inputs
    p.least_share[:] = p.swing_share[:] = 1.0
    _eliminate(d, t, p, v)
    _begin_search(d, t, p)
    found = find_forces(n)
    p.free_piece[:] = n.piece
    move(d, p.system, p.limbs, n, torque, found)
    beyond = outside(torque, p.input_lower[thrusts:], p.input_upper[thrusts:])
    if beyond or outside(n.thrust, p.input_lower, p.input_upper):
        n.limits = last
        found = _within_limits(d, t, p, v, torque, beyond)
    if not found:
        p.status_and_steps[0] |= SUBOPTIMAL
        p.free_piece[:] = p.limited_piece[:] = 0
        n.limits = 0
    p.status_and_steps[1] = n.steps
    p.force[:] = n.force
    p.inputs[:thrusts] = n.thrust
    if np.any(n.thrust_piece > 0):
        p.status_and_steps[0] |= THRUST_LIMITED
    if np.any(n.limit_piece[: n.limits] > 0):
        p.status_and_steps[0] |= TORQUE_LIMITED
    _clip_torques(p, torque)


@kernel
def _eliminate(d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord, v: Vector) -> None:
    """The accelerations out of the optimum: K and w."""
    e, n = p.system, p.newton
    assemble_gait(d, t, p, e, n, v)
    soften_limbs(t, p, p.limbs, p.swing_share)
    eliminate_limbs(d, t, p.limbs, e)
    add_feet(d, t, p, e, p.others, p.swing_share)
    add_joints(e, p.joints, p.configuration, v)
    for k in range(p.frames.body.shape[0]):
        add_frame(d, e, p.frames, k, p.configuration)
    if n.momentum_weight.shape[0] > MOMENTA:
        momentum_rows(d, p.momentum, n, p.configuration, v)
    eliminate(e)
    root_equations(e, n.compliance, n.demand)
    add_relative(d, e, p.frames, n, p.configuration)


@kernel
def _begin_search(d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord) -> None:
    """Cones and ranges of the forces, without limits of thrusts and torques."""
    n = p.newton
    n.force_map[:, :6] = d.foot_jacobian[:, :6]
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


@kernel
def _within_limits(
    d: DynamicsRecord, t: TargetsRecord, p: CondensedRecord, v: Vector, torque: Vector, beyond: bool
) -> bool:
    """The optimum with limits, which that without them exceeds, by torques where it is ``beyond``;
    whether it was found.
    """
    e, b, n, m, thrusts = p.system, p.limbs, p.newton, p.limits, p.newton.thrust.shape[0]
    n.thrust_range[:, 0], n.thrust_range[:, 1] = p.input_lower[:thrusts], p.input_upper[:thrusts]
    m.torque_range[:, 0], m.torque_range[:, 1] = p.input_lower[thrusts:], p.input_upper[thrusts:]
    if p.give_way < 1.0 and beyond:
        for k in range(t.held.shape[0]):
            p.least_share[k] = share_of_least_force(d, torque, p.torque_limit, k)
            p.swing_share[k] = share_of_swing(d, torque, p.torque_limit, p.give_way, k)
        n.force_range[:, 0] = p.least_share * t.force_range[:, 0]
        _eliminate(d, t, p, v)
    if n.limits > 0:
        n.piece[:] = p.limited_piece
    begin_limits(m, d, e, b, n)
    add_violated(m, d, e, b, n, torque)
    found, more = True, True
    for _ in range(ROUNDS):
        if found and more:
            found = find_forces(n)
            move(d, e, b, n, torque, found)
            more = add_violated(m, d, e, b, n, torque)
    p.limited_piece[:] = n.piece
    return found and not more


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
