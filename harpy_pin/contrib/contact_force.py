"""The whole-body problem in contact forces alone: z = f, three numbers for each foot. Parameters
have it as ``contact_force`` once this module is imported.

With limbs eliminated (:mod:`harpy_pin.wbc.condensed.condense`) thrusts, torques and accelerations
are functions of the contact forces, the best ones for given forces. The cost is that of the root's
six equations,

    minimise    ½ (w − G_f f)ᵀ K⁻¹ (w − G_f f) + ½ w_f ‖f‖²
    subject to  each foot's friction pyramid and range of normal force
                u(f) in its box,  |τ(f)| ≤ τ_max         rows, affine in f

Wherever no thrust and no torque is at its limit it has the optimum of the other formulations, but
for their posture task (limbs have no free posture). At a limit they differ: the others then choose
the other thrusts, the motion of the swing feet and f anew. Here thrusts and motion are functions of
f, so only other forces can satisfy the limit. The cost is then never less than theirs, and the
program may be infeasible where theirs is feasible.

The kernels are those of the condensed controller (:mod:`harpy_pin.wbc.condensed.solve`), which
solves the same program.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from harpy_pin import checks
from harpy_pin.controllers.whole_body_tick import QP_TICKS, tick_of
from harpy_pin.errors import InputError
from harpy_pin.kernels import diagonal, kernel
from harpy_pin.model.cholesky import add_product, solve_factor, solve_transposed
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import Record, RecordOf, field, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set import ProgramRecord
from harpy_pin.wbc.condensed.condense import (
    CondensationRecord,
    eliminate_limbs,
    joint_torques,
    recover,
    root_factor,
    root_of_centre,
)
from harpy_pin.wbc.condensed.condensed_solver import condensation_record, condensed_sizes
from harpy_pin.wbc.formulations import FORMULATIONS
from harpy_pin.wbc.problem import (
    FormulationKernels,
    FormulationRecord,
    WholeBodyProblem,
    enter_pyramids,
)
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.targets import TargetsRecord, force_bounds, friction_rows, root_acceleration


class ContactForceRecord(RecordOf):
    """What the formulation in contact forces keeps of the last state."""

    root: CondensationRecord  # the robot as six equations
    response: Vector = sized(6, "3 feet")  # acceleration of the root per force
    gain: Vector = sized("thrusts + joints", "3 feet")  # [u; τ] per force
    at_rest: Vector = sized("thrusts + joints")  # [u; τ] without forces
    free: Vector = sized("thrusts + others + 3 feet", "3 feet")  # o per force
    motion: Vector = sized("nv", "3 feet")  # a per force


class ContactForceProblem(WholeBodyProblem):
    """No equalities and no bounds; rows for pyramids, normal forces, thrusts and torques.

    Without a stance foot no unknown is left: thrusts beyond their limits are fixed there, and the
    others and the feet's motion follow. Torques beyond theirs are clipped, which
    :meth:`acceleration` does not account for.

    Raises:
        InputError: the robot's joints are not limbs of three, one for each foot, or it has no feet.
    """

    name: ClassVar[str] = "contact_force"
    kernels: ClassVar[FormulationKernels]

    def _allocate(self) -> tuple[QuadraticProgram, Record]:
        if not self.robot.feet:
            raise InputError(
                f"'{self.robot.name}' has no feet, and so no contact forces to choose: take "
                f"'input_space' or 'full'",
                name="formulation",
                value=self.name,
            )
        rows = self.foot_rows * self.feet + self.n_thrust + self.joints
        program = QuadraticProgram(self.n_force, equalities=0, inequalities=rows, bounded=0)
        enter_pyramids(program, self.limits.pyramid, self.feet, force=0)
        self._record_["give_way"] = 1.0  # no task can
        return program, make_record(
            ContactForceRecord, condensed_sizes(self.robot), root=condensation_record(self.robot)
        )

    def acceleration(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.acceleration`."""
        recover(self.terms["root"], self._solution(z))
        return field(self.terms["root"], "acceleration").copy()

    def motion_map(self, held: Vector) -> tuple[Vector, Vector]:
        """See :meth:`WholeBodyProblem.motion_map`. Its rows on accelerations are zero:
        :meth:`check_rows` refuses those that read them.
        """
        held = checks.array("held", held, self.feet)
        motion = np.vstack((np.zeros((self.nv, self.n_force)), np.diag(np.repeat(held, 3) != 0.0)))
        return motion, np.zeros(len(motion))

    def check_rows(self, matrix: Vector) -> None:
        """Refuse rows on accelerations: they, and the thrusts, are chosen for every f before the
        program is solved.

        Raises:
            InputError: there is one.
        """
        if matrix[:, : self.nv].any():
            raise InputError(
                "the formulation 'contact_force' takes tasks on contact forces only: accelerations "
                "and thrusts are "
                "eliminated before. Take 'input_space' or 'full'",
                name="formulation",
                value=self.name,
            )


