"""The whole-body problem in contact forces alone: z = [s; f], three numbers for each foot.

With limbs eliminated (:mod:`harpy_pin.wbc.condensed.condense`) thrusts, torques and accelerations are functions of the
contact forces, the best ones for given forces. The cost is that of the root's six equations,

    minimise    ½ (w − G_f f)ᵀ K⁻¹ (w − G_f f) + ½ w_f ‖f‖²
    subject to  each foot's friction pyramid and range of normal force
                u(f) in its box,  |τ(f)| ≤ τ_max         rows, affine in f

Wherever no thrust and no torque is at its limit it has the optimum of the other formulations, but for their posture
task (limbs have no free posture). At a limit they differ: the others then choose the other thrusts, the motion of the
swing feet and f anew. Here thrusts and motion are functions of f, so only other forces can satisfy the limit. The cost
is then never less than theirs, and the program may be infeasible where theirs is feasible.

The kernels are those of the condensed controller (:mod:`harpy_pin.wbc.condensed.condensed_solver`), which solves the
same program.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics, DynamicsRecord
from harpy_pin.model.record import RecordOf, field, make_record, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.condense import CondensationRecord, condensation_record
from harpy_pin.wbc.condensed.input_map import input_map
from harpy_pin.wbc.condensed.limbs import eliminate_limbs
from harpy_pin.wbc.condensed.root import fix_thrusts, force_response, recover, root_factor, solve_root
from harpy_pin.wbc.problem import (
    ProblemRecord,
    WholeBodyProblem,
    clear_objective,
    desired_acceleration,
    force_bounds,
    friction_limits,
    friction_rows,
)
from harpy_pin.wbc.program import ProgramRecord, QuadraticProgram
from harpy_pin.wbc.weights import TargetsRecord, WholeBodyTargets, thrust_box

__all__ = ["ContactForceProblem"]


class ContactForceRecord(RecordOf):
    """What the formulation in contact forces keeps of the last state.

    Attributes:
        root: the robot as six equations.
        response: (6, 3 feet) acceleration of the root per force.
        gain: (inputs, 3 feet) [u; τ] per force.
        at_rest: (inputs,) [u; τ] without forces.
        desired: (nv,) demanded generalised acceleration.
        input_lower: (inputs,) N and N·m.
        input_upper: (inputs,) N and N·m.
    """

    root: CondensationRecord
    response: Vector = sized(6, "3 feet")
    gain: Vector = sized("thrusts + joints", "3 feet")
    at_rest: Vector = sized("thrusts + joints")
    desired: Vector = sized("nv")
    input_lower: Vector
    input_upper: Vector


class ContactForceProblem(WholeBodyProblem):
    """No equalities and no bounds but the slacks'; rows for pyramids, normal forces, thrusts and torques.

    Without a stance foot no unknown is left: thrusts beyond their limits are fixed there, and the others and the feet's
    motion follow. Torques beyond theirs are clipped, which :meth:`acceleration` does not account for.

    Raises:
        InputError: the robot's joints are not limbs of three, one for each foot, or it has no feet.
    """

    name: ClassVar[str] = "contact_force"
    can_give_way: ClassVar[bool] = False  # the motion of swing feet is a function of the forces

    def _allocate(self) -> QuadraticProgram:
        if not self.robot.feet:
            raise InputError(
                f"'{self.robot.name}' has no feet, and so no contact forces to choose: take 'input_space' or 'full'",
                name="formulation",
                value=self.name,
            )
        slacks, inputs = self.n_slack, self.n_thrust + self.joints
        program = QuadraticProgram(
            slacks + self.n_force, equalities=0, inequalities=self.foot_rows * self.feet + inputs, bounded=slacks
        )
        self._bound_slacks(program, slack=0)
        self._friction(program, force=slacks)
        lower, upper = thrust_box(self.robot, self.limits) if self.n_thrust else (np.zeros(0), np.zeros(0))
        self.terms = make_record(
            ContactForceRecord,
            self.robot.sizes,
            root=condensation_record(self.robot),
            input_lower=np.concatenate((lower, -self._torque_limit)),
            input_upper=np.concatenate((upper, self._torque_limit)),
        )
        return program

    @property
    def thrust_bounds(self) -> list[tuple[Vector, Vector]]:
        """See :attr:`WholeBodyProblem.thrust_bounds`."""
        return [(field(self.terms, "input_lower"), field(self.terms, "input_upper"))]

    @checked
    def prepare(self, dynamics: Dynamics, targets: WholeBodyTargets) -> None:
        """See :meth:`WholeBodyProblem.prepare`."""
        records = (dynamics.record, targets.record, self.record, self.terms, self.program.record)
        build_force.prepare(*records, np.zeros(self.nv), dynamics.rotation)

    def _fill(self, dynamics: Dynamics, v: Vector, rotation: Vector, targets: WholeBodyTargets) -> None:
        """See :meth:`WholeBodyProblem._fill`."""
        build_force(dynamics._record_, targets._record_, self.record, self.terms, self.program._record_, v, rotation)

    def inputs(self, z: Vector, out: Vector) -> None:
        """See :meth:`WholeBodyProblem.inputs`."""
        z, out = self._solution(z), self._output(out)
        force_inputs(self.terms, z, out)

    def acceleration(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.acceleration`."""
        z = self._solution(z)
        recover(self.terms["root"], z[self.n_slack :].copy())
        return field(self.terms["root"], "acceleration").copy()

    def contact_force(self, z: Vector) -> Vector:
        """See :meth:`WholeBodyProblem.contact_force`."""
        z = self._solution(z)
        return z[self.n_slack :].reshape(-1, 3).copy()

    def motion_map(self, held: Vector) -> tuple[Vector, Vector]:
        """See :meth:`WholeBodyProblem.motion_map`. Its rows on accelerations are zero: :meth:`check_rows` refuses those
        that read them."""
        held = checks.array("held", held, self.feet)
        motion = np.zeros((self.nv + self.n_force, len(self.program.gradient)))
        motion[self.nv :, self.n_slack :] = np.diag(np.repeat(held, 3) != 0.0)
        return motion, np.zeros(len(motion))

    def check_rows(self, matrix: Vector) -> None:
        """Refuse rows on accelerations: they, and the thrusts, are chosen for every f before the program is solved.

        Raises:
            InputError: there is one.
        """
        if matrix[:, : self.nv].any():
            raise InputError(
                "the formulation 'contact_force' takes tasks on contact forces only: accelerations and thrusts are "
                "eliminated before. Take 'input_space' or 'full'",
                name="formulation",
                value=self.name,
            )


