"""The whole-body problem with every unknown kept but the torques: z = [u; f; a]."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from harpy_pin import checks
from harpy_pin.kernels import diagonal, kernel
from harpy_pin.model.cholesky import mirror
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import Record, RecordOf, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import flat_foot_rows
from harpy_pin.wbc.active_set import UNBOUNDED, ProgramRecord
from harpy_pin.wbc.giving_way import share_of_least_force, share_of_swing
from harpy_pin.wbc.problem import (
    FormulationKernels,
    FormulationRecord,
    WholeBodyProblem,
    add_tasks,
    body_rows,
    desired_acceleration,
    enter_pyramids,
)
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.targets import TargetsRecord, force_bounds, friction_rows


class FullRecord(RecordOf):
    """What the formulation keeps of the last state."""

    offset: Vector = sized("joints")  # torques at zero acceleration, thrust and force, N·m
    inputs: Vector = sized("thrusts + joints")  # [u; τ] to which tasks give way, N and N·m


class FullProblem(WholeBodyProblem):
    """Equalities: the floating base's rows of the dynamics, and those of each foot; rows for the
    torques.

    No matrix is inverted: most controllers solve this form, and it is the one to read first. A
    point foot has three equalities and a flat foot six. In stance they are those of its rigid
    motion (:func:`harpy_pin.model.terms.flat_foot_rows`). In swing they make the forces of its
    first corners zero; those of the other corners do not enter the dynamics, so the weight on
    forces makes them zero.

    Points on one rigid body that is not a flat foot make the program infeasible where their targets
    contradict each other; ``input_space`` regularises them (:mod:`harpy_pin.model.contact_map`).
    """

    name: ClassVar[str] = "full"
    kernels: ClassVar[FormulationKernels]

    def _allocate(self) -> tuple[QuadraticProgram, Record]:
        bounded = self.n_thrust
        program = QuadraticProgram(
            bounded + self.n_force + self.nv,
            equalities=6 + sum(3 if corners == 1 else 6 for corners in self.robot.corners),
            inequalities=self.foot_rows * self.feet + self.joints,
            bounded=bounded,
        )
        enter_pyramids(program, self.limits.pyramid, self.feet, force=bounded)
        return program, make_record(FullRecord, self.robot.sizes)

    def acceleration(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.acceleration`."""
        return self._solution(z)[-self.nv :].copy()

    def motion_map(self, held: Vector) -> tuple[Vector, Vector]:
        """See :meth:`WholeBodyProblem.motion_map`."""
        held = checks.array("held", held, self.feet)
        nv, force = self.nv, self.n_thrust
        motion = np.zeros((nv + self.n_force, len(self.program.gradient)))
        motion[:nv, -nv:] = np.eye(nv)
        motion[nv:, force:-nv] = np.diag(np.repeat(held, 3) != 0.0)
        return motion, np.zeros(len(motion))


@kernel
def _build(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: FormulationRecord,
    m: FullRecord,
    qp: ProgramRecord,
    v: Vector,
    rotation: Vector,
) -> None:
    _full_objective(d, t, p, qp, v, rotation)
    _dynamics_rows(d, t, p, qp)
    _foot_rows(d, t, p, qp)
    force, faces = qp.bounded, p.pyramid.shape[0]
    friction_rows(t, p, qp, force)
    force_bounds(t, faces, qp.lower[force:], qp.upper[force:])
    _torque_rows(d, t, p, m, qp, v)
    _limit(p, m, qp, True)


@kernel
def _full_objective(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: FormulationRecord,
    qp: ProgramRecord,
    v: Vector,
    rotation: Vector,
) -> None:
    """Diagonal but for the swing feet."""
    nv, nf, nt = d.bias.shape[0], d.foot_drift.shape[0], d.thruster_jacobian.shape[0]
    force = qp.bounded
    motion_hessian = qp.hessian[force + nf :, force + nf :]
    motion_gradient = qp.gradient[force + nf :]
    qp.hessian[:] = 0.0
    qp.gradient[:] = 0.0
    desired = np.empty(nv)
    desired_acceleration(v, rotation, t, desired)
    weight = p.w_motion + 0.0
    weight[6:] *= t.joint_share
    motion_gradient[:] = -weight * desired
    diagonal(qp.hessian)[:nt] = p.w_thrust
    diagonal(qp.hessian)[force : force + nf] = p.w_force
    planned = np.where(np.repeat(t.held, 3) != 0.0, t.force.reshape((nf,)), 0.0)
    qp.gradient[force : force + nf] = -p.w_force * planned
    diagonal(motion_hessian)[:] = weight
    if t.centred:
        _centre_task(d, t, p, v, rotation, motion_hessian, motion_gradient)
    swing = np.where(t.held == 0.0, p.w_swing, 0.0)
    _add_swing_tasks(swing, d, t, motion_hessian, motion_gradient)


@kernel
def _add_swing_tasks(
    weight: Vector, d: DynamicsRecord, t: TargetsRecord, hessian: Vector, gradient: Vector
) -> None:
    """Add ½ weight (acceleration − target)² of each foot."""
    value = t.feet.reshape(d.foot_drift.shape[0]) - d.foot_drift
    add_tasks(np.repeat(weight, 3), d.foot_jacobian, value, hessian, gradient)
    mirror(hessian)


@kernel
def _centre_task(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: FormulationRecord,
    v: Vector,
    rotation: Vector,
    hessian: Vector,
    gradient: Vector,
) -> None:
    """The centre of mass in the place of the body's origin, whose task is on the first three of the
    diagonal.
    """
    rows, value = np.empty((3, d.bias.shape[0])), np.empty(3)
    diagonal(hessian)[:3], gradient[:3] = 0.0, 0.0
    body_rows(d, t, v, rotation, rows, value)
    add_tasks(np.full(3, p.w_body), rows, value, hessian, gradient)