@kernel
def _build(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: FormulationRecord,
    m: ContactForceRecord,
    qp: ProgramRecord,
    v: Vector,
    rotation: Vector,
) -> None:
    """The program, on elements of the records."""
    e = m.root
    root_acceleration(v, rotation, t, e.desired)
    eliminate_limbs(d, t, p, e, v)
    root_factor(e)
    held = np.any(t.held != 0.0)
    if not held:
        _limit_thrusts(p, e, d.thruster_jacobian.shape[0])
    force_objective(t, p, e, m.response, qp)
    input_map(d, t, m, v)
    force_bounds(t, p.pyramid.shape[0], qp.lower, qp.upper)
    friction_rows(t, p, qp, 0)
    first = qp.lower.shape[0] - m.at_rest.shape[0]
    if held:
        qp.inequality[first:] = m.gain[:, : m.response.shape[1]]
        qp.lower[first:], qp.upper[first:] = p.input_lower - m.at_rest, p.input_upper - m.at_rest
    else:  # never active
        qp.inequality[first:] = 0.0
        qp.lower[first:], qp.upper[first:] = -1.0, 1.0
        m.at_rest[:] = np.clip(m.at_rest, p.input_lower, p.input_upper)


@kernel
def force_objective(
    t: TargetsRecord,
    p: FormulationRecord,
    e: CondensationRecord,
    response: Vector,
    qp: ProgramRecord,
) -> None:
    """H and g; the identity for the force of a swing foot, which is zero; ``response`` becomes L⁻ᵀ
    G_f.
    """
    response[:] = e.force_map
    root_cost(e, response, qp)
    held = np.repeat(t.held, 3) != 0.0
    diagonal(qp.hessian)[:] += np.where(held, p.w_force, 1.0)
    qp.gradient -= np.where(held, p.w_force * t.force.reshape((held.shape[0],)), 0.0)


@kernel
def root_cost(e: CondensationRecord, response: Vector, qp: ProgramRecord) -> None:
    """H = Gᵀ K⁻¹ G and g = −Gᵀ K⁻¹ w, with K = Lᵀ L; ``response`` (6, n) is G, and becomes L⁻ᵀ
    G.
    """
    n = response.shape[1]
    solve_transposed(e.factor, response, n)
    e.multiplier[:] = e.right_hand_side
    solve_transposed(e.factor, e.multiplier.reshape((6, 1)), 1)
    qp.gradient[:n] = -(response.T @ e.multiplier)
    qp.hessian[:n, :n] = response.T @ response


@kernel
def input_map(d: DynamicsRecord, t: TargetsRecord, m: ContactForceRecord, v: Vector) -> None:
    """Thrusts and torques as an affine function of the contact forces: [u; τ] = at_rest + gain f.

    ``response`` is L⁻ᵀ G_f and becomes K⁻¹ G_f.
    """
    e, n, thrusts = m.root, m.response.shape[1], d.thruster_jacobian.shape[0]
    nothing = np.zeros(n)
    recover(e, nothing)
    m.at_rest[:thrusts] = e.free_acceleration[:thrusts]
    joint_torques(d, e, v, nothing, m.at_rest[thrusts:])
    solve_factor(e.factor, m.response, n)
    for c in range(e.inverse_weight.shape[0]):
        m.free[c] = -e.inverse_weight[c] * (e.free_map[c] @ m.response)
    _motion_per_unit(t, m, thrusts)
    _input_per_unit(d, t, m)


