"""The stages of the condensed whole-body controller's tick that find the optimum."""

from __future__ import annotations

from harpy_pin.controllers.tasks import TasksRecord, forces_in_world
from harpy_pin.controllers.tick import TaskTickRecord
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.solve import CondensedRecord, hold_last, solve_condensed


class CondensedTasksRecord(TasksRecord):
    """Tasks, and the optimum in contact forces."""

    condensed: CondensedRecord  # what that knows and works in


class CondensedTickRecord(TaskTickRecord, CondensedTasksRecord):
    """The condensed whole-body controller."""


@kernel
def find_optimum(
    r: CondensedTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The optimum of the tasks; it begins from the inputs of the last tick."""
    p = r.condensed
    p.configuration[:] = q
    p.inputs[:] = r.inputs
    solve_condensed(r.dynamics, r.targets, p, v)


@kernel
def take_optimum(
    r: CondensedTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """Its inputs and status, and its forces in world axes; clipped torques are held."""
    p = r.condensed
    forces_in_world(r.targets, p.force)
    hold_last(p)
    r.inputs[:] = p.inputs
    r.status = p.status_and_steps[0]
