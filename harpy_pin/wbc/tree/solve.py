"""One whole-body optimum in one call: terms, tasks, elimination, forces, motion, torques."""

from __future__ import annotations

from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.entry import GOOD, MISFIT, all_finite
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import update_terms
from harpy_pin.wbc.newton import NewtonRecord
from harpy_pin.wbc.optimum import find_forces, forget, root_multiplier
from harpy_pin.wbc.tree.elimination import (
    ROOT,
    SIDES,
    EliminationRecord,
    back_substitute,
    eliminate,
    root_equations,
)
from harpy_pin.wbc.tree.limits import (
    ROUNDS,
    LimitsRecord,
    add_violated,
    begin_limits,
    joint_ends,
    within_limits,
)
from harpy_pin.wbc.tree.tasks import (
    ContactsRecord,
    FrameTasksRecord,
    JointTasksRecord,
    MomentumTasksRecord,
    add_contact,
    add_frame,
    add_joints,
    contact_forces_map,
    momentum_rows,
)

OPTIMAL, SUBOPTIMAL, INVALID, WRONG_SHAPE = 0, 1, 2, -1


class WholeBodyRecord(RecordOf):
    """Robot, tasks and contacts, and the optimum of a tick."""

    dynamics: DynamicsRecord
    frames: FrameTasksRecord
    joints: JointTasksRecord
    momentum: MomentumTasksRecord
    contacts: ContactsRecord
    system: EliminationRecord
    newton: NewtonRecord
    limits: LimitsRecord
    regularisation: Vector  # (nv,) weight of the square of each acceleration
    columns: Vector = sized(7)  # z = [λ; 1]
    acceleration: Vector = sized("nv")
    torque: Vector = sized("joints")
    force: Vector = sized("3 feet")
    thrust: Vector = sized("thrusts")
    world_force: Vector = sized("3 feet")
    joint_torque: Vector = sized("joints")
    reference_force: Vector = sized("3 feet")  # planned, world axes, N


@kernel(v="r.regularisation")
def solve_whole_body(r: WholeBodyRecord, q: Vector, v: Vector) -> int:
    """One optimum, of the state q (nq,), v (nv,): terms, tasks, elimination, forces, motion,
    torques; again with the limits that these violate.
    """
    d, e, n = r.dynamics, r.system, r.newton
    verdict = update_terms(d, q, v)
    if verdict == MISFIT:
        return WRONG_SHAPE
    d.bias += d.damping * v
    assemble(r, q, v)
    eliminate(e)
    root_equations(e, d.bias, n.compliance, n.demand)
    joint_ends(r.limits, q, v)
    begin_limits(r.limits, d, e, r.contacts, n)
    n.steps = 0
    found, more = False, True
    for _ in range(ROUNDS):
        if more:
            found = find_forces(n)
            move(r)
            more = add_violated(r.limits, d, e, r.contacts, n, r.joint_torque)
    found = within_limits(r.limits, r.joint_torque) and found and not more
    if verdict != GOOD or not (all_finite(e.acceleration) and all_finite(r.joint_torque)):
        forget(n)
        return INVALID
    r.acceleration[:], r.torque[:] = e.acceleration, r.joint_torque
    r.force[:], r.thrust[:] = r.world_force, n.thrust
    if not found:
        forget(n)
        return SUBOPTIMAL
    return OPTIMAL


@kernel
def move(r: WholeBodyRecord) -> None:
    """Accelerations and torques of the forces that were found."""
    root_multiplier(r.newton, r.columns[:ROOT])
    r.columns[ROOT] = 1.0
    back_substitute(r.system, r.columns, r.newton.multiplier[ROOT : ROOT + r.newton.limits])
    joint_torques(r)


@kernel
def assemble(r: WholeBodyRecord, q: Vector, v: Vector) -> None:
    """Tasks and contacts, into the system and the equation of the forces."""
    d, e = r.dynamics, r.system
    e.matrix[:] = 0.0
    for k in range(e.depth.shape[0]):
        e.matrix[k, SIDES + e.depth[k]] = r.regularisation[k]
        e.matrix[k, :ROOT] = d.mass_matrix[:ROOT, k]
    add_joints(d.tree, e, r.joints, q, v)
    for n in range(r.frames.body.shape[0]):
        add_frame(d, e, r.frames, n, q)
    for k in range(r.contacts.held.shape[0]):
        add_contact(d, e, r.frames, r.contacts, k)
    contact_forces_map(d, r.contacts, r.newton, r.reference_force)
    momentum_rows(d, r.momentum, r.newton, q, v)


@kernel
def joint_torques(r: WholeBodyRecord) -> None:
    """Contact forces in world axes, and τ = M a + n − Jᵀ f − J_tᵀ u of the joints."""
    d, n = r.dynamics, r.newton
    for k in range(n.held.shape[0]):
        f = n.force[3 * k : 3 * k + 3]
        r.world_force[3 * k : 3 * k + 3] = r.contacts.frame[k] @ f
    r.joint_torque[:] = d.mass_matrix[6:] @ r.system.acceleration + d.bias[6:]
    if n.held.shape[0] > 0:
        r.joint_torque -= d.foot_jacobian[:, 6:].T @ r.world_force
    if n.thrust.shape[0] > 0:
        r.joint_torque -= d.thruster_jacobian[:, 6:].T @ n.thrust
