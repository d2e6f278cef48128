"""The tick of the whole-body QP: one kernel for the library and the exported C, of the parts that its phases call.

It has every formulation, with this library's own solver: the last active set and its exchange, then the dual method
(:mod:`harpy_pin.wbc.active_set_warm_start`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import Kernel, kernel
from harpy_pin.controllers.joint_friction import note_inputs
from harpy_pin.controllers.tasks import TasksRecord, task_terms
from harpy_pin.controllers.tick import BAD_SAMPLE, FALLBACK, TickRecord, write_inputs
from harpy_pin.model.entry import GOOD
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.rotor import write_thrusts
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set_warm_start import (
    ASK,
    INACCURATE,
    INFEASIBLE,
    MAX_ITERATIONS,
    ActiveSetRecord,
    solve_further,
    start_tick,
)
from harpy_pin.wbc.condensed.contact_force import ContactForceRecord
from harpy_pin.wbc.dual import DualRecord
from harpy_pin.wbc.formulations import FORMULATIONS
from harpy_pin.wbc.giving_way import at_a_limit, beyond_torque_limit

if TYPE_CHECKING:
    from harpy_pin.gaits.gait import GaitTargetRecord
    from harpy_pin.model.contact_map import ContactMapRecord
    from harpy_pin.wbc.problem import FormulationRecord
    from harpy_pin.wbc.program import ProgramRecord

__all__ = ["EXPORTED_QP_STEPS", "QP_STEPS", "ProgramTickRecord", "WholeBodyTickRecord"]

STIFFNESS, DAMPING = 50.0, 1.0
"""Of the joints where the program has no solution for long, N·m/rad and N·m·s/rad."""


class WholeBodyTickRecord(TasksRecord, TickRecord):
    """The whole-body QP."""

    inputs: Vector = sized("thrusts + joints")  # (thrust variables + joints,) [u; τ] of the command, N and N·m
    unlimited: Vector = sized("thrusts + joints")  # (thrust variables + joints,) [u; τ] without limits, N and N·m
    kept: Vector  # (size,) a solution with limits, while one without is looked for
    outcome: int = ZERO  # of the program, a :class:`~harpy_pin.wbc.QPStatus`
    iterations: int = ZERO  # of the solver
    violation: float = 0.0  # of the solution
    posture: Vector  # (joints,) that the spring pulls to where there is no solution for long, rad
    torque_limit: Vector  # (joints,) of the motors, N·m
    hold_ticks: int  # ticks in a row for which the last inputs are held in the place of failed ones
    held_for: int = ZERO  # ticks in a row in which there was no solution
    failures: int = ZERO  # ticks in which there was none, since the last reset
    lagging: int = ZERO  # 1 where thrusts lag, so that the command's are not those of the inputs


class ProgramTickRecord(RecordOf):
    """The whole-body QP with its program and solver, in one record."""

    control: WholeBodyTickRecord  # tasks, inputs and command
    problem: FormulationRecord  # what the formulation knows
    # what it keeps of the last state: formulation ``input_space``, or ``contact_force``
    terms: ContactMapRecord | ContactForceRecord
    program: ProgramRecord  # the quadratic program
    search: ActiveSetRecord  # the last active set and its exchange
    dual: DualRecord  # the dual method, which starts without active constraints
    z: Vector = sized("size")  # solution
    found: Vector = sized("size")  # work space for that of the dual method


@kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
def begin_tick(r: WholeBodyTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector) -> int:
    """Terms and tasks; after a bad sample the last command stays, and fades. Returns what the sample is."""
    r.verdict = task_terms(r, target, q, v, foot_force)
    if r.verdict != GOOD:
        write_inputs(r, r.inputs, r.lagging != 0 or r.dynamics.rotor_axis.shape[0] > 0)
    return r.verdict


@kernel
def finish_tick(r: WholeBodyTickRecord, usable: bool, q: Vector, v: Vector) -> int:
    """The command of the inputs; without a solution the last one for a while, then a soft spring without thrust.

    Args:
        r: element of the controller's record; its inputs are new if there is a solution.
        usable: whether there is one.
        q: as measured.
        v: as measured.

    Returns:
        The status: 0, or ``FALLBACK``.
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
            for c in range(first):
                r.inputs[c] = 0.0
            for j in range(r.posture.shape[0]):
                u = STIFFNESS * (r.posture[j] - q[7 + j]) - DAMPING * v[6 + j]
                r.inputs[first + j] = min(max(u, -r.torque_limit[j]), r.torque_limit[j])
            for k in range(r.thrust.shape[0]):
                for i in range(3):
                    r.thrust[k, i] = 0.0
    note_inputs(r.joint_friction, r.inputs)
    write_inputs(r, r.inputs, True)
    return 0 if usable else FALLBACK


