"""The condensed whole-body controller: gait → tasks → program in the contact forces, in one compiled call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin.compiled import kernel
from harpy_pin.controllers.contacts import forces_in_world
from harpy_pin.controllers.gait_controller import GaitController, make_command
from harpy_pin.controllers.joint_friction import note_inputs
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.tasks import CondensedTasksRecord, Tasks, governed_gait, task_terms
from harpy_pin.controllers.thrust_lag import (
    ThrustLagRecord,
    add_kept,
    advance_thrusts,
    bound_thrusts,
    command_thrusts,
    count_from_kept,
    keep_thrusts,
    thrust_lag_record,
)
from harpy_pin.errors import InputError
from harpy_pin.gaits.foothold_governor import GovernedGait, note_gap
from harpy_pin.gaits.gait import LONGEST, Gait, GaitTargetRecord
from harpy_pin.model.entry import BAD, GOOD
from harpy_pin.model.record import Records, field
from harpy_pin.model.rotor import write_thrusts
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.simulation.ticks import CompiledTick, note_array
from harpy_pin.wbc.condensed.condensed_record import condensed_record
from harpy_pin.wbc.condensed.condensed_solver import CondensedSolver, hold_last, solve_condensed

__all__ = ["CondensedController"]


class CondensedController(GaitController):
    """Walks by the optimum in contact forces; the tasks are those of :class:`WholeBodyController`.

    Where no forces in the cones are within reach of the motors, the last command is held for ``hold_ticks`` ticks, as
    :class:`WholeBodyController` holds it where its program has no solution; then the torques are clipped.

    Args:
        gait: where body and feet should be.
        parameters: gains, weights and limits; ``formulation``, ``solver`` and ``reuse`` are not used.

    Attributes:
        solver: the program of the last tick, with its forces and status.
        command: arrays of the torques and thrusts of the last tick, overwritten by the next.
    """

    def __init__(self, gait: Gait, parameters: WholeBodyParameters | None = None) -> None:
        self.parameters = p = parameters if parameters is not None else WholeBodyParameters()
        super().__init__(governed_gait(gait, p), p.period)
        record = condensed_record(self.robot, p.weights, p.limits, hold_ticks=p.hold_ticks)
        self.tasks = Tasks(self.gait, p, condensed=record)
        self.dynamics, self.targets = self.tasks.dynamics, self.tasks.targets
        self.solver = CondensedSolver(self.robot, p.weights, p.limits, record=self.tasks.record["condensed"])
        self._governor = self.gait if isinstance(self.gait, GovernedGait) else None
        self._gap = np.zeros(4) if self._governor is None else self._governor.gap
        self._status = field(self.solver.record, "status_and_systems")
        self._clipped = field(self.solver.record, "clipped")
        self._reference = np.zeros(6)
        self._lag = thrust_lag_record(self.robot, p)
        self._command = make_command(self.dynamics, self.solver.inputs, apart=self._lag is not None)
        self.command = (self._command.torque, self._command.thrust)
        given = (self.tasks.record, self.target.record, *self.tasks.samples, self._gap, self._command.thrust)
        if self._lag is None:
            _tick.prepare(*given)
        else:
            advance_thrusts.prepare(self._lag)
            _tick_with_lag.prepare(self._lag, *given)

    def reset(self) -> None:
        """Forget the active sets, and the changes of the gait."""
        super().reset()
        self.solver.reset()
        self.tasks.reset()
        if self._governor is not None:
            self._governor.reset()
        self._clipped[:] = 0
        if self._lag is not None:
            self._lag["settled"] = 0

    @property
    def clipped(self) -> int:
        """Ticks in which no forces in the cones were within reach of the motors, since the last reset."""
        return int(self._clipped[0])

    @property
    def compiled(self) -> tuple[CompiledTick, CompiledTick] | None:
        """The gait's tick and the controller's own for a compiled loop, where the gait has one."""
        gait: CompiledTick | None = getattr(self.gait, "compiled", None)
        if type(self) is not CondensedController or gait is None:
            return None
        if self._observe is not None and gait.observe is None:
            return None
        if self.parameters.estimate_joint_friction or self._lag is not None:
            return None  # signals or ticks are Python's
        estimate = () if self.tasks.friction is None else ("friction_estimate",)
        signals = (
            "x_r",
            "stance",
            "held",
            "desired_force",
            "condensed_status",
            "law_systems",
            "bad_samples",
            *estimate,
        )
        parts = (self.tasks.record, self.target.record, self._gap, self._command.thrust, np.array([self.bad_samples]))
        return gait, CompiledTick(_act, _note, parts, signals)

    def add(self, task: object, **_: object) -> NoReturn:
        """Refuse a task that :meth:`WholeBodyController.add` takes.

        Args:
            task: any.

        Raises:
            InputError: always.
        """
        raise InputError(
            "the condensed controller has no place for added tasks: its cost is that of body, swing feet, thrusts and "
            "contact forces alone. make_controller('wbc', ...).add takes them",
            name="task",
            value=task,
        )

    def _phases(self, state: State) -> Command:
        """Targets of the gait; then terms, tasks, forces, torques and thrusts in one call."""
        verdict = BAD
        if self._lag is not None:
            advance_thrusts(self._lag)
        if -LONGEST < state.t < LONGEST:
            target = self._plan(state)
            samples = (state.q, state.v, state.foot_force)
            given = (self.tasks._record_, target._record_, *samples, self._gap, self._command.thrust)
            verdict = _tick(*given) if self._lag is None else _tick_with_lag(self._lag, *given)
        if verdict == GOOD:
            self._bad_in_a_row = 0
        else:
            self._answer_bad(verdict, state)
        return self._command

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """x_r, planned and held feet, the program's forces, and its status."""
        self._reference[:] = self.target.body[:6]
        return {
            "x_r": self._reference,
            "stance": self.target.stance,
            "held": self.targets.held,
            "desired_force": self.solver.force,
            "condensed_status": int(self._status[0]),
            "law_systems": int(self._status[1]),
            "bad_samples": self.bad_samples,
            **self.tasks.telemetry(),
            **self._gait_signals(),
        }

    def describe(self) -> Mapping[str, Any]:
        """Gait, gains, weights and limits."""
        return {"gait": dict(self.gait.describe()), "control": asdict(self.parameters)}


@kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
def _tick(
    r: CondensedTasksRecord,
    gait: GaitTargetRecord,
    q: Vector,
    v: Vector,
    foot_force: Vector,
    gap: Vector,
    thrust: Vector,
) -> int:
    """Terms, tasks and optimum; returns what the state is."""
    verdict = task_terms(r, gait, q, v, foot_force)
    if verdict == GOOD:
        d, p = r.dynamics, r.condensed
        solve_condensed(d, r.targets, p, v, d.tree.rotation)
        _finish(r, gap)
        write_thrusts(d, p.inputs, thrust)
    return verdict


@kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
def _tick_with_lag(
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
        _finish(r, gap)
    return verdict


@kernel
def _finish(r: CondensedTasksRecord, gap: Vector) -> None:
    """Forces in world axes, the acceleration that the optimum leaves undone, and what the next tick needs."""
    p = r.condensed
    forces_in_world(r.targets, p.force)
    note_gap(p.desired, p.root.acceleration, r.dynamics.tree.rotation, gap)
    hold_last(p)
    note_inputs(r.joint_friction, p.inputs)


@kernel
def _act(
    parts: tuple[Records[CondensedTasksRecord], Records[GaitTargetRecord], Vector, Vector, NDArray[np.int64]],
    q: Vector,
    v: Vector,
    foot_force: Vector,
) -> int:
    """The tick in a compiled loop."""
    record, gait, gap, thrust, _ = parts
    return _tick(record[0], gait[0], q, v, foot_force, gap, thrust)


@kernel
def _note(
    parts: tuple[Records[CondensedTasksRecord], Records[GaitTargetRecord], Vector, Vector, NDArray[np.int64]],
    row: Vector,
    places: NDArray[np.int64],
    s: int,
) -> int:
    """The signals of :meth:`CondensedController.telemetry`."""
    record, gait, _, _, bad_samples = parts
    r, p = record[0], record[0].condensed
    note_array(gait[0].body[:6], row, places[s])
    note_array(gait[0].stance, row, places[s + 1])
    note_array(r.targets.held, row, places[s + 2])
    note_array(p.force, row, places[s + 3])
    row[places[s + 4]] = p.status_and_systems[0]
    row[places[s + 5]] = p.status_and_systems[1]
    row[places[s + 6]] = bad_samples[0]
    if r.friction.on:
        note_array(r.friction.estimate, row, places[s + 7])
        return s + 8
    return s + 7