@kernel
def force_objective(
    t: TargetsRecord, w_force: float, r: CondensationRecord, response: Vector, qp: ProgramRecord
) -> None:
    """H = G_fᵀ K⁻¹ G_f + w_f I and g = −G_fᵀ K⁻¹ w on the forces, the last variables; the identity in swing.

    Args:
        t: element of the targets' record.
        w_force: weight of the contact forces.
        r: of the root's equation, factored.
        response: (6, 3 feet) out: L⁻ᵀ G_f with K = Lᵀ L.
        qp: of the program, out.
    """
    force_response(r, response)
    n = response.shape[1]
    first = qp.gradient.shape[0] - n
    for i in range(6):
        r.multiplier[i] = r.right_hand_side[i]
    solve_root(r, r.multiplier)
    for a in range(n):
        held = t.held[a // 3] != 0.0
        s = 0.0
        for i in range(6):
            s += response[i, a] * r.multiplier[i]
        qp.gradient[first + a] = -s
        for b in range(a + 1):
            s = 0.0
            for i in range(6):
                s += response[i, a] * response[i, b]
            qp.hessian[first + a, first + b] = s
            qp.hessian[first + b, first + a] = s
        qp.hessian[first + a, first + a] += w_force if held else 1.0


@kernel
def build_force(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: ProblemRecord,
    w: ContactForceRecord,
    qp: ProgramRecord,
    v: Vector,
    rotation: Vector,
) -> None:
    """The program, on elements of the records."""
    r = w.root
    desired_acceleration(v, rotation, t, w.desired)
    for i in range(6):
        r.desired[i] = w.desired[i]
    eliminate_limbs(d, t, p, r, v)
    root_factor(r)
    held = False
    for k in range(t.held.shape[0]):
        held = held or t.held[k] != 0.0
    if not held:
        _limit_thrusts(d, w, r)
    clear_objective(p, qp, 0, qp.bounded)
    force_objective(t, p.w_force, r, w.response, qp)
    input_map(d, t, r, v, w.response, w.gain, w.at_rest, False)
    force_bounds(t, p.pyramid.shape[0], qp.lower[qp.bounded :], qp.upper[qp.bounded :])
    friction_limits(t, p)
    friction_rows(p, qp, qp.bounded)
    first, size = qp.lower.shape[0] - w.at_rest.shape[0], qp.gradient.shape[0] - w.response.shape[1]
    for c in range(w.at_rest.shape[0]):
        row, low, high = first + c, w.input_lower[c], w.input_upper[c]
        if held:
            for a in range(w.response.shape[1]):
                qp.inequality[row, size + a] = w.gain[c, a]
            qp.lower[row], qp.upper[row] = low - w.at_rest[c], high - w.at_rest[c]
        else:  # never active
            qp.inequality[row] = 0.0
            qp.lower[row], qp.upper[row] = -1.0, 1.0
            w.at_rest[c] = min(max(w.at_rest[c], low), high)


@kernel
def _limit_thrusts(d: DynamicsRecord, w: ContactForceRecord, r: CondensationRecord) -> None:
    """Thrusts within their limits without contact; each pass fixes one or more."""
    thrusts = d.thruster_jacobian.shape[0]
    nothing = np.zeros(w.response.shape[1])
    for _ in range(thrusts):
        recover(r, nothing)
        if not fix_thrusts(r, w.input_lower[:thrusts], w.input_upper[:thrusts]):
            break
        root_factor(r)


@kernel
def force_inputs(w: ContactForceRecord, z: Vector, out: Vector) -> None:
    """[u; τ] of contact forces."""
    n = w.response.shape[1]
    first = z.shape[0] - n
    for c in range(out.shape[0]):
        s = w.at_rest[c]
        for a in range(n):
            s += w.gain[c, a] * z[first + a]
        out[c] = s
