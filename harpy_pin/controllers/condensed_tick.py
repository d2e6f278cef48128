"""The tick of the condensed whole-body controller: one kernel for the library, its loop in C, and
the exported C.
"""

from __future__ import annotations

from harpy_pin.controllers.friction import note_inputs
from harpy_pin.controllers.tasks import TasksRecord, forces_in_world, task_terms
from harpy_pin.controllers.tick import BAD_SAMPLE, TickRecord, write_inputs
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.entry import GOOD
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import write_thrusts
from harpy_pin.wbc.condensed.solve import CondensedRecord, hold_last, solve_condensed


class CondensedTasksRecord(TasksRecord):
    """Tasks, and the optimum in contact forces."""

    condensed: CondensedRecord  # what that knows and works in


class CondensedTickRecord(CondensedTasksRecord, TickRecord):
    """The condensed whole-body controller."""


@kernel(
    v="r.dynamics.bias", foot_force="r.targets.feet"
)  # arrays of the record that have the same shape
def condensed_step(
    r: CondensedTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> int:
    """A tick: terms, tasks, optimum, command, of the measured q (nq,), v (nv,) and forces on the
    feet (feet, 3), N.

    Returns the status: :class:`~harpy_pin.wbc.condensed.CondensedStatus`, or ``BAD_SAMPLE``.
    """
    d, optimum = r.dynamics, r.condensed
    r.verdict = task_terms(r, target, q, v, foot_force)
    if r.verdict == GOOD:
        optimum.configuration[:] = q
        solve_condensed(d, r.targets, optimum, v)
        finish_optimum(r)
        write_thrusts(d, optimum.inputs, r.thrust)
    write_inputs(r, optimum.inputs, d.rotor_axis.shape[0] > 0)
    return optimum.status_and_steps[0] if r.verdict == GOOD else BAD_SAMPLE


@kernel
def finish_optimum(r: CondensedTasksRecord) -> None:
    """Forces in world axes, and what the next tick needs."""
    forces_in_world(r.targets, r.condensed.force)
    hold_last(r.condensed)
    note_inputs(r.joint_friction, r.condensed.inputs)
