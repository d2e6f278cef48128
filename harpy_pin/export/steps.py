"""One tick of each controller as one kernel, with what Python does around it in the library.

Each takes an element ``r`` of the controller's record (:mod:`harpy_pin.export.exported_controllers`), the gait's
targets and what was measured, and writes the command. A sample or targets that are not finite are answered by the last
command, which fades after ``HOLD_TICKS`` ticks. All arrays are as in :class:`harpy_pin.model.state.State`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import Kernel, kernel
from harpy_pin.controllers.contacts import forces_in_world
from harpy_pin.controllers.joint_friction import note_inputs
from harpy_pin.controllers.legs import track_foot
from harpy_pin.controllers.paper_law import ControlRecord, limit_bent, measure_state, thrusts
from harpy_pin.controllers.tasks import CondensedTasksRecord, TasksRecord, task_terms
from harpy_pin.controllers.whole_body_tick import FORMULATION_KERNELS, GIVING_WAY_KERNELS
from harpy_pin.governors.contact_force_kernels import ContactForceFilterRecord, hold_forces
from harpy_pin.governors.reduced.erg import ErgRecord, force_update
from harpy_pin.model.dynamics import DynamicsRecord, update_terms
from harpy_pin.model.entry import FADE, GOOD, HOLD_TICKS
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.rotor import write_thrusts
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set_warm_start import EXCHANGES, ActiveSetRecord, exchange
from harpy_pin.wbc.condensed.condensed_solver import hold_last, solve_condensed
from harpy_pin.wbc.condensed.contact_force import ContactForceRecord
from harpy_pin.wbc.dual import DualRecord, dual_active_set
from harpy_pin.wbc.giving_way import at_a_limit, beyond_torque_limit
from harpy_pin.wbc.qp_solver import ACCEPTED, worst_violation

if TYPE_CHECKING:
    from harpy_pin.gaits.gait import GaitTargetRecord
    from harpy_pin.governors.reduced.rows import ForceRowsRecord
    from harpy_pin.model.contact_map import ContactMapRecord
    from harpy_pin.model.kinematics import LegRecord
    from harpy_pin.wbc.problem import ProblemRecord
    from harpy_pin.wbc.program import ProgramRecord

__all__ = ["BAD_SAMPLE", "FALLBACK", "QP_STEPS", "VIOLATED", "condensed_step", "contact_step", "paper_step"]

BAD_SAMPLE = 16
"""Status: the state or the targets are not finite, or the gait turns and the controller cannot."""
FALLBACK = 8
"""Status: the program has no solution, or none was found: the last command is held, then the posture."""
VIOLATED = 1
"""Status: the governor's constraint does not hold with the command given."""
STIFFNESS, DAMPING = 50.0, 1.0
"""Of the joints where the program has no solution for long, N·m/rad and N·m·s/rad."""


class TickRecord(RecordOf):
    """What every tick keeps.

    Attributes:
        bad_in_a_row: how many of the last samples were bad.
    """

    bad_in_a_row: int


class InputsTickRecord(TasksRecord, TickRecord):
    """A whole-body controller, ticking.

    Attributes:
        thrust: (thrusters, 3) of the last command, world axes, N.
    """

    thrust: Vector


class CondensedTickRecord(CondensedTasksRecord, InputsTickRecord):
    """The condensed whole-body controller, ticking."""


class ProgramTickRecord(InputsTickRecord):
    """The whole-body QP, ticking.

    Attributes:
        problem: what the formulation knows.
        terms: what it keeps of the last state: formulation ``input_space``, or ``contact_force``.
        program: the quadratic program.
        search: the last active set and its exchange.
        dual: the dual method, which starts without active constraints.
        z: solution of the exchange.
        found: solution of the dual method.
        inputs: (thrust variables + joints,) [u; τ] of the command, N and N·m.
        wanted: (thrust variables + joints,) [u; τ] without limits, N and N·m.
        posture: (joints,) that the spring pulls to where there is no solution for long, rad.
        hold_ticks: ticks in a row for which the last inputs are held in the place of failed ones.
        held_for: ticks in a row in which there was no solution.
    """

    problem: ProblemRecord
    terms: ContactMapRecord | ContactForceRecord
    program: ProgramRecord
    search: ActiveSetRecord
    dual: DualRecord
    z: Vector = sized("size")
    found: Vector = sized("size")
    inputs: Vector = sized("inputs")
    wanted: Vector = sized("inputs")
    posture: Vector
    hold_ticks: int
    held_for: int = ZERO


class GovernedTickRecord(TickRecord):
    """The paper's controller, ticking.

    Attributes:
        control: gains, references and the command.
        left: geometry of the left leg.
        right: of the right one.
    """

    control: ControlRecord
    left: LegRecord
    right: LegRecord


