"""A tick of the whole-body controller in one call, where the last active set or its exchange ends with the optimum.

It does what the phases of :class:`~harpy_pin.controllers.whole_body.WholeBodyController` do one after the other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from harpy_pin.compiled import Kernel, kernel
from harpy_pin.controllers.tasks import TasksRecord, task_terms
from harpy_pin.model.entry import GOOD
from harpy_pin.model.record import Records
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set_warm_start import EXCHANGES, ActiveSetRecord, exchange
from harpy_pin.wbc.condensed.contact_force import build_force, force_inputs
from harpy_pin.wbc.giving_way import at_a_limit
from harpy_pin.wbc.input_space import build_inputs, first_variables, give_way_to_inputs, limit_inputs

if TYPE_CHECKING:
    from harpy_pin.gaits.gait import GaitTargetRecord
    from harpy_pin.wbc.problem import ProblemRecord
    from harpy_pin.wbc.program import ProgramRecord

__all__ = ["AT_A_LIMIT", "FORMULATION_KERNELS", "GIVING_WAY_KERNELS", "TICKS"]

AT_A_LIMIT = EXCHANGES + 2
"""What a tick returns where a thrust or torque is at its limit, so that tasks may have to give way."""

FORMULATION_KERNELS = {"input_space": (build_inputs, first_variables), "contact_force": (build_force, force_inputs)}
"""By formulation: the kernels that build the program and that read the inputs off its solution."""

GIVING_WAY_KERNELS = {"input_space": (limit_inputs, give_way_to_inputs)}
"""By formulation, where tasks give way: the kernels that limit thrusts and torques, and that change the tasks."""


def _tick_of(build: Kernel[None], read: Kernel[None]) -> Kernel[int]:
    """The tick of a formulation."""

    @kernel
    def tick(
        tasks: Records[TasksRecord],
        gait: Records[GaitTargetRecord],
        problem: Records[ProblemRecord],
        terms: Records[Any],
        program: Records[ProgramRecord],
        search: Records[ActiveSetRecord],
        q: Vector,
        v: Vector,
        foot_force: Vector,
        z: Vector,
        inputs: Vector,
    ) -> int:
        """Systems solved, more than ``EXCHANGES`` where the search did not end or as ``AT_A_LIMIT`` says; negative what
        a bad state is."""
        r, p, qp = tasks[0], problem[0], program[0]
        verdict = task_terms(r, gait[0], q, v, foot_force)
        if verdict != GOOD:
            return -verdict
        build(r.dynamics, r.targets, p, terms[0], qp, v, r.dynamics.tree.rotation)
        systems, p.violation = exchange(qp, search[0], z)
        if systems <= EXCHANGES:
            read(terms[0], z, inputs)
            if at_a_limit(inputs, p):
                return AT_A_LIMIT
        return systems

    return tick


TICKS: dict[str, Kernel[int]] = {name: _tick_of(*kernels) for name, kernels in FORMULATION_KERNELS.items()}
"""By formulation."""
