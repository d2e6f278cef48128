"""The tick of the condensed whole-body controller: one kernel for the library, its loop in C, and the exported C."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.controllers.contacts import forces_in_world
from harpy_pin.controllers.joint_friction import note_inputs
from harpy_pin.controllers.tasks import TasksRecord, task_terms
from harpy_pin.controllers.thrust_lag import (
    ThrustLagRecord,
    add_kept,
    advance_thrusts,
    bound_thrusts,
    command_thrusts,
    count_from_kept,
    keep_thrusts,
)
from harpy_pin.controllers.tick import BAD_SAMPLE, TickRecord, write_inputs
from harpy_pin.model.entry import GOOD
from harpy_pin.model.rotor import write_thrusts
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.condensed_solver import hold_last, solve_condensed

if TYPE_CHECKING:
    from harpy_pin.gaits.gait import GaitTargetRecord
    from harpy_pin.wbc.condensed.condensed_solver import CondensedRecord

__all__ = ["CondensedTasksRecord", "CondensedTickRecord", "LaggedTickRecord"]


class CondensedTasksRecord(TasksRecord):
    """Tasks, and the optimum in contact forces."""

    condensed: CondensedRecord  # what that knows and works in


class CondensedTickRecord(CondensedTasksRecord, TickRecord):
    """The condensed whole-body controller."""


class LaggedTickRecord(CondensedTickRecord):
    """The condensed whole-body controller of a robot whose thrusts lag."""

    lag: ThrustLagRecord  # what is known of them


@kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
def condensed_step(r: CondensedTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector) -> int:
    """A tick: terms, tasks, optimum, command.

    Args:
        r: element of the controller's record.
        target: of the gait at this time.
        q: (nq,) as measured.
        v: (nv,) as measured.
        foot_force: (feet, 3) as measured, N.

    Returns:
        The status: :class:`~harpy_pin.wbc.condensed.CondensedStatus`, or ``BAD_SAMPLE``.
    """
    d, p = r.dynamics, r.condensed
    r.verdict = task_terms(r, target, q, v, foot_force)
    if r.verdict == GOOD:
        solve_condensed(d, r.targets, p, v, d.tree.rotation)
        _finish(r)
        write_thrusts(d, p.inputs, r.thrust)
    write_inputs(r, p.inputs, d.rotor_axis.shape[0] > 0)
    return _status(r)


@kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
def lagged_step(r: LaggedTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector) -> int:
    """The tick with thrusts that lag: the optimum twice, for the command, and for the thrusts that there are."""
    d, p, lag = r.dynamics, r.condensed, r.lag
    advance_thrusts(lag)
    r.verdict = task_terms(r, target, q, v, foot_force)
    if r.verdict == GOOD:
        keep_thrusts(lag, d.tree.rotation)
        bound_thrusts(lag, False, p.input_lower, p.input_upper)
        count_from_kept(lag, d, 1.0)
        solve_condensed(d, r.targets, p, v, d.tree.rotation)
        command_thrusts(lag, d, p.inputs, r.thrust)
        bound_thrusts(lag, True, p.input_lower, p.input_upper)
        p.inputs[:] = p.last_inputs
        solve_condensed(d, r.targets, p, v, d.tree.rotation)
        add_kept(lag, p.inputs)
        count_from_kept(lag, d, -1.0)
        _finish(r)
    write_inputs(r, p.inputs, True)
    return _status(r)


@kernel
def _finish(r: CondensedTasksRecord) -> None:
    """Forces in world axes, and what the next tick needs."""
    forces_in_world(r.targets, r.condensed.force)
    hold_last(r.condensed)
    note_inputs(r.joint_friction, r.condensed.inputs)


@kernel
def _status(r: CondensedTickRecord) -> int:
    """Status of the tick."""
    return r.condensed.status_and_systems[0] if r.verdict == GOOD else BAD_SAMPLE
