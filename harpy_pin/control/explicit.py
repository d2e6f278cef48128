"""The explicit whole-body controller: gait → tasks → law in contact forces, in one compiled call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from math import isfinite
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin.compiled import kernel
from harpy_pin.control.base import GaitController, make_command, spread_thrusts
from harpy_pin.control.settings import WholeBodyParameters
from harpy_pin.control.tasks import Tasks, governed_gait, task_terms
from harpy_pin.errors import InputError
from harpy_pin.explicit.law import ExplicitLaw, LawStatus, law, law_record
from harpy_pin.gait.base import Gait
from harpy_pin.governor.command import GovernedGait, note_gap
from harpy_pin.model.entry import BAD, GOOD
from harpy_pin.model.record import field
from harpy_pin.model.state import Command, State

__all__ = ["ExplicitController"]

_CLIPPED = int(LawStatus.TORQUE_CLIPPED)


class ExplicitController(GaitController):
    """Walks by the optimum in contact forces; the tasks are those of :class:`WholeBodyController`.

    Where no forces in the cones are within reach of the motors, the last command is held for ``hold_ticks`` ticks, as
    :class:`WholeBodyController` holds it where its program has no solution; then the torques are clipped.

    Args:
        gait: where body and feet should be.
        parameters: gains, weights and limits; formulation, solver and reuse do not enter.

    Attributes:
        law: of the last tick, with its forces and status.
        clipped: ticks without such forces, since the last reset.
    """

    def __init__(self, gait: Gait, parameters: WholeBodyParameters | None = None) -> None:
        self.parameters = p = parameters if parameters is not None else WholeBodyParameters()
        super().__init__(governed_gait(gait, p), p.period)
        self.tasks = Tasks(self.gait, p, law=law_record(self.robot, p.weights, p.limits))
        self.dynamics, self.targets = self.tasks.dynamics, self.tasks.targets
        self.law = ExplicitLaw(self.robot, p.weights, p.limits, record=self.tasks.record["law"])
        self.clipped = self._clipped_in_a_row = 0
        self._governor = self.gait if isinstance(self.gait, GovernedGait) else None
        self._gap = np.zeros(4) if self._governor is None else self._governor.gap
        self._status = field(self.law.record, "status_and_systems")
        self._last_inputs = field(self.law.record, "last_inputs")
        self._reference = np.zeros(6)
        self._command = make_command(self.dynamics, self.law.inputs)
        self._rotors = bool(self.robot.rotors)
        _tick.prepare(self.tasks.record, self.target.record, *self.tasks.samples, self._gap)
        # The first call of a kernel loads it: here, not in a tick. Forces of a foot too many make it do nothing.
        _tick(self.tasks.record, self.target.record, *self.tasks.misfit, self._gap)

    def reset(self) -> None:
        """Forget the active sets, and what was bent."""
        super().reset()
        self.law.reset()
        self.tasks.reset()
        if self._governor is not None:
            self._governor.reset()
        self.clipped = self._clipped_in_a_row = 0

    def add(self, task: object, **_: object) -> NoReturn:
        """Refuse a task that :meth:`WholeBodyController.add` takes.

        Args:
            task: any.

        Raises:
            InputError: always.
        """
        raise InputError(
            "the explicit law has no place for added tasks: its cost is that of body, swing feet, thrusts and contact "
            "forces alone. make_controller('wbc', ...).add takes them",
            name="task",
            value=task,
        )

    def _phases(self, state: State) -> Command:
        """Targets of the gait; then terms, tasks, law, torques and thrusts at once."""
        verdict = BAD
        if isfinite(state.t):
            target = self._plan(state)
            verdict = _tick(self.tasks.record, target.record, state.q, state.v, state.foot_force, self._gap)
        if verdict == GOOD:
            self._bad_in_a_row = 0
            if self._status[0] & _CLIPPED:
                self._hold()
            else:
                self._clipped_in_a_row = 0
            if self._rotors:
                spread_thrusts(self.dynamics, self.law.inputs, self._command)
        else:
            self._answer_bad(verdict, state)
        return self._command

    def _hold(self) -> None:
        """The last command in the place of clipped torques, for a while."""
        self.clipped += 1
        self._clipped_in_a_row += 1
        if self._clipped_in_a_row <= self.parameters.hold_ticks:
            self.law.inputs[:] = self._last_inputs

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """x_r, planned and held feet, the forces intended, and the law's status."""
        self._reference[:] = self.target.body[:6]
        return {
            "x_r": self._reference,
            "stance": self.target.stance,
            "held": self.targets.held,
            "wanted_force": self.law.force,
            "law_status": int(self._status[0]),
            "law_systems": int(self._status[1]),
            "bad_samples": self.bad_samples,
            **self.tasks.telemetry(),
            **self._gait_signals(),
        }

    def describe(self) -> Mapping[str, Any]:
        """Gait, gains, weights and limits."""
        return {"gait": dict(self.gait.describe()), "control": asdict(self.parameters)}


@kernel
def _tick(record, gait, q, v, foot_force, gap):  # type: ignore[no-untyped-def]
    """Terms and task accelerations, the law, and the gap that it leaves; returns what the state is."""
    r = record[0]
    verdict = task_terms(r, gait[0], q, v, foot_force)
    if verdict == GOOD:
        d, p = r.dynamics, r.law
        law(d, r.targets, p, v, d.tree.rotation)
        note_gap(p.wanted, p.root.acceleration, d.tree.rotation, gap)
    return verdict
