"""One whole-body optimum in one call: terms, tasks, elimination, forces, motion, torques."""

from __future__ import annotations

import numpy as np

from harpy_pin.ground.contact_frame import to_worlds
from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.entry import GOOD, MISFIT, all_finite
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import update_terms
from harpy_pin.wbc.condensed.elimination import (
    EliminationRecord,
    begin_elimination,
    begin_row,
    eliminate,
    root_equations,
)
from harpy_pin.wbc.condensed.limbs import LimbsRecord
from harpy_pin.wbc.condensed.limits import (
    LimitsRecord,
    add_violated,
    begin_limits,
    joint_ends,
    within_limits,
)
from harpy_pin.wbc.condensed.motion import move
from harpy_pin.wbc.condensed.tasks import (
    ContactsRecord,
    FrameTasksRecord,
    JointTasksRecord,
    MomentumTasksRecord,
    add_contact,
    add_frame,
    add_joints,
    add_relative,
    contact_forces_map,
    momentum_rows,
    upright,
)
from harpy_pin.wbc.newton import NewtonRecord
from harpy_pin.wbc.optimum import find_forces, forget

ROUNDS = 8
"""How often limits that are violated enter, at most."""
YIELDING = 1e-3
"""Compliance of contacts that no motion within the limits keeps."""
OPTIMAL, SUBOPTIMAL, INVALID, CONTACTS_YIELDED, WRONG_SHAPE, WRONG_HELD = 0, 1, 2, 3, -1, -2


class WholeBodyRecord(RecordOf):
    """Robot, tasks and contacts, and the optimum of a tick."""

    dynamics: DynamicsRecord
    frames: FrameTasksRecord
    joints: JointTasksRecord
    momentum: MomentumTasksRecord
    contacts: ContactsRecord
    limbs: LimbsRecord  # none: tasks may be on any joint
    system: EliminationRecord
    newton: NewtonRecord
    limits: LimitsRecord
    regularisation: float  # weight of the square of each acceleration
    acceleration: Vector = sized("nv")
    torque: Vector = sized("joints")
    force: Vector = sized("3 feet")
    thrust: Vector = sized("thrusts")
    joint_torque: Vector = sized("joints")
    reference_force: Vector = sized("3 feet")  # planned, world axes, N


@kernel(v="r.acceleration")
def solve_whole_body(r: WholeBodyRecord, q: Vector, v: Vector) -> int:
    """One optimum, of the state q (nq,), v (nv,): terms, tasks, elimination, forces, motion,
    torques; again with the limits that these violate.
    """
    e, n = r.system, r.newton
    verdict = update_terms(r.dynamics, q, v)
    if verdict == MISFIT:
        return WRONG_SHAPE
    held = r.contacts.held
    if not np.all((held == 0.0) | (held == 1.0)):
        return WRONG_HELD
    joint_ends(r.limits, q, v)
    n.steps = 0
    found, status = _within_limits(r, q, v, r.contacts.compliance), OPTIMAL
    if not found:
        steps, n.steps = n.steps, 0
        forget(n)
        found = _within_limits(r, q, v, YIELDING)
        n.steps += steps
        status = CONTACTS_YIELDED if found else SUBOPTIMAL
    if verdict != GOOD or not (all_finite(e.acceleration) and all_finite(r.joint_torque)):
        forget(n)
        return INVALID
    r.acceleration[:], r.torque[:], r.thrust[:] = e.acceleration, r.joint_torque, n.thrust
    r.force[:] = n.force
    if not upright(r.contacts.frame):
        to_worlds(r.contacts.frame, r.force.reshape((n.held.shape[0], 3)))
    if status != OPTIMAL:
        forget(n)
    return status


@kernel
def _within_limits(r: WholeBodyRecord, q: Vector, v: Vector, compliance: float) -> bool:
    """Forces, motion and torques, with the limits that these violate, of contacts with a
    compliance; whether it is the optimum.
    """
    d, e, b, n = r.dynamics, r.system, r.limbs, r.newton
    e.compliance[:] = compliance
    assemble(r, q, v)
    eliminate(e)
    root_equations(e, n.compliance, n.demand)
    add_relative(d, e, r.frames, n, q)
    begin_limits(r.limits, d, e, b, n)
    found, more = False, True
    for _ in range(ROUNDS):
        if more:
            found = find_forces(n)
            move(d, e, b, n, r.joint_torque, False)  # feet may contradict each other
            more = add_violated(r.limits, d, e, b, n, r.joint_torque)
    return within_limits(r.limits, r.joint_torque) and found and not more


@kernel
def assemble(r: WholeBodyRecord, q: Vector, v: Vector) -> None:
    """Tasks and contacts, into the system and the equation of the forces."""
    d, e = r.dynamics, r.system
    begin_elimination(d, e, v)
    for k in range(v.shape[0]):
        begin_row(d, e, k, r.regularisation, 0.0)
    add_joints(e, r.joints, q, v)
    for n in range(r.frames.body.shape[0]):
        add_frame(d, e, r.frames, n, q)
    for k in range(r.contacts.held.shape[0]):
        add_contact(d, e, r.frames, r.contacts, k)
    contact_forces_map(d, r.contacts, r.newton, r.reference_force)
    momentum_rows(d, r.momentum, r.newton, q, v)
