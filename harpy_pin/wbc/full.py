"""The whole-body problem with every unknown kept but the torques: z = [u; s; f; a]."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.model.dynamics import Dynamics, DynamicsRecord
from harpy_pin.model.flat_foot import flat_foot_rows
from harpy_pin.model.record import field
from harpy_pin.model.state import Vector
from harpy_pin.wbc.centre_of_mass import body_row
from harpy_pin.wbc.giving_way import share_of_least_force, share_of_swing
from harpy_pin.wbc.problem import (
    ProblemRecord,
    WholeBodyProblem,
    add_task,
    clear_objective,
    desired_acceleration,
    force_bounds,
    friction_limits,
    friction_rows,
    mirror,
    motion_task,
)
from harpy_pin.wbc.program import UNBOUNDED, ProgramRecord, QuadraticProgram
from harpy_pin.wbc.weights import TargetsRecord, WholeBodyTargets

__all__ = ["FullProblem"]


class FullProblem(WholeBodyProblem):
    """Equalities: the floating base's rows of the dynamics, and those of each foot; rows for the torques.

    No matrix is inverted: most controllers solve this form, and it is the one to read first. A point foot has three
    equalities and a flat foot six. In stance they are those of its rigid motion
    (:func:`harpy_pin.model.flat_foot.flat_foot_rows`). In swing they make the forces of its first corners zero; those
    of the other corners do not enter the dynamics, so the weight on forces makes them zero.

    Points on one rigid body that is not a flat foot make the program infeasible where their targets contradict each
    other; ``input_space`` regularises them (:mod:`harpy_pin.model.contact_map`).
    """

    name: ClassVar[str] = "full"

    def _allocate(self) -> QuadraticProgram:
        bounded = self.n_thrust + self.n_slack
        program = QuadraticProgram(
            bounded + self.n_force + self.nv,
            equalities=6 + sum(3 if corners == 1 else 6 for corners in self.robot.corners),
            inequalities=self.foot_rows * self.feet + self.joints,
            bounded=bounded,
        )
        self._bound(program, torque=False, slack=self.n_thrust)
        self._friction(program, force=bounded)
        return program

    @checked
    def prepare(self, dynamics: Dynamics, targets: WholeBodyTargets) -> None:
        """See :meth:`WholeBodyProblem.prepare`."""
        records = (dynamics.record, targets.record, self.record, self.program.record)
        _build_full.prepare(*records, np.zeros(self.nv), dynamics.rotation)

    def _fill(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> None:
        """See :meth:`WholeBodyProblem._fill`."""
        _build_full(dynamics._record_, targets._record_, self.record, self.program._record_, v, rotation)

    def inputs(self, z: Vector, out: Vector) -> None:
        """See :meth:`WholeBodyProblem.inputs`."""
        z, out = self._solution(z), self._output(out)
        nt = self.n_thrust
        out[:nt] = z[:nt]
        torque = out[nt:]
        np.dot(self.program.inequality[len(self.program.lower) - self.joints :], z, out=torque)
        torque += field(self.record, "offset")

    def _put_limits(self, on: bool) -> None:
        """See :meth:`WholeBodyProblem._put_limits`."""
        _limit_inputs(self.record, self.program.record, self.n_thrust, on)

    def _let_give_way(self, dynamics: Dynamics, targets: WholeBodyTargets, z: Vector) -> None:
        """See :meth:`WholeBodyProblem._let_give_way`."""
        inputs = np.zeros(self.n_thrust + self.joints)
        self.inputs(z, inputs)
        records = (dynamics.record, targets.record, self.record, self.program.record)
        _give_way(*records, inputs[self.n_thrust :])

    def acceleration(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.acceleration`."""
        z = self._solution(z)
        return z[-self.nv :].copy()

    def contact_force(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.contact_force`."""
        z = self._solution(z)
        return z[self.program.bounded : -self.nv].reshape(-1, 3).copy()

    def motion_map(self, held: Vector) -> tuple[Vector, Vector]:
        """See :meth:`WholeBodyProblem.motion_map`."""
        held = checks.array("held", held, self.feet)
        nv, force = self.nv, self.program.bounded
        motion = np.zeros((nv + self.n_force, len(self.program.gradient)))
        motion[:nv, -nv:] = np.eye(nv)
        motion[nv:, force:-nv] = np.diag(np.repeat(held, 3) != 0.0)
        return motion, np.zeros(len(motion))


@kernel
def _build_full(
    d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, qp: ProgramRecord, v: Vector, rotation: Vector
) -> None:
    _full_objective(d, t, p, qp, v, rotation)
    _dynamics_rows(d, t, p, qp)
    _foot_rows(d, t, p, qp)
    force, faces = qp.bounded, p.pyramid.shape[0]
    friction_limits(t, p)
    friction_rows(p, qp, force)
    force_bounds(t, faces, qp.lower[force:], qp.upper[force:])
    _torque_rows(d, t, p, qp, v)


@kernel
def _full_objective(
    d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, qp: ProgramRecord, v: Vector, rotation: Vector
) -> None:
    """Diagonal but for the swing feet."""
    nv, nf, nt = d.bias.shape[0], d.foot_drift.shape[0], d.thruster_jacobian.shape[0]
    force = qp.bounded
    motion_hessian = qp.hessian[force + nf :, force + nf :]
    motion_gradient = qp.gradient[force + nf :]
    clear_objective(p, qp, nt, force - nt)
    desired = np.empty(nv)
    desired_acceleration(v, rotation, t, desired)
    for i in range(nv):
        weight = motion_task(i, p)
        motion_hessian[i, i] = weight
        motion_gradient[i] = -weight * desired[i]
    if t.centred:
        _centre_task(d, t, p, v, rotation, motion_hessian, motion_gradient)
    for c in range(nt):
        qp.hessian[c, c] = p.w_thrust
    for c in range(nf):
        qp.hessian[force + c, force + c] = p.w_force
        if t.held[c // 3] == 0.0:
            value = t.feet[c // 3, c % 3] - d.foot_drift[c]
            add_task(p.w_swing, d.foot_jacobian[c], value, motion_hessian, motion_gradient)
    mirror(motion_hessian, nv)


@kernel
def _centre_task(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: ProblemRecord,
    v: Vector,
    rotation: Vector,
    hessian: Vector,
    gradient: Vector,
) -> None:
    """The centre of mass in the place of the body's origin, whose task is on the first three of the diagonal."""
    row = np.empty(d.bias.shape[0])
    for i in range(3):
        hessian[i, i] = gradient[i] = 0.0
    for k in range(3):
        value = body_row(k, d, t, v, rotation, row)
        add_task(p.w_body, row, value, hessian, gradient)


@kernel
def _give_way(d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, qp: ProgramRecord, torque: Vector) -> None:
    nv, nf, faces = d.bias.shape[0], d.foot_drift.shape[0], p.pyramid.shape[0]
    first = qp.bounded + nf
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
    mirror(motion_hessian, nv)


@kernel
def _limit_inputs(p: ProblemRecord, qp: ProgramRecord, thrusts: int, on: bool) -> None:
    """Bounds of the thrusts and of the torques' rows, or none."""
    for c in range(thrusts):
        qp.lower[c] = p.input_lower[c] if on else -UNBOUNDED
        qp.upper[c] = p.input_upper[c] if on else UNBOUNDED
    start = qp.lower.shape[0] - p.torque_limit.shape[0]
    for j in range(p.torque_limit.shape[0]):
        qp.lower[start + j] = -p.torque_limit[j] - p.offset[j] if on else -UNBOUNDED
        qp.upper[start + j] = p.torque_limit[j] - p.offset[j] if on else UNBOUNDED


@kernel
def _dynamics_rows(d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, qp: ProgramRecord) -> None:
    """Floating-base rows of the dynamics."""
    nv, nf, nt = d.bias.shape[0], d.foot_drift.shape[0], d.thruster_jacobian.shape[0]
    force, acceleration = qp.bounded, qp.bounded + nf
    for i in range(6):
        row = qp.equality[i]
        for c in range(nt):
            row[c] = -d.thruster_jacobian[c, i]
        for c in range(nf):
            row[force + c] = -d.foot_jacobian[c, i]
        for j in range(nv):
            row[acceleration + j] = d.mass_matrix[i, j]
        qp.equality_value[i] = -d.bias[i]
        _drop_swing_flat_feet(t, p, row, force)


@kernel
def _drop_swing_flat_feet(t: TargetsRecord, p: ProblemRecord, row: Vector, force: int) -> None:
    """Zero the columns of their forces in a row of the dynamics; those of points have equalities that do it."""
    k = 0
    for n in range(p.corners.shape[0]):
        corners = p.corners[n]
        if corners > 1 and t.held[k] == 0.0:
            row[force + 3 * k : force + 3 * (k + corners)] = 0.0
        k += corners


@kernel
def _foot_rows(d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, qp: ProgramRecord) -> None:
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
                for j in range(nv):
                    rows[i, acceleration + j] = d.foot_jacobian[c, j] if on else 0.0
                value[i] = t.feet[k, i] - d.foot_drift[c] if on else 0.0
        k += corners
        start += count


@kernel
def _torque_rows(d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, qp: ProgramRecord, v: Vector) -> None:
    """Joint rows of the dynamics within the torques' limits."""
    nv, nf, nt = v.shape[0], d.foot_drift.shape[0], d.thruster_jacobian.shape[0]
    force, acceleration = qp.bounded, qp.bounded + nf
    start = qp.lower.shape[0] - (nv - 6)
    for j in range(nv - 6):
        row = qp.inequality[start + j]
        for c in range(nt):
            row[c] = -d.thruster_jacobian[c, 6 + j]
        for c in range(nf):
            row[force + c] = -d.foot_jacobian[c, 6 + j]
        for i in range(nv):
            row[acceleration + i] = d.mass_matrix[6 + j, i]
        _drop_swing_flat_feet(t, p, row, force)
        p.offset[j] = d.bias[6 + j] + d.damping[6 + j] * v[6 + j]
        qp.lower[start + j] = -p.torque_limit[j] - p.offset[j]
        qp.upper[start + j] = p.torque_limit[j] - p.offset[j]