class PaperTickRecord(GovernedTickRecord):
    """The same with the paper's reference governor.

    Attributes:
        governor: of the reference.
        rows: its constraints.
        fresh: 1 before the first good sample, at which the applied reference begins.
    """

    governor: ErgRecord
    rows: ForceRowsRecord
    fresh: int


class FilterTickRecord(GovernedTickRecord):
    """The same in front of the contact-force filter.

    Attributes:
        dynamics: terms of the equations of motion.
        terms: how thrusts and torques change the contact forces.
        governor: the filter.
    """

    dynamics: DynamicsRecord
    terms: ContactMapRecord
    governor: ContactForceFilterRecord


@kernel
def condensed_step(
    r: CondensedTickRecord,
    target: GaitTargetRecord,
    q: Vector,
    v: Vector,
    foot_force: Vector,
    torque: Vector,
    thrust: Vector,
) -> int:
    """A tick of the condensed whole-body controller; returns its status."""
    p = r.condensed
    status = BAD_SAMPLE
    if task_terms(r, target, q, v, foot_force) == GOOD:
        solve_condensed(r.dynamics, r.targets, p, v, r.dynamics.tree.rotation)
        forces_in_world(r.targets, p.force)
        hold_last(p)
        note_inputs(r.joint_friction, p.inputs)
        status = p.status_and_systems[0]
    _write_inputs(r, p.inputs, status == BAD_SAMPLE, torque, thrust)
    return status


def _solve_of(name: str) -> Kernel[int]:
    """Kernel that solves the program of a formulation and reads the inputs off it; zero, or ``FALLBACK``."""
    read = FORMULATION_KERNELS[name][1]
    if name not in GIVING_WAY_KERNELS:

        @kernel
        def solve(r: ProgramTickRecord) -> int:
            status = _solve(r, r.program)
            if status == 0:
                read(r.terms, r.z, r.inputs)
            return status

        return solve
    limit, give_way = GIVING_WAY_KERNELS[name]

    @kernel
    def solve_giving_way(r: ProgramTickRecord) -> int:
        """Where thrusts or torques are at their limits, tasks may give way (:mod:`harpy_pin.wbc.giving_way`)."""
        p, qp, wanted = r.problem, r.program, r.wanted
        status = _solve(r, qp)
        if status == 0:
            read(r.terms, r.z, r.inputs)
            if not at_a_limit(r.inputs, p):
                return 0
        if p.give_way == 1.0:
            return status
        limit(p, qp, False)
        beyond = False
        if _solve(r, qp) == 0:
            read(r.terms, r.z, wanted)
            beyond = beyond_torque_limit(wanted[wanted.shape[0] - p.torque_limit.shape[0] :], p.torque_limit)
        limit(p, qp, True)
        if beyond:
            give_way(r.dynamics, r.targets, p, r.terms, qp, r.z)
            if _solve(r, qp) == 0:
                read(r.terms, r.z, r.inputs)
                return 0
        return status

    return solve_giving_way


def qp_step_of(name: str) -> Kernel[int]:
    """The tick of the whole-body QP in a formulation."""
    build, solve = FORMULATION_KERNELS[name][0], _solve_of(name)

    @kernel
    def qp_step(
        r: ProgramTickRecord,
        target: GaitTargetRecord,
        q: Vector,
        v: Vector,
        foot_force: Vector,
        torque: Vector,
        thrust: Vector,
    ) -> int:
        """A tick of the whole-body QP; returns its status."""
        d, qp = r.dynamics, r.program
        status = BAD_SAMPLE
        if task_terms(r, target, q, v, foot_force) == GOOD:
            build(d, r.targets, r.problem, r.terms, qp, v, d.tree.rotation)
            status = solve(r)
            _answer_failure(r, status, q, v)
            note_inputs(r.joint_friction, r.inputs)
        _write_inputs(r, r.inputs, status == BAD_SAMPLE, torque, thrust)
        return status

    return qp_step


QP_STEPS: dict[str, Kernel[int]] = {name: qp_step_of(name) for name in FORMULATION_KERNELS}
"""By formulation."""


@kernel
def paper_step(
    r: PaperTickRecord,
    target: GaitTargetRecord,
    q: Vector,
    v: Vector,
    foot_position: Vector,
    foot_force: Vector,
    torque: Vector,
    thrust: Vector,
) -> int:
    """A tick of the paper's controller: governor of the reference, thruster law, inverse kinematics, joint PID."""
    p = r.control
    status = BAD_SAMPLE
    if measure_state(p, target, q, v, foot_position, foot_force) <= GOOD:
        if r.fresh:
            for i in range(6):
                r.governor.applied[i] = p.reference[i]
            r.governor.repairing = 0.0
            r.fresh = 0
        status = VIOLATED if force_update(p.measured, p.reference, p.period, r.governor, r.rows) else 0
        _actuate(r, target, r.governor.applied, q, v)
    _write_command(r, p.torque, p.thrust, status == BAD_SAMPLE, torque, thrust)
    return status


