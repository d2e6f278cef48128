"""The whole-body problem in the robot's inputs only: z = [u; τ].

With the held feet's accelerations prescribed, contact forces and accelerations are affine in the
inputs (:mod:`harpy_pin.model.contact_map`, the map that the contact-force filter uses too): f = f₀
+ A y, a = a₀ + R y with y = [u; τ]. No equality is left, the limits of thrusts and torques are
bounds, and only the friction pyramids are rows.

Contact forces and thrusts do not always suffice as variables: on one foot they are nine numbers,
and the swing leg has three degrees of freedom of its own. There are as many inputs as degrees of
freedom in every support.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from harpy_pin.kernels import diagonal, kernel
from harpy_pin.model.cholesky import add_product, mirror, solve_factor
from harpy_pin.model.contact_map import (
    ContactMapRecord,
    contact_gain,
    contact_terms,
    sticking_force,
)
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import Record, field
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set import UNBOUNDED, ProgramRecord
from harpy_pin.wbc.giving_way import share_of_least_force, share_of_swing
from harpy_pin.wbc.problem import (
    FormulationKernels,
    FormulationRecord,
    WholeBodyProblem,
    add_tasks,
    body_rows,
    desired_acceleration,
)
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.targets import TargetsRecord, friction_limits


class InputSpaceProblem(WholeBodyProblem):
    """No equalities; bounds on thrusts and torques; the pyramid and the normal force as rows of
    each foot.
    """

    name: ClassVar[str] = "input_space"
    kernels: ClassVar[FormulationKernels]

    def _allocate(self) -> tuple[QuadraticProgram, Record]:
        inputs = self.n_thrust + self.joints
        program = QuadraticProgram(
            inputs, equalities=0, inequalities=self.foot_rows * self.feet, bounded=inputs
        )
        self._motion = np.zeros((self.nv + self.n_force, inputs))
        self._at_zero = np.zeros(self.nv + self.n_force)
        terms = contact_terms(self.robot)
        self._views = {
            name: field(terms, name) for name in ("rows", "response", "drive", "gain", "force")
        }
        return program, terms

    def acceleration(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.acceleration`."""
        return np.asarray(self._views["drive"] + self._views["response"] @ self._solution(z))

    def motion_map(self, held: Vector) -> tuple[Vector, Vector]:
        """See :meth:`WholeBodyProblem.motion_map`."""
        count, terms = int(self._record_["directions"][0]), self._views
        forces, motion, at_zero = self.nv + terms["rows"][:count], self._motion, self._at_zero
        motion[self.nv :], at_zero[self.nv :] = 0.0, 0.0
        motion[: self.nv], at_zero[: self.nv] = terms["response"], terms["drive"]
        motion[forces], at_zero[forces] = terms["gain"][:count], terms["force"][:count]
        return motion, at_zero


@kernel
def build_inputs(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: FormulationRecord,
    m: ContactMapRecord,
    qp: ProgramRecord,
    v: Vector,
    rotation: Vector,
) -> None:
    """The program, on elements of the records."""
    p.directions = _affine_map(d, t, m, v)
    friction_limits(t, p)
    _input_objective(d, t, p, m, qp, p.directions, v, rotation)
    _rows(t, p, m, qp)
    _limit(p, m, qp, True)


