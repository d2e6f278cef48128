"""The whole-body problem in the robot's inputs only: z = [u; τ; s].

With the held feet's accelerations prescribed, contact forces and accelerations are affine in the inputs
(:mod:`harpy_pin.model.contact_map`, the map that the contact-force filter uses too): f = f₀ + A y, a = a₀ + R y with
y = [u; τ]. No equality is left, the limits of thrusts and torques are bounds, and only the friction pyramids are rows.

Contact forces and thrusts do not always suffice as variables: on one foot they are nine numbers, and the swing leg has
three degrees of freedom of its own. There are as many inputs as degrees of freedom in every support.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.model.cholesky import solve_factor
from harpy_pin.model.contact_map import ContactMapRecord, contact_gain, contact_terms, sticking_force
from harpy_pin.model.dynamics import Dynamics, DynamicsRecord
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.record import Records, field
from harpy_pin.model.state import Vector
from harpy_pin.wbc.centre_of_mass import body_row
from harpy_pin.wbc.giving_way import share_of_least_force, share_of_swing
from harpy_pin.wbc.problem import (
    ProblemRecord,
    WholeBodyProblem,
    add_task,
    clear_objective,
    desired_acceleration,
    friction_limits,
    mirror,
    motion_task,
)
from harpy_pin.wbc.program import UNBOUNDED, ProgramRecord, QuadraticProgram
from harpy_pin.wbc.weights import TargetsRecord, WholeBodyTargets

__all__ = ["InputSpaceProblem"]


@fixed_arrays("record", "terms")
class InputSpaceProblem(WholeBodyProblem):
    """No equalities; bounds on thrusts and torques; the pyramid and the normal force as rows of each foot."""

    name: ClassVar[str] = "input_space"
    _record_: Records[Any]
    _terms_: Records[Any]

    def _allocate(self) -> QuadraticProgram:
        inputs = self.n_thrust + self.joints
        bounded = inputs + self.n_slack
        program = QuadraticProgram(bounded, equalities=0, inequalities=self.foot_rows * self.feet, bounded=bounded)
        self._bound(program, torque=True, slack=inputs)
        self.terms = contact_terms(self.robot)
        self._views = {name: field(self.terms, name) for name in ("rows", "response", "drive", "gain", "force")}
        self._motion = np.zeros((self.nv + self.n_force, bounded))
        self._at_zero = np.zeros(self.nv + self.n_force)
        return program

    @checked
    def prepare(self, dynamics: Dynamics, targets: WholeBodyTargets) -> None:
        """See :meth:`WholeBodyProblem.prepare`."""
        records = (dynamics.record, targets.record, self.record, self.terms, self.program.record)
        build_inputs.prepare(*records, np.zeros(self.nv), dynamics.rotation)

    def _fill(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> None:
        """See :meth:`WholeBodyProblem._fill`."""
        record, terms, program = self._record_, self._terms_, self.program._record_
        build_inputs(dynamics._record_, targets._record_, record, terms, program, v, rotation)

    def _put_limits(self, on: bool) -> None:
        """See :meth:`WholeBodyProblem._put_limits`."""
        limit_inputs(self.record, self.program.record, on)

    def _let_give_way(self, dynamics: Dynamics, targets: WholeBodyTargets, z: Vector) -> None:
        """See :meth:`WholeBodyProblem._let_give_way`."""
        give_way_to_inputs(dynamics.record, targets.record, self.record, self.terms, self.program.record, z)

    def acceleration(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.acceleration`."""
        z = self._solution(z)
        drive, response = field(self.terms, "drive"), field(self.terms, "response")
        return np.asarray(drive + response @ z[: self.n_thrust + self.joints])

    def contact_force(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.contact_force`."""
        z = self._solution(z)
        count = int(self.record["directions"][0])
        rows, gain, at_rest = (field(self.terms, name)[:count] for name in ("rows", "gain", "force"))
        force = np.zeros(self.n_force)
        force[rows] = at_rest + gain @ z[: self.n_thrust + self.joints]
        return force.reshape(-1, 3)

    def motion_map(self, held: Vector) -> tuple[Vector, Vector]:
        """See :meth:`WholeBodyProblem.motion_map`."""
        count, terms = int(self.record["directions"][0]), self._views
        forces, inputs = self.nv + terms["rows"][:count], self.n_thrust + self.joints
        motion, at_zero = self._motion, self._at_zero
        motion[self.nv :], at_zero[self.nv :] = 0.0, 0.0
        motion[: self.nv, :inputs], at_zero[: self.nv] = terms["response"], terms["drive"]
        motion[forces, :inputs], at_zero[forces] = terms["gain"][:count], terms["force"][:count]
        return motion, at_zero


@kernel
def build_inputs(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: ProblemRecord,
    w: ContactMapRecord,
    qp: ProgramRecord,
    v: Vector,
    rotation: Vector,
) -> None:
    """The program, on elements of the records."""
    p.directions = _affine_map(d, t, w, v)
    friction_limits(t, p)
    _input_objective(d, t, p, w, qp, p.directions, v, rotation)
    _rows(t, p, w, qp)


@kernel
def _affine_map(d: DynamicsRecord, t: TargetsRecord, w: ContactMapRecord, v: Vector) -> int:
    """f = f₀ + A y and a = a₀ + R y: fills force, gain, drive (a₀) and response; returns the held directions."""
    nv = v.shape[0]
    count = 0
    for c in range(d.foot_drift.shape[0]):
        if t.held[c // 3] != 0.0:
            w.rows[count] = c
            w.settling[count] = t.feet[c // 3, c % 3] - d.foot_drift[c]
            count += 1
    free = w.drive
    for i in range(nv):
        free[i] = -d.bias[i] - d.damping[i] * v[i]
    sticking_force(d, w, count)
    contact_gain(d, w, count)
    for i in range(nv):
        for a in range(count):
            free[i] += w.contact[i, a] * w.force[a]
    solve_factor(w.factor, free.reshape((nv, 1)), 1)
    return count


@kernel
def _input_objective(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: ProblemRecord,
    w: ContactMapRecord,
    qp: ProgramRecord,
    count: int,
    v: Vector,
    rotation: Vector,
) -> None:
    """The tasks on accelerations and forces, in the inputs y."""
    hessian, gradient, free, response = qp.hessian, qp.gradient, w.drive, w.response
    nv, ny = response.shape
    nt = d.thruster_jacobian.shape[0]
    clear_objective(p, qp, ny, qp.bounded - ny)
    for a in range(nt):
        hessian[a, a] = p.w_thrust
    desired = np.empty(nv)
    desired_acceleration(v, rotation, t, desired)
    if t.centred:
        _centre_task(p.w_body, d, t, w, v, rotation, hessian, gradient)
    for i in range(3 if t.centred else 0, nv):
        add_task(motion_task(i, p), response[i], desired[i] - free[i], hessian, gradient)
    for a in range(count):
        add_task(p.w_force, w.gain[a], -w.force[a], hessian, gradient)
    for c in range(d.foot_drift.shape[0]):
        if t.held[c // 3] == 0.0:
            _add_swing_task(p.w_swing, d, t, w, c, hessian, gradient)
    mirror(hessian, ny)


@kernel
def _centre_task(
    weight: float,
    d: DynamicsRecord,
    t: TargetsRecord,
    w: ContactMapRecord,
    v: Vector,
    rotation: Vector,
    hessian: Vector,
    gradient: Vector,
) -> None:
    """The centre of mass in the place of the body's origin, in the inputs y."""
    nv, ny = w.response.shape
    motion, row = np.empty(nv), np.empty(ny)
    for k in range(3):
        value = body_row(k, d, t, v, rotation, motion)
        row[:] = 0.0
        for i in range(nv):
            value -= motion[i] * w.drive[i]
            for y in range(ny):
                row[y] += motion[i] * w.response[i, y]
        add_task(weight, row, value, hessian, gradient)


@kernel
def _add_swing_task(
    weight: float, d: DynamicsRecord, t: TargetsRecord, w: ContactMapRecord, c: int, hessian: Vector, gradient: Vector
) -> None:
    """Add ½ weight (acceleration − target)² of one direction of a swing foot, in the inputs y."""
    nv, ny = w.response.shape
    row = np.zeros(ny)
    value = t.feet[c // 3, c % 3] - d.foot_drift[c]
    for i in range(nv):
        x = d.foot_jacobian[c, i]
        if x != 0.0:
            value -= x * w.drive[i]
            for y in range(ny):
                row[y] += x * w.response[i, y]
    add_task(weight, row, value, hessian, gradient)


@kernel
def limit_inputs(p: ProblemRecord, qp: ProgramRecord, on: bool) -> None:
    """Bounds of the first variables, thrusts and torques, or none."""
    for c in range(p.input_lower.shape[0]):
        qp.lower[c] = p.input_lower[c] if on else -UNBOUNDED
        qp.upper[c] = p.input_upper[c] if on else UNBOUNDED


@kernel
def give_way_to_inputs(
    d: DynamicsRecord, t: TargetsRecord, p: ProblemRecord, w: ContactMapRecord, qp: ProgramRecord, z: Vector
) -> None:
    """Let least forces and swing feet give way to the torques of z, without limits, on elements of the records."""
    ny, faces = w.response.shape[1], p.pyramid.shape[0]
    torque, a = z[d.thruster_jacobian.shape[0] : ny], 0
    for k in range(t.held.shape[0]):
        if t.held[k] != 0.0:
            share = share_of_least_force(d, torque, p.torque_limit, k)
            qp.lower[qp.bounded + (faces + 1) * k + faces] = share * t.force_range[k, 0] - w.force[a + 2]
            a += 3
            continue
        less = (1.0 - share_of_swing(d, torque, p.torque_limit, p.give_way, k)) * p.w_swing
        for c in range(3 * k, 3 * k + 3):
            _add_swing_task(-less, d, t, w, c, qp.hessian, qp.gradient)
    mirror(qp.hessian, ny)


@kernel
def _rows(t: TargetsRecord, p: ProblemRecord, w: ContactMapRecord, qp: ProgramRecord) -> None:
    """Friction pyramids P (f₀ + A y) ≥ 0, and the range of the normal force."""
    ny, faces = w.gain.shape[1], p.pyramid.shape[0]
    inequality, lower, upper = qp.inequality[qp.bounded :], qp.lower[qp.bounded :], qp.upper[qp.bounded :]
    a = 0
    for k in range(t.held.shape[0]):
        first, last = (faces + 1) * k, (faces + 1) * k + faces
        if t.held[k] == 0.0:
            for r in range(first, last + 1):
                inequality[r, :ny] = 0.0
                lower[r], upper[r] = -1.0, 1.0  # never active
            continue
        along_x, along_y, up = w.gain[a], w.gain[a + 1], w.gain[a + 2]
        z = p.friction[k] * p.inscribed
        for r in range(faces):
            x, y = p.pyramid[r, 0], p.pyramid[r, 1]
            out = inequality[first + r]
            for c in range(ny):
                out[c] = x * along_x[c] + y * along_y[c] + z * up[c]
            lower[first + r] = -(x * w.force[a] + y * w.force[a + 1] + z * w.force[a + 2])
            upper[first + r] = UNBOUNDED
        for c in range(ny):
            inequality[last, c] = up[c]
        lower[last] = t.force_range[k, 0] - w.force[a + 2]
        upper[last] = t.force_range[k, 1] - w.force[a + 2]
        a += 3


@kernel
def first_variables(w: ContactMapRecord, z: Vector, out: Vector) -> None:
    """[u; τ] of a solution; ``w`` is not read."""
    for c in range(out.shape[0]):
        out[c] = z[c]