@kernel
def _motion_per_unit(t: TargetsRecord, m: ContactForceRecord, thrusts: int) -> None:
    """Generalised accelerations per unit of each force, into ``motion``."""
    e, free, motion = m.root, m.free, m.motion
    motion[:6] = e.inverse_body_weight[:, None] * (e.mass.T @ m.response)
    if e.centred:
        root_of_centre(e, motion, free, 0.0)
    first, rows = thrusts + e.others.shape[0], e.inverse.shape[2]
    if e.others.shape[0] > 0:
        motion[e.others] = free[thrusts:first]
    for k in range(e.limb.shape[0]):
        motion[e.limb[k]] = e.limb_map[k] @ motion[:6]
        if t.held[rows * k // 3] == 0.0:
            motion[e.limb[k]] += e.inverse[k] @ free[first + rows * k : first + rows * (k + 1)]


@kernel
def _input_per_unit(d: DynamicsRecord, t: TargetsRecord, m: ContactForceRecord) -> None:
    """Thrusts and torques per unit of each force, into ``gain``."""
    e, gain, thrusts, rows = m.root, m.gain, d.thruster_jacobian.shape[0], m.root.inverse.shape[2]
    gain[:thrusts] = m.free[:thrusts]
    gain[thrusts:] = 0.0
    add_product(d.mass_matrix[6:], m.motion, gain[thrusts:])  # limbs do not feel each other
    if thrusts > 0:
        add_product(-d.thruster_jacobian[:, 6:].T, m.free[:thrusts], gain[thrusts:])
    for k in range(e.limb.shape[0]):
        if t.held[rows * k // 3] != 0.0:
            jacobian = d.foot_jacobian[rows * k : rows * (k + 1)]
            gain[thrusts + e.limb[k] - 6, rows * k : rows * (k + 1)] -= jacobian[:, e.limb[k]].T


@kernel
def _limit_thrusts(p: FormulationRecord, e: CondensationRecord, thrusts: int) -> None:
    """Without contact: fix the thrusts that are beyond their limits at these limits; each pass
    fixes one or more.
    """
    nothing = np.zeros(e.force_map.shape[1])
    for _ in range(thrusts):
        recover(e, nothing)
        found = False
        for c in range(thrusts):
            u, low, high = e.free_acceleration[c], p.input_lower[c], p.input_upper[c]
            if e.inverse_weight[c] != 0.0 and (u < low or u > high):
                found = True
                e.free_acceleration[c] = high if u > high else low
                e.inverse_weight[c] = 0.0
                e.right_hand_side -= e.free_map[c] * e.free_acceleration[c]
        if not found:
            break
        root_factor(e)


@kernel
def _inputs(m: ContactForceRecord, qp: ProgramRecord, z: Vector, out: Vector) -> None:
    """[u; τ] of contact forces."""
    out[:] = m.at_rest + m.gain[:, : z.shape[0]] @ z


@kernel
def _force(
    p: FormulationRecord, m: ContactForceRecord, qp: ProgramRecord, z: Vector, out: Vector
) -> None:
    """Contact forces of a solution: the variables themselves."""
    out[:] = z


@kernel
def _limit(p: FormulationRecord, m: ContactForceRecord, qp: ProgramRecord, on: bool) -> None:
    """Nothing: where tasks do not give way, the program keeps its limits."""


@kernel
def _give_way(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: FormulationRecord,
    m: ContactForceRecord,
    qp: ProgramRecord,
    z: Vector,
) -> None:
    """Nothing: the motion of swing feet is a function of the forces."""


@kernel
def _acceleration(m: ContactForceRecord, z: Vector, out: Vector) -> None:
    """Generalised acceleration that follows from contact forces."""
    recover(m.root, z)
    out[:] = m.root.acceleration


ContactForceProblem.kernels = FormulationKernels(
    _build, _inputs, _force, _acceleration, _limit, _give_way
)
FORMULATIONS[ContactForceProblem.name] = ContactForceProblem
QP_TICKS[ContactForceProblem.name] = tick_of(ContactForceProblem.name)
