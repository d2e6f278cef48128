"""The whole-body problem with every unknown kept but the torques: z = [u; f; a]."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from harpy_pin import checks
from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import Record, RecordOf, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import flat_foot_rows
from harpy_pin.wbc.condensed.active_set import UNBOUNDED, ProgramRecord
from harpy_pin.wbc.condensed.force_program import TargetsRecord, force_bounds, friction_rows
from harpy_pin.wbc.condensed.limits import share_of_least_force, share_of_swing
from harpy_pin.wbc.problem import (
    FormulationKernels,
    FormulationRecord,
    WholeBodyProblem,
    add_task,
    body_row,
    desired_acceleration,
    enter_pyramids,
    mirror,
)
from harpy_pin.wbc.program import QuadraticProgram


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
    for i in range(nv):
        motion_hessian[i, i] = weight[i]
    if t.centred:
        _centre_task(d, t, p, v, rotation, motion_hessian, motion_gradient)
    for c in range(nt):
        qp.hessian[c, c] = p.w_thrust
    for c in range(nf):
        qp.hessian[force + c, force + c] = p.w_force
        if t.held[c // 3] == 0.0:
            value = t.feet[c // 3, c % 3] - d.foot_drift[c]
            add_task(p.w_swing, d.foot_jacobian[c], value, motion_hessian, motion_gradient)
        else:
            qp.gradient[force + c] = -p.w_force * t.force[c // 3, c % 3]
    mirror(motion_hessian, nv)


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
    row = np.empty(d.bias.shape[0])
    for i in range(3):
        hessian[i, i] = gradient[i] = 0.0
    for k in range(3):
        value = body_row(k, d, t, v, rotation, row)
        add_task(p.w_body, row, value, hessian, gradient)


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
    motion_hessian, motion_gradient = qp.hessian[first:, first:], qp.gradient[first:]
    for k in range(t.held.shape[0]):
        if t.held[k] != 0.0:
            share = share_of_least_force(d, torque, p.torque_limit, k)
            qp.lower[qp.bounded + (faces + 1) * k + faces] = share * t.force_range[k, 0]
        else:
            less = (1.0 - share_of_swing(d, torque, p.torque_limit, p.give_way, k)) * p.w_swing
            for c in range(3 * k, 3 * k + 3):
                value = t.feet[k, c - 3 * k] - d.foot_drift[c]
                add_task(-less, d.foot_jacobian[c], value, motion_hessian, motion_gradient)
    mirror(motion_hessian, d.bias.shape[0])


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
    force, acceleration = qp.bounded, qp.bounded + d.foot_drift.shape[0]
    for i in range(6):
        row = qp.equality[i]
        row[:force] = -d.thruster_jacobian[:, i]
        row[force:acceleration] = -d.foot_jacobian[:, i]
        row[acceleration:] = d.mass_matrix[i]
        qp.equality_value[i] = -d.bias[i]
        _drop_swing_flat_feet(t, p, row, force)


@kernel
def _drop_swing_flat_feet(t: TargetsRecord, p: FormulationRecord, row: Vector, force: int) -> None:
    """Zero the columns of their forces in a row of the dynamics; those of points have equalities
    that do it.
    """
    k = 0
    for n in range(p.corners.shape[0]):
        corners = p.corners[n]
        if corners > 1 and t.held[k] == 0.0:
            row[force + 3 * k : force + 3 * (k + corners)] = 0.0
        k += corners


@kernel
def _foot_rows(
    d: DynamicsRecord, t: TargetsRecord, p: FormulationRecord, qp: ProgramRecord
) -> None:
    """Stance feet are held, swing feet have no force."""
    nv, nf = d.bias.shape[0], d.foot_drift.shape[0]
    force, acceleration = qp.bounded, qp.bounded + nf
    k, start = 0, 6
    for n in range(p.corners.shape[0]):
        corners, on = p.corners[n], t.held[k] != 0.0
        count = 3 if corners == 1 else 6
        rows, value = qp.equality[start : start + count], qp.equality_value[start : start + count]
        if corners > 1:
            motion = rows[:, acceleration : acceleration + nv]
            rows[:, force + 3 * k : force + 3 * (k + corners)] = 0.0
            if on:
                first, last = 3 * k, 3 * (k + corners)
                jacobian, drift = d.foot_jacobian[first:last], d.foot_drift[first:last]
                desired, position = t.feet[k : k + corners], d.foot_position[k : k + corners]
                flat_foot_rows(jacobian, drift, desired, position, motion, value)
            else:
                motion[:], value[:] = 0.0, 0.0
                for i in range(count):
                    rows[i, force + 3 * k + i] = 1.0
        else:
            for i in range(count):
                c = 3 * k + i
                rows[i, force + c] = 0.0 if on else 1.0
                rows[i, acceleration:] = np.where(on, d.foot_jacobian[c], 0.0)
                value[i] = t.feet[k, i] - d.foot_drift[c] if on else 0.0
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
    nv, force, acceleration = v.shape[0], qp.bounded, qp.bounded + d.foot_drift.shape[0]
    start = qp.lower.shape[0] - (nv - 6)
    for j in range(nv - 6):
        row = qp.inequality[start + j]
        row[:force] = -d.thruster_jacobian[:, 6 + j]
        row[force:acceleration] = -d.foot_jacobian[:, 6 + j]
        row[acceleration:] = d.mass_matrix[6 + j]
        _drop_swing_flat_feet(t, p, row, force)
    m.offset[:] = d.bias[6:] + d.damping[6:] * v[6:]


@kernel
def _acceleration(m: FullRecord, z: Vector, out: Vector) -> None:
    """Generalised acceleration of a solution: variables themselves."""
    out[:] = z[z.shape[0] - out.shape[0] :]


FullProblem.kernels = FormulationKernels(_build, _inputs, _force, _acceleration, _limit, _give_way)
