"""A tick of the whole-body controller in one call, where the last active set or its exchange ends with the optimum.

Each formulation has a kernel of its own, which does what the phases of
:class:`~harpy_pin.controllers.whole_body.WholeBodyController` do one after the other. It returns the systems solved,
more than ``EXCHANGES`` where the search came to no end, or what a bad state is, negative.
"""

from __future__ import annotations

from harpy_pin.compiled import Kernel, kernel
from harpy_pin.controllers.tasks import task_terms
from harpy_pin.model.entry import GOOD
from harpy_pin.wbc.active_set_warm_start import EXCHANGES, exchange
from harpy_pin.wbc.condensed.contact_force import build_force, force_inputs
from harpy_pin.wbc.input_space import build_command

__all__ = ["TICKS"]


@kernel
def _command(tasks, gait, problem, terms, program, search, q, v, foot_force, z, inputs):  # type: ignore[no-untyped-def]
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
def _force(tasks, gait, problem, terms, program, search, q, v, foot_force, z, inputs):  # type: ignore[no-untyped-def]
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
