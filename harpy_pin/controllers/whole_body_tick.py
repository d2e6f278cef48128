"""The tick of the whole-body QP, in every formulation.

A tick solves up to three programs: with limits of thrusts and torques; where one of them is
reached, without them; and again with them, after tasks gave way (:mod:`harpy_pin.wbc.giving_way`).
``go_on`` says after each solution whether another program follows. One kernel is a tick with this
library's own search (:mod:`harpy_pin.wbc.active_set_warm_start`); with another solver Python calls
its parts, and that solver between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from harpy_pin.controllers.joint_targets import MotorsTickRecord, set_law
from harpy_pin.controllers.tasks import forces_in_world
from harpy_pin.controllers.tick import BAD_SAMPLE, FALLBACK, TaskTickRecord
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.contact_map import ContactMapRecord
from harpy_pin.model.record import ZERO, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import write_thrusts
from harpy_pin.wbc.active_set import ActiveSetRecord, DualRecord, ProgramRecord
from harpy_pin.wbc.active_set_warm_start import INACCURATE, solve_further, start_tick
from harpy_pin.wbc.formulations import FORMULATIONS
from harpy_pin.wbc.giving_way import at_a_limit, outside
from harpy_pin.wbc.problem import FormulationRecord

STIFFNESS, DAMPING = 50.0, 1.0
"""Stiffness and damping of the joints where the program has no solution for long, N·m/rad and
N·m·s/rad.
"""
LIMITED, FREE, GAVE_WAY = range(3)
"""Programs of a tick: with limits, without them, and with them after tasks gave way."""


class WholeBodyTickRecord(TaskTickRecord):
    """The whole-body QP."""

    # (thrust variables + joints,) [u; τ] of a solution, and of one without limits, N and N·m
    solved: Vector = sized("thrusts + joints")
    unlimited: Vector = sized("thrusts + joints")
    force: Vector = sized("3 feet")  # contact forces of the solution, world axes, N
    acceleration: Vector  # (nv,) that it brings about; (0,) where nobody follows that
    z: Vector  # (size,) solution
    found: Vector  # (size,) work space for that of the dual method
    kept: Vector  # (size,) a solution with limits, while one without is looked for
    program: int = ZERO  # which one was solved last
    gives_way: int  # whether tasks may give way
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
    # ticks in which the dual method followed the solver, since the last reset
    fallbacks: int = ZERO


class ProgramMotorsRecord(MotorsTickRecord, WholeBodyTickRecord):
    """The whole-body QP, with joint targets."""


@kernel
def solve_once(
    r: WholeBodyTickRecord, qp: ProgramRecord, search: ActiveSetRecord, dual: DualRecord
) -> None:
    """Solve one program of the tick by this library's own search, and say how."""
    if r.program == FREE and r.kept_outcome <= INACCURATE and search.left == search.budget:
        r.kept_iterations = 1  # the exchange alone has led to a limit
    r.outcome = solve_further(qp, search, dual, r.z, r.found)
    r.iterations, r.violation = search.iterations, search.violation


@kernel
def hold(r: WholeBodyTickRecord, q: Vector, v: Vector) -> None:
    """Without a solution the last command for a while, then a soft spring without thrust."""
    first = r.inputs.shape[0] - r.posture.shape[0]
    r.failures += 1
    r.held_for += 1
    if r.held_for > r.hold_ticks:
        r.inputs[:first] = 0.0
        spring = STIFFNESS * (r.posture - q[7:]) - DAMPING * v[6:]
        r.inputs[first:] = np.clip(spring, -r.torque_limit, r.torque_limit)
        r.thrust[:] = 0.0