@kernel
def _inputs(m: FullRecord, qp: ProgramRecord, z: Vector, out: Vector) -> None:
    """[u; τ] of a solution: the torques are the last rows' values."""
    joints = m.offset.shape[0]
    thrusts, start = out.shape[0] - joints, qp.lower.shape[0] - joints
    out[:thrusts] = z[:thrusts]
    out[thrusts:] = m.offset + qp.inequality[start:] @ z


@kernel
def _force(p: FormulationRecord, m: FullRecord, qp: ProgramRecord, z: Vector, out: Vector) -> None:
    """Contact forces of a solution: variables themselves."""
    out[:] = z[qp.bounded : qp.bounded + out.shape[0]]


@kernel
def _give_way(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: FormulationRecord,
    m: FullRecord,
    qp: ProgramRecord,
    z: Vector,
) -> None:
    """Let least forces and swing feet give way to the torques of z."""
    _inputs(m, qp, z, m.inputs)
    faces, first, torque = (
        p.pyramid.shape[0],
        qp.bounded + d.foot_drift.shape[0],
        m.inputs[qp.bounded :],
    )
    less = np.zeros(t.held.shape[0])
    for k in range(t.held.shape[0]):
        if t.held[k] != 0.0:
            share = share_of_least_force(d, torque, p.torque_limit, k)
            qp.lower[qp.bounded + (faces + 1) * k + faces] = share * t.force_range[k, 0]
        else:
            less[k] = (1.0 - share_of_swing(d, torque, p.torque_limit, p.give_way, k)) * p.w_swing
    _add_swing_tasks(-less, d, t, qp.hessian[first:, first:], qp.gradient[first:])


@kernel
def _limit(p: FormulationRecord, m: FullRecord, qp: ProgramRecord, on: bool) -> None:
    """Bounds of the thrusts and of the torques' rows, or none."""
    joints, thrusts = m.offset.shape[0], qp.bounded
    start = qp.lower.shape[0] - joints
    qp.lower[:thrusts] = np.where(on, p.input_lower[:thrusts], -UNBOUNDED)
    qp.upper[:thrusts] = np.where(on, p.input_upper[:thrusts], UNBOUNDED)
    qp.lower[start:] = np.where(on, p.input_lower[thrusts:] - m.offset, -UNBOUNDED)
    qp.upper[start:] = np.where(on, p.input_upper[thrusts:] - m.offset, UNBOUNDED)


@kernel
def _dynamics_rows(
    d: DynamicsRecord, t: TargetsRecord, p: FormulationRecord, qp: ProgramRecord
) -> None:
    """Floating-base rows of the dynamics."""
    _enter_dynamics(d, t, p, 0, qp.equality[:6])
    qp.equality_value[:6] = -d.bias[:6]


@kernel
def _enter_dynamics(
    d: DynamicsRecord, t: TargetsRecord, p: FormulationRecord, first: int, rows: Vector
) -> None:
    """Rows of the dynamics from direction ``first`` on, M a − J_fᵀ f − J_tᵀ u.

    The forces of flat feet in swing are left out; those of points have equalities that make them
    zero.
    """
    last, force, k = first + rows.shape[0], d.thruster_jacobian.shape[0], 0
    acceleration = force + d.foot_drift.shape[0]
    rows[:, :force] = -d.thruster_jacobian[:, first:last].T
    rows[:, force:acceleration] = -d.foot_jacobian[:, first:last].T
    rows[:, acceleration:] = d.mass_matrix[first:last]
    for n in range(p.corners.shape[0]):
        corners = p.corners[n]
        if corners > 1 and t.held[k] == 0.0:
            rows[:, force + 3 * k : force + 3 * (k + corners)] = 0.0
        k += corners


@kernel
def _foot_rows(
    d: DynamicsRecord, t: TargetsRecord, p: FormulationRecord, qp: ProgramRecord
) -> None:
    """Stance feet are held, swing feet have no force."""
    force, acceleration = qp.bounded, qp.bounded + d.foot_drift.shape[0]
    k, start = 0, 6
    for n in range(p.corners.shape[0]):
        corners, first, last = p.corners[n], 3 * k, 3 * (k + p.corners[n])
        count, on = 3 if corners == 1 else 6, t.held[k] != 0.0
        rows, value = qp.equality[start : start + count], qp.equality_value[start : start + count]
        jacobian, drift = d.foot_jacobian[first:last], d.foot_drift[first:last]
        rows[:, force + first : force + last] = 0.0
        if not on:
            diagonal(rows[:, force + first : force + first + count])[:] = 1.0
            rows[:, acceleration:], value[:] = 0.0, 0.0
        elif corners > 1:
            desired, position = t.feet[k : k + corners], d.foot_position[k : k + corners]
            flat_foot_rows(jacobian, drift, desired, position, rows[:, acceleration:], value)
        else:
            rows[:, acceleration:], value[:] = jacobian, t.feet[k] - drift
        k += corners
        start += count


@kernel
def _torque_rows(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: FormulationRecord,
    m: FullRecord,
    qp: ProgramRecord,
    v: Vector,
) -> None:
    """Joint rows of the dynamics: the torques, less their offset."""
    _enter_dynamics(d, t, p, 6, qp.inequality[qp.lower.shape[0] - m.offset.shape[0] :])
    m.offset[:] = d.bias[6:] + d.damping[6:] * v[6:]


@kernel
def _acceleration(m: FullRecord, z: Vector, out: Vector) -> None:
    """Generalised acceleration of a solution: variables themselves."""
    out[:] = z[z.shape[0] - out.shape[0] :]


FullProblem.kernels = FormulationKernels(_build, _inputs, _force, _acceleration, _limit, _give_way)
