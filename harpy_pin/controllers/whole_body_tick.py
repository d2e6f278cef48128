"""The tick of the whole-body QP, in every formulation: phases, and one kernel that is made of them.

The kernel has this library's own search (:mod:`harpy_pin.wbc.active_set_warm_start`). With another
solver Python calls the phases, and that solver between them. A tick solves up to three programs:
with limits of thrusts and torques; where one of them is reached, without them; and again with them,
after tasks gave way (:mod:`harpy_pin.wbc.giving_way`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harpy_pin.controllers.friction import note_inputs
from harpy_pin.controllers.joint_targets import (
    JointTargetsRecord,
    add_lacking,
    keep_targets,
    move_targets,
)
from harpy_pin.controllers.tasks import TasksRecord, forces_in_world, task_terms
from harpy_pin.controllers.tick import BAD_SAMPLE, FALLBACK, TickRecord, write_inputs
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.contact_map import ContactMapRecord
from harpy_pin.model.entry import GOOD
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import write_thrusts
from harpy_pin.wbc.active_set import ActiveSetRecord, DualRecord, ProgramRecord
from harpy_pin.wbc.active_set_warm_start import INACCURATE, solve_further, start_tick
from harpy_pin.wbc.formulations import FORMULATIONS
from harpy_pin.wbc.giving_way import at_a_limit, outside
from harpy_pin.wbc.problem import FormulationRecord

OPEN = 32
"""Status of a tick whose program is built, and not solved yet."""
STIFFNESS, DAMPING = 50.0, 1.0
"""Stiffness and damping of the joints where the program has no solution for long, N·m/rad and
N·m·s/rad.
"""


class WholeBodyTickRecord(TasksRecord, TickRecord):
    """The whole-body QP."""

    inputs: Vector = sized(
        "thrusts + joints"
    )  # (thrust variables + joints,) [u; τ] of the command, N and N·m
    unlimited: Vector = sized(
        "thrusts + joints"
    )  # (thrust variables + joints,) [u; τ] without limits, N and N·m
    force: Vector = sized("3 feet")  # contact forces of the solution, world axes, N
    z: Vector  # (size,) solution
    found: Vector  # (size,) work space for that of the dual method
    kept: Vector  # (size,) a solution with limits, while one without is looked for
    outcome: int = ZERO  # of the program, a :class:`~harpy_pin.wbc.QPStatus`
    iterations: int = ZERO  # of the solver
    violation: float = 0.0  # of the solution
    kept_outcome: int = ZERO  # the same of the solution that is kept
    kept_iterations: int = ZERO
    kept_violation: float = 0.0
    posture: Vector  # (joints,) that the spring pulls to where there is no solution for long, rad
    torque_limit: Vector  # (joints,) of the motors, N·m
    hold_ticks: int  # ticks in a row for which the last inputs are held in the place of failed ones
    held_for: int = ZERO  # ticks in a row in which there was no solution
    failures: int = ZERO  # ticks in which there was none, since the last reset
    fallbacks: int = (
        ZERO  # ticks in which the dual method followed the solver, since the last reset
    )
    lagging: int = ZERO  # 1 where thrusts lag, so that the command's are not those of the inputs


class WholeBodyTargetsRecord(WholeBodyTickRecord):
    """The whole-body QP, with joint targets."""

    motors: JointTargetsRecord  # of them


class ProgramTickRecord(RecordOf):
    """The whole-body QP with its program and solver, in one record."""

    control: WholeBodyTickRecord  # tasks, solution and command
    problem: FormulationRecord  # what the formulation knows
    terms: ContactMapRecord  # what the formulation keeps of the last state
    program: ProgramRecord  # the quadratic program
    search: ActiveSetRecord  # the last active set and its exchange
    dual: DualRecord  # the dual method, which starts without active constraints


@kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
def begin_tick(
    r: WholeBodyTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> int:
    """Terms and tasks; after a bad sample the last command stays, and fades. Returns what the
    sample is.
    """
    r.verdict = task_terms(r, target, q, v, foot_force)
    if r.verdict != GOOD:
        write_inputs(r, r.inputs, r.lagging != 0 or r.dynamics.rotor_axis.shape[0] > 0)
    return r.verdict


@kernel
def _write_command(r: WholeBodyTickRecord, usable: bool, q: Vector, v: Vector) -> None:
    """The command of the inputs; without a solution the last one for a while, then a soft spring
    without thrust.
    """
    first = r.inputs.shape[0] - r.posture.shape[0]
    if usable:
        r.held_for = 0
        if r.lagging == 0:
            write_thrusts(r.dynamics, r.inputs, r.thrust)
    else:
        r.failures += 1
        r.held_for += 1
        if r.held_for > r.hold_ticks:
            r.inputs[:first] = 0.0
            spring = STIFFNESS * (r.posture - q[7:]) - DAMPING * v[6:]
            r.inputs[first:] = np.clip(spring, -r.torque_limit, r.torque_limit)
            r.thrust[:] = 0.0
    note_inputs(r.joint_friction, r.inputs)
    write_inputs(r, r.inputs, True)


@kernel
def _solve_once(
    r: WholeBodyTickRecord, qp: ProgramRecord, search: ActiveSetRecord, dual: DualRecord
) -> bool:
    """Solve one program of the tick, and say how; returns whether there is a solution."""
    r.outcome = solve_further(qp, search, dual, r.z, r.found)
    r.iterations, r.violation = search.iterations, search.violation
    return r.outcome <= INACCURATE


@dataclass(frozen=True)
class TickKernels:
    """The tick of the whole-body QP in a formulation."""

    step: Kernel[int]  # all of it with our own search, on the records of its parts
    step_of_one: Kernel[int]  # the same on one record, a :class:`ProgramTickRecord`
    open: Kernel[int]  # terms, tasks and program: what is before the first solution
    relax: Kernel[
        bool
        # after the program with limits was solved, takes them out where one is reached; whether it
        # did
    ]
    # after that was solved, puts the limits in again; whether tasks gave way, so that one more
    # follows
    give_way: Kernel[bool]
    # takes that one's solution or, without one, what :func:`relax` kept; whether the tick has a
    # solution
    settle: Kernel[bool]
    finish: Kernel[
        int
    ]  # forces and command of the solution, or the fallback; the status of the tick
    targets: Kernel[None]  # joint targets of the solution, after :attr:`finish`
    step_with_targets: Kernel[int]  # :attr:`step`, and these
    step_of_one_with_targets: Kernel[int]  # :attr:`step_of_one`, and these


def tick_of(formulation: str) -> TickKernels:
    """The tick in a formulation."""
    kernels = FORMULATIONS[formulation].kernels
    build, read, read_force = kernels.build, kernels.inputs, kernels.force
    limit, let_give_way, read_acceleration = kernels.limit, kernels.give_way, kernels.acceleration

    @kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
    def open_tick(
        r: WholeBodyTickRecord,
        target: GaitTargetRecord,
        q: Vector,
        v: Vector,
        foot_force: Vector,
        p: FormulationRecord,
        m: ContactMapRecord,
        qp: ProgramRecord,
    ) -> int:
        if begin_tick(r, target, q, v, foot_force) != GOOD:
            return BAD_SAMPLE
        build(r.dynamics, r.targets, p, m, qp, v, r.dynamics.tree.rotation)
        return OPEN

    @kernel
    def relax(
        r: WholeBodyTickRecord,
        p: FormulationRecord,
        m: ContactMapRecord,
        qp: ProgramRecord,
        usable: bool,
    ) -> bool:
        if usable:
            read(m, qp, r.z, r.inputs)
        if p.give_way == 1.0 or (usable and not at_a_limit(r.inputs, p)):
            return False
        r.kept[:] = r.z
        r.kept_outcome, r.kept_iterations, r.kept_violation = r.outcome, r.iterations, r.violation
        limit(p, m, qp, False)
        return True

    @kernel
    def give_way(
        r: WholeBodyTickRecord,
        p: FormulationRecord,
        m: ContactMapRecord,
        qp: ProgramRecord,
        usable: bool,
    ) -> bool:
        beyond = False
        if usable:
            read(m, qp, r.z, r.unlimited)
            first = r.unlimited.shape[0] - p.torque_limit.shape[0]
            beyond = outside(r.unlimited[first:], p.input_lower[first:], p.input_upper[first:])
        limit(p, m, qp, True)
        if beyond:
            let_give_way(r.dynamics, r.targets, p, m, qp, r.z)
        return beyond

    @kernel
    def settle(
        r: WholeBodyTickRecord, m: ContactMapRecord, qp: ProgramRecord, usable: bool
    ) -> bool:
        if usable:
            read(m, qp, r.z, r.inputs)
            return True
        r.z[:] = r.kept
        r.outcome, r.iterations, r.violation = r.kept_outcome, r.kept_iterations, r.kept_violation
        return r.outcome <= INACCURATE

    @kernel
    def finish(
        r: WholeBodyTickRecord,
        p: FormulationRecord,
        m: ContactMapRecord,
        qp: ProgramRecord,
        usable: bool,
        q: Vector,
        v: Vector,
    ) -> int:
        read_force(p, m, qp, r.z, r.force)
        forces_in_world(r.targets, r.force)
        _write_command(r, usable, q, v)
        return 0 if usable else FALLBACK

    @kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
    def qp_step(
        r: WholeBodyTickRecord,
        target: GaitTargetRecord,
        q: Vector,
        v: Vector,
        foot_force: Vector,
        problem: FormulationRecord,
        terms: ContactMapRecord,
        program: ProgramRecord,
        search: ActiveSetRecord,
        dual: DualRecord,
    ) -> int:
        """A tick of the whole-body QP; returns its status."""
        if open_tick(r, target, q, v, foot_force, problem, terms, program) != OPEN:
            return BAD_SAMPLE
        start_tick(search)
        usable = _solve_once(r, program, search, dual)
        if relax(r, problem, terms, program, usable):
            if usable and search.left == search.budget:
                r.kept_iterations = 1  # the exchange alone has led to a limit
            usable = give_way(r, problem, terms, program, _solve_once(r, program, search, dual))
            if usable:
                usable = _solve_once(r, program, search, dual)
            usable = settle(r, terms, program, usable)
        return finish(r, problem, terms, program, usable, q, v)

    @kernel
    def qp_step_of_one(
        r: ProgramTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
    ) -> int:
        """A tick of the whole-body QP on one record; returns its status."""
        return qp_step(
            r.control, target, q, v, foot_force, r.problem, r.terms, r.program, r.search, r.dual
        )

    @kernel
    def targets(
        r: WholeBodyTargetsRecord, m: ContactMapRecord, usable: bool, q: Vector, v: Vector
    ) -> None:
        if usable:
            read_acceleration(m, r.z, r.motors.acceleration)
        add_lacking(r.motors, r.targets.held, r.motors.acceleration, usable, v, r.torque)
        move_targets(r.motors, r.motors.acceleration, usable, q, v)

    @kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
    def step_with_targets(
        r: WholeBodyTargetsRecord,
        target: GaitTargetRecord,
        q: Vector,
        v: Vector,
        foot_force: Vector,
        problem: FormulationRecord,
        terms: ContactMapRecord,
        program: ProgramRecord,
        search: ActiveSetRecord,
        dual: DualRecord,
    ) -> int:
        status = qp_step(r, target, q, v, foot_force, problem, terms, program, search, dual)
        if r.verdict == GOOD:
            targets(r, terms, status == 0, q, v)
        else:
            keep_targets(r, r.motors)
        return status

    @kernel
    def step_of_one_with_targets(
        r: ProgramTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
    ) -> int:
        return step_with_targets(
            r.control, target, q, v, foot_force, r.problem, r.terms, r.program, r.search, r.dual
        )

    phases = (open_tick, relax, give_way, settle, finish, targets)
    return TickKernels(
        qp_step, qp_step_of_one, *phases, step_with_targets, step_of_one_with_targets
    )


QP_TICKS: dict[str, TickKernels] = {name: tick_of(name) for name in FORMULATIONS}
"""The tick by formulation."""