@kernel
def write_solved_thrust(
    r: WholeBodyTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The stage after a solution that is usable: its thrusts are those of the command."""
    if r.status == 0:
        write_thrusts(r.dynamics, r.inputs, r.thrust)


@kernel
def set_program_law(
    r: ProgramMotorsRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The stage that closes a tick where motors have a law."""
    set_law(r, r.acceleration, r.status == 0, q, v)


@dataclass(frozen=True)
class ProgramKernels:
    """What a formulation does in a tick."""

    build: Kernel[None]  # the first program of a tick: (r, p, m, qp, v)
    go_on: Kernel[bool]  # after each solution, whether another program follows: (r, p, m, qp)
    finish: Kernel[None]  # inputs, forces and status of the last one: (r, p, m, qp, q, v)


def program_of(formulation: str) -> ProgramKernels:
    """The kernels in a formulation."""
    kernels = FORMULATIONS[formulation].kernels
    fill, read, read_force = kernels.build, kernels.inputs, kernels.force
    limit, let_give_way, read_acceleration = kernels.limit, kernels.give_way, kernels.acceleration

    @kernel
    def build(
        r: WholeBodyTickRecord,
        p: FormulationRecord,
        m: ContactMapRecord,
        qp: ProgramRecord,
        v: Vector,
    ) -> None:
        fill(r.dynamics, r.targets, p, m, qp, v, r.dynamics.tree.rotation)
        r.program = LIMITED

    @kernel
    def go_on(
        r: WholeBodyTickRecord, p: FormulationRecord, m: ContactMapRecord, qp: ProgramRecord
    ) -> bool:
        usable = r.outcome <= INACCURATE
        if r.program == LIMITED:
            if usable:
                read(m, qp, r.z, r.solved)
            if r.gives_way == 0 or p.give_way == 1.0 or (usable and not at_a_limit(r.solved, p)):
                return False
            r.kept[:] = r.z
            r.kept_outcome, r.kept_iterations = r.outcome, r.iterations
            r.kept_violation = r.violation
            limit(p, m, qp, False)
            r.program = FREE
            return True
        if r.program == FREE:
            beyond = False
            if usable:
                read(m, qp, r.z, r.unlimited)
                first = r.unlimited.shape[0] - p.torque_limit.shape[0]
                beyond = outside(r.unlimited[first:], p.input_lower[first:], p.input_upper[first:])
            limit(p, m, qp, True)
            if beyond:
                let_give_way(r.dynamics, r.targets, p, m, qp, r.z)
                r.program = GAVE_WAY
                return True
        elif usable:
            read(m, qp, r.z, r.solved)
            return False
        r.z[:] = r.kept
        r.outcome, r.iterations, r.violation = r.kept_outcome, r.kept_iterations, r.kept_violation
        return False

    @kernel
    def finish(
        r: WholeBodyTickRecord,
        p: FormulationRecord,
        m: ContactMapRecord,
        qp: ProgramRecord,
        q: Vector,
        v: Vector,
    ) -> None:
        read_force(p, m, qp, r.z, r.force)
        forces_in_world(r.targets, r.force)
        if r.outcome <= INACCURATE:
            r.status = r.held_for = 0
            r.inputs[:] = r.solved
            if r.acceleration.shape[0] > 0:
                read_acceleration(m, r.z, r.acceleration)
        else:
            r.status = FALLBACK
            hold(r, q, v)

    return ProgramKernels(build, go_on, finish)


PROGRAMS: dict[str, ProgramKernels] = {name: program_of(name) for name in FORMULATIONS}
"""By formulation."""


@cache
def open_program(formulation: str, opening: Kernel[int]) -> Kernel[int]:
    """What comes before the first solution in a formulation: the kernel that opens a tick, and the
    program.
    """
    build = PROGRAMS[formulation].build

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
        if opening(r, target, q, v, foot_force) != BAD_SAMPLE:
            build(r, p, m, qp, v)
        return r.status

    return open_tick


@cache
def program_tick(formulation: str, opening: Kernel[int], closing: Kernel[int]) -> Kernel[int]:
    """A tick in a formulation with this library's own search, between the kernels that open and
    close it.
    """
    begin, kernels = open_program(formulation, opening), PROGRAMS[formulation]
    go_on, finish = kernels.go_on, kernels.finish

    @kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
    def tick(
        r: WholeBodyTickRecord,
        target: GaitTargetRecord,
        q: Vector,
        v: Vector,
        foot_force: Vector,
        p: FormulationRecord,
        m: ContactMapRecord,
        qp: ProgramRecord,
        search: ActiveSetRecord,
        dual: DualRecord,
    ) -> int:
        """A tick of the whole-body QP; returns its status."""
        if begin(r, target, q, v, foot_force, p, m, qp) != BAD_SAMPLE:
            start_tick(search)
            solve_once(r, qp, search, dual)
            while go_on(r, p, m, qp):
                solve_once(r, qp, search, dual)
            finish(r, p, m, qp, q, v)
        return closing(r, target, q, v, foot_force)

    return tick