@kernel
def _solve_once(
    r: WholeBodyTickRecord, qp: ProgramRecord, search: ActiveSetRecord, dual: DualRecord, z: Vector, found: Vector
) -> bool:
    """Solve one program of the tick, and say how; returns whether there is a solution."""
    r.outcome = solve_further(qp, search, dual, z, found)
    r.iterations, r.violation = search.iterations, search.violation
    if r.outcome == ASK:
        search.active[:] = 0
        r.outcome = MAX_ITERATIONS if r.violation < np.inf else INFEASIBLE
    return r.outcome <= INACCURATE


def _solve_of(name: str) -> Kernel[bool]:
    """Kernel that solves the program of a formulation and reads the inputs off it; whether there is a solution."""
    kernels = FORMULATIONS[name].kernels
    read, limit, give_way = kernels.inputs, kernels.limit, kernels.give_way
    if limit is None or give_way is None:

        @kernel
        def solve(
            r: WholeBodyTickRecord,
            p: FormulationRecord,
            terms: ContactForceRecord,
            qp: ProgramRecord,
            search: ActiveSetRecord,
            dual: DualRecord,
            z: Vector,
            found: Vector,
        ) -> bool:
            start_tick(search)
            usable = _solve_once(r, qp, search, dual, z, found)
            if usable:
                read(terms, qp, z, r.inputs)
            return usable

        return solve

    @kernel
    def solve_giving_way(
        r: WholeBodyTickRecord,
        p: FormulationRecord,
        terms: ContactMapRecord,
        qp: ProgramRecord,
        search: ActiveSetRecord,
        dual: DualRecord,
        z: Vector,
        found: Vector,
    ) -> bool:
        """Where thrusts or torques are at their limits, tasks may give way (:mod:`harpy_pin.wbc.giving_way`).

        The solution with limits stays where torques are within them in the one without, or nothing else is found.
        """
        start_tick(search)
        usable = _solve_once(r, qp, search, dual, z, found)
        if usable:
            read(terms, qp, z, r.inputs)
            if p.give_way == 1.0 or not at_a_limit(r.inputs, p):
                return True
            if search.left == search.budget:
                r.iterations = 1  # the exchange has led to a limit, where another program may follow
        if p.give_way == 1.0:
            return usable
        outcome, iterations, violation = r.outcome, r.iterations, r.violation
        for c in range(z.shape[0]):
            r.kept[c] = z[c]
        limit(p, terms, qp, False)
        beyond = False
        if _solve_once(r, qp, search, dual, z, found):
            read(terms, qp, z, r.unlimited)
            beyond = beyond_torque_limit(r.unlimited[r.unlimited.shape[0] - p.torque_limit.shape[0] :], p.torque_limit)
        limit(p, terms, qp, True)
        if beyond:
            give_way(r.dynamics, r.targets, p, terms, qp, z)
            if _solve_once(r, qp, search, dual, z, found):
                read(terms, qp, z, r.inputs)
                return True
        r.outcome, r.iterations, r.violation = outcome, iterations, violation
        for c in range(z.shape[0]):
            z[c] = r.kept[c]
        return usable

    return solve_giving_way


def _step_of(name: str) -> tuple[Kernel[int], Kernel[int]]:
    """The tick of the whole-body QP in a formulation: on the records of its parts, and on one."""
    build, solve = FORMULATIONS[name].kernels.build, _solve_of(name)

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
        z: Vector,
        found: Vector,
    ) -> int:
        """A tick of the whole-body QP; returns its status."""
        if begin_tick(r, target, q, v, foot_force) != GOOD:
            return BAD_SAMPLE
        build(r.dynamics, r.targets, problem, terms, program, v, r.dynamics.tree.rotation)
        return finish_tick(r, solve(r, problem, terms, program, search, dual, z, found), q, v)

    @kernel
    def qp_step_of_one(r: ProgramTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector) -> int:
        """The same on one record."""
        parts = r.control
        return qp_step(parts, target, q, v, foot_force, r.problem, r.terms, r.program, r.search, r.dual, r.z, r.found)

    return qp_step, qp_step_of_one


_STEPS = {name: _step_of(name) for name in FORMULATIONS}
QP_STEPS: dict[str, Kernel[int]] = {name: steps[0] for name, steps in _STEPS.items()}
"""The tick by formulation, on the records of its parts."""
EXPORTED_QP_STEPS: dict[str, Kernel[int]] = {name: steps[1] for name, steps in _STEPS.items()}
"""The same on one record, a :class:`ProgramTickRecord`."""