@kernel
def contact_step(
    r: FilterTickRecord,
    target: GaitTargetRecord,
    q: Vector,
    v: Vector,
    foot_position: Vector,
    foot_force: Vector,
    torque: Vector,
    thrust: Vector,
) -> int:
    """A tick of the same controller without that governor, in front of the contact-force filter."""
    p = r.control
    status = BAD_SAMPLE
    if measure_state(p, target, q, v, foot_position, foot_force) <= GOOD and update_terms(r.dynamics, q, v) == GOOD:
        _actuate(r, target, p.reference, q, v)
        r.governor.normal[:] = target.normal
        excess = hold_forces(r.dynamics, r.terms, r.governor, v, foot_force, p.torque, p.thrust)
        limit_bent(p, p.reference, r.governor.bend)
        status = VIOLATED if excess > 0.0 else 0
    _write_command(r, p.torque, p.thrust, status == BAD_SAMPLE, torque, thrust)
    return status


@kernel
def _solve(r: ProgramTickRecord, qp: ProgramRecord) -> int:
    """The last active set and its exchange, then the dual method; zero, or ``FALLBACK`` where ``z`` is no solution."""
    w, z = r.search, r.z
    systems, _ = exchange(qp, w, z)
    if systems <= EXCHANGES:
        return 0
    outcome, _ = dual_active_set(qp, r.dual, r.found)
    for c in range(w.active.shape[0]):
        w.active[c] = r.dual.active[c]
    violation = worst_violation(qp, r.found)
    if outcome > 1 or not violation <= ACCEPTED:
        w.active[:] = 0
        return FALLBACK
    systems, _ = exchange(qp, w, z)
    if systems > EXCHANGES:
        for c in range(z.shape[0]):
            z[c] = r.found[c]
    return 0


@kernel
def _answer_failure(r: ProgramTickRecord, status: int, q: Vector, v: Vector) -> None:
    """Without a solution the last inputs stay for a while; then a soft spring and damper, without thrust."""
    r.held_for = 0 if status == 0 else r.held_for + 1
    if r.held_for > r.hold_ticks:
        thrusts = r.inputs.shape[0] - r.posture.shape[0]
        for c in range(thrusts):
            r.inputs[c] = 0.0
        for j in range(r.posture.shape[0]):
            u = STIFFNESS * (r.posture[j] - q[7 + j]) - DAMPING * v[6 + j]
            r.inputs[thrusts + j] = min(max(u, -r.problem.torque_limit[j]), r.problem.torque_limit[j])


@kernel
def _actuate(r: GovernedTickRecord, target: GaitTargetRecord, applied: Vector, q: Vector, v: Vector) -> None:
    """Thrusts from the applied reference, torques from the gait's feet."""
    thrusts(r.control, applied, v)
    track_foot(0, r.control, r.left, target, q, v)
    track_foot(1, r.control, r.right, target, q, v)


@kernel
def _write_inputs(r: InputsTickRecord, inputs: Vector, bad: bool, torque: Vector, thrust: Vector) -> None:
    """The command of inputs [u; τ]; of a bad sample the last one, which fades."""
    rotors = r.dynamics.rotor_axis.shape[0] > 0
    first = inputs.shape[0] - torque.shape[0]
    factor = _fading(r, bad)
    if bad:
        for c in range(first if rotors else 0, inputs.shape[0]):
            inputs[c] *= factor
        if rotors:
            for k in range(thrust.shape[0]):
                for i in range(3):
                    r.thrust[k, i] *= factor
    if not (bad and rotors):
        write_thrusts(r.dynamics, inputs, r.thrust)
    for k in range(thrust.shape[0]):
        for i in range(3):
            thrust[k, i] = r.thrust[k, i]
    for j in range(torque.shape[0]):
        torque[j] = inputs[first + j]


@kernel
def _write_command(
    r: GovernedTickRecord, own_torque: Vector, own_thrust: Vector, bad: bool, torque: Vector, thrust: Vector
) -> None:
    """The command; of a bad sample the last one, which fades."""
    factor = _fading(r, bad)
    for j in range(torque.shape[0]):
        own_torque[j] *= factor
        torque[j] = own_torque[j]
    for k in range(thrust.shape[0]):
        for i in range(3):
            own_thrust[k, i] *= factor
            thrust[k, i] = own_thrust[k, i]


@kernel
def _fading(r: TickRecord, bad: bool) -> float:
    """Factor on the last command."""
    r.bad_in_a_row = r.bad_in_a_row + 1 if bad else 0
    return FADE if r.bad_in_a_row > HOLD_TICKS else 1.0
