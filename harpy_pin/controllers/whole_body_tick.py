"""A tick of the whole-body controller in one call, where the last active set or its exchange ends with the optimum.

Each formulation has a kernel of its own, which does what the phases of
:class:`~harpy_pin.controllers.whole_body.WholeBodyController` do one after the other. It returns the systems solved,
more than ``EXCHANGES`` where the search came to no end, or what a bad state is, negative.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import Kernel, kernel
from harpy_pin.controllers.tasks import TasksRecord, task_terms
from harpy_pin.model.entry import GOOD
from harpy_pin.model.record import Records
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set_warm_start import EXCHANGES, ActiveSetRecord, exchange
from harpy_pin.wbc.condensed.contact_force import ContactForceRecord, build_force, force_inputs
from harpy_pin.wbc.input_space import build_command

if TYPE_CHECKING:
    from harpy_pin.gaits.gait import GaitTargetRecord
    from harpy_pin.model.contact_map import ContactMapRecord
    from harpy_pin.wbc.problem import ProblemRecord
    from harpy_pin.wbc.program import ProgramRecord

__all__ = ["TICKS"]


@kernel
def _command(
    tasks: Records[TasksRecord],
    gait: Records[GaitTargetRecord],
    problem: Records[ProblemRecord],
    terms: Records[ContactMapRecord],
    program: Records[ProgramRecord],
    search: Records[ActiveSetRecord],
    q: Vector,
    v: Vector,
    foot_force: Vector,
    z: Vector,
    inputs: Vector,
) -> int:
    r, p, qp = tasks[0], problem[0], program[0]
    verdict = task_terms(r, gait[0], q, v, foot_force)
    if verdict != GOOD:
        return -verdict
    build_command(r.dynamics, r.targets, p, terms[0], qp, v, r.dynamics.tree.rotation)
    systems, p.violation = exchange(qp, search[0], z)
    if systems <= EXCHANGES:
        for c in range(inputs.shape[0]):
            inputs[c] = z[c]
    return systems


@kernel
def _force(
    tasks: Records[TasksRecord],
    gait: Records[GaitTargetRecord],
    problem: Records[ProblemRecord],
    terms: Records[ContactForceRecord],
    program: Records[ProgramRecord],
    search: Records[ActiveSetRecord],
    q: Vector,
    v: Vector,
    foot_force: Vector,
    z: Vector,
    inputs: Vector,
) -> int:
    r, p, qp = tasks[0], problem[0], program[0]
    verdict = task_terms(r, gait[0], q, v, foot_force)
    if verdict != GOOD:
        return -verdict
    build_force(r.dynamics, r.targets, p, terms[0], qp, v, r.dynamics.tree.rotation)
    systems, p.violation = exchange(qp, search[0], z)
    if systems <= EXCHANGES:
        force_inputs(terms[0], z, inputs)
    return systems


TICKS: dict[str, Kernel[int]] = {"input_space": _command, "contact_force": _force}
"""By formulation."""