@kernel
def _affine_map(d: DynamicsRecord, t: TargetsRecord, m: ContactMapRecord, v: Vector) -> int:
    """f = f₀ + A y and a = a₀ + R y: fills force, gain, drive (a₀) and response; returns the held
    directions.
    """
    nv = v.shape[0]
    count = 0
    for c in range(d.foot_drift.shape[0]):
        if t.held[c // 3] != 0.0:
            m.rows[count] = c
            m.settling[count] = t.feet[c // 3, c % 3] - d.foot_drift[c]
            count += 1
    free = m.drive
    free[:] = -d.bias - d.damping * v
    sticking_force(d, m, count)
    contact_gain(d, m, count)
    free += m.contact[:, :count] @ m.force[:count]
    solve_factor(m.factor, free.reshape((nv, 1)), 1)
    return count


@kernel
def _input_objective(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: FormulationRecord,
    m: ContactMapRecord,
    qp: ProgramRecord,
    count: int,
    v: Vector,
    rotation: Vector,
) -> None:
    """The tasks on accelerations and forces, in the inputs y."""
    hessian, gradient, free, response = qp.hessian, qp.gradient, m.drive, m.response
    nv, nt = response.shape[0], d.thruster_jacobian.shape[0]
    qp.hessian[:] = 0.0
    qp.gradient[:] = 0.0
    diagonal(hessian)[:nt] = p.w_thrust
    desired = np.empty(nv)
    desired_acceleration(v, rotation, t, desired)
    weight = p.w_motion + 0.0
    weight[6:] *= t.joint_share
    if t.centred:
        _centre_task(p.w_body, d, t, m, v, rotation, hessian, gradient)
        weight[:3] = 0.0
    add_tasks(weight, response, desired - free, hessian, gradient)
    if m.force.shape[0] > 0:
        planned = t.force.reshape((m.force.shape[0],))[m.rows]
        weight_of_force = np.full(m.force.shape[0], p.w_force)
        add_tasks(weight_of_force, m.gain[:count], planned - m.force, hessian, gradient)
    _add_swing_tasks(np.where(t.held == 0.0, p.w_swing, 0.0), d, t, m, qp)


@kernel
def _centre_task(
    weight: float,
    d: DynamicsRecord,
    t: TargetsRecord,
    m: ContactMapRecord,
    v: Vector,
    rotation: Vector,
    hessian: Vector,
    gradient: Vector,
) -> None:
    """The centre of mass in the place of the body's origin, in the inputs y."""
    motion, value = np.empty((3, d.bias.shape[0])), np.empty(3)
    body_rows(d, t, v, rotation, motion, value)
    value -= motion @ m.drive
    add_tasks(np.full(3, weight), motion @ m.response, value, hessian, gradient)


@kernel
def _add_swing_tasks(
    weight: Vector, d: DynamicsRecord, t: TargetsRecord, m: ContactMapRecord, qp: ProgramRecord
) -> None:
    """Add ½ weight (acceleration − target)² of each foot, in the inputs y."""
    for k in range(weight.shape[0]):
        if weight[k] != 0.0:
            c, rows = 3 * k, np.zeros((3, m.response.shape[1]))
            jacobian = d.foot_jacobian[c : c + 3]
            add_product(jacobian, m.response, rows)
            value = t.feet[k] - d.foot_drift[c : c + 3] - jacobian @ m.drive
            add_tasks(np.full(3, weight[k]), rows, value, qp.hessian, qp.gradient)
    mirror(qp.hessian)


@kernel
def _limit(p: FormulationRecord, m: ContactMapRecord, qp: ProgramRecord, on: bool) -> None:
    """Bounds of the variables, or none."""
    inputs = p.input_lower.shape[0]
    qp.lower[:inputs] = np.where(on, p.input_lower, -UNBOUNDED)
    qp.upper[:inputs] = np.where(on, p.input_upper, UNBOUNDED)


@kernel
def _give_way(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: FormulationRecord,
    m: ContactMapRecord,
    qp: ProgramRecord,
    z: Vector,
) -> None:
    """Let least forces and swing feet give way to the torques of z, without limits."""
    faces, less = p.pyramid.shape[0], np.zeros(t.held.shape[0])
    torque, a = z[d.thruster_jacobian.shape[0] :], 0
    for k in range(t.held.shape[0]):
        if t.held[k] != 0.0:
            share = share_of_least_force(d, torque, p.torque_limit, k)
            qp.lower[qp.bounded + (faces + 1) * k + faces] = (
                share * t.force_range[k, 0] - m.force[a + 2]
            )
            a += 3
        else:
            less[k] = (1.0 - share_of_swing(d, torque, p.torque_limit, p.give_way, k)) * p.w_swing
    _add_swing_tasks(-less, d, t, m, qp)


@kernel
def _rows(t: TargetsRecord, p: FormulationRecord, m: ContactMapRecord, qp: ProgramRecord) -> None:
    """Friction pyramids P (f₀ + A y) ≥ 0, and the range of the normal force."""
    ny, faces = m.gain.shape[1], p.pyramid.shape[0]
    inequality, lower, upper = (
        qp.inequality[qp.bounded :],
        qp.lower[qp.bounded :],
        qp.upper[qp.bounded :],
    )
    a = 0
    for k in range(t.held.shape[0]):
        first, last = (faces + 1) * k, (faces + 1) * k + faces
        if t.held[k] == 0.0:
            inequality[first : last + 1, :ny] = 0.0
            lower[first : last + 1], upper[first : last + 1] = -1.0, 1.0  # never active
            continue
        force, gain, up = m.force[a : a + 3], m.gain[a : a + 3], p.friction[k] * p.inscribed
        inequality[first:last, :ny] = p.pyramid[:, :2] @ gain[:2] + up * gain[2]
        lower[first:last] = -(p.pyramid[:, :2] @ force[:2] + up * force[2])
        upper[first:last] = UNBOUNDED
        inequality[last, :ny] = gain[2]
        lower[last], upper[last] = t.force_range[k] - force[2]
        a += 3


@kernel
def _inputs(m: ContactMapRecord, qp: ProgramRecord, z: Vector, out: Vector) -> None:
    """[u; τ] of a solution: the variables themselves."""
    out[:] = z[: out.shape[0]]


@kernel
def _force(
    p: FormulationRecord, m: ContactMapRecord, qp: ProgramRecord, z: Vector, out: Vector
) -> None:
    """Contact forces f₀ + A y of a solution y."""
    out[:] = 0.0
    n = p.directions
    out[m.rows[:n]] = m.force[:n] + m.gain[:n] @ z


@kernel
def _acceleration(m: ContactMapRecord, z: Vector, out: Vector) -> None:
    """Generalised acceleration a₀ + R y of a solution y."""
    out[:] = m.drive + m.response @ z


InputSpaceProblem.kernels = FormulationKernels(
    build_inputs, _inputs, _force, _acceleration, _limit, _give_way
)
