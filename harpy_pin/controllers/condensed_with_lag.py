"""The condensed controller's tick where thrusts lag: two solves, see :mod:`harpy_pin.controllers.thrust_lag`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.controllers.contacts import forces_in_world
from harpy_pin.controllers.joint_friction import note_inputs
from harpy_pin.controllers.tasks import CondensedTasksRecord, task_terms
from harpy_pin.controllers.thrust_lag import (
    ThrustLagRecord,
    add_kept,
    bound_thrusts,
    command_thrusts,
    count_from_kept,
    keep_thrusts,
)
from harpy_pin.gaits.foothold_governor import note_gap
from harpy_pin.model.entry import GOOD
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.condensed_solver import hold_last, solve_condensed

if TYPE_CHECKING:
    from harpy_pin.gaits.gait import GaitTargetRecord

__all__: list[str] = []


@kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
def tick_with_lag(
    lag: ThrustLagRecord,
    r: CondensedTasksRecord,
    gait: GaitTargetRecord,
    q: Vector,
    v: Vector,
    foot_force: Vector,
    gap: Vector,
    thrust: Vector,
) -> int:
    """Terms, tasks, and the optimum twice: for the command, and for the thrusts that there are."""
    d, p = r.dynamics, r.condensed
    verdict = task_terms(r, gait, q, v, foot_force)
    if verdict == GOOD:
        keep_thrusts(lag, d.tree.rotation)
        bound_thrusts(lag, False, p.thrust_lower, p.thrust_upper)
        count_from_kept(lag, d, 1.0)
        solve_condensed(d, r.targets, p, v, d.tree.rotation)
        command_thrusts(lag, d, p.inputs, thrust)
        bound_thrusts(lag, True, p.thrust_lower, p.thrust_upper)
        p.inputs[:] = p.last_inputs
        solve_condensed(d, r.targets, p, v, d.tree.rotation)
        add_kept(lag, p.inputs)
        count_from_kept(lag, d, -1.0)
        forces_in_world(r.targets, p.force)
        note_gap(p.desired, p.root.acceleration, d.tree.rotation, gap)
        hold_last(p)
        note_inputs(r.joint_friction, p.inputs)
    return verdict
