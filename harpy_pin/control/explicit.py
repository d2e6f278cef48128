"""The explicit whole-body controller: gait → tasks → law in contact forces, in one compiled call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from math import isfinite
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin.control.base import GaitController
from harpy_pin.control.settings import WholeBodyParameters
from harpy_pin.control.tasks import task_record, task_targets
from harpy_pin.explicit.law import ExplicitLaw, LawStatus, law
from harpy_pin.gait.base import Gait
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import BAD, GOOD
from harpy_pin.model.record import field
from harpy_pin.model.state import Command, State
from harpy_pin.wbc.settings import WholeBodyTargets

__all__ = ["ExplicitController"]

_CLIPPED = int(LawStatus.TORQUE_CLIPPED)


class ExplicitController(GaitController):
    """Walks by the optimum in contact forces; the tasks are those of :class:`WholeBodyController`.

    Args:
        gait: where body and feet should be.
        parameters: gains, weights and limits; formulation, solver and reuse do not enter.

    Attributes:
        law: of the last tick, with its forces and status.
        clipped: ticks whose torques had to be clipped, since the last reset.
    """

    def __init__(self, gait: Gait, parameters: WholeBodyParameters | None = None) -> None:
        self.parameters = p = parameters if parameters is not None else WholeBodyParameters()
        super().__init__(gait, p.period)
        self.dynamics = Dynamics(self.robot)
        self.law = ExplicitLaw(self.robot, p.weights, p.limits)
        self.targets = WholeBodyTargets(self.robot)
        self.clipped = 0
        self._tasks = task_record(gait, p)
        self._status = field(self.law.record, "status_and_systems")
        self._reference = np.zeros(6)
        thrusts = 3 * len(self.robot.thrusters)
        self._command = Command(self.law.inputs[thrusts:], self.law.inputs[:thrusts].reshape(-1, 3))

    def reset(self) -> None:
        """Forget the active sets."""
        super().reset()
        self.law.reset()
        self.clipped = 0

    def _phases(self, state: State) -> Command:
        self.prepare(state)
        return self.act(state)

    def prepare(self, state: State) -> None:
        """Targets of the gait, and the robot's dynamics at the state."""
        if isfinite(state.t):
            self.target = self.gait.update(state.t)
        self.dynamics.update(state.q, state.v)

    def act(self, state: State) -> Command:
        """Tasks, law, torques and thrusts; for a bad sample the last good command."""
        verdict = BAD
        if self.dynamics.finite and isfinite(state.t):
            verdict = _tick(
                self.dynamics.record,
                self.target.record,
                self._tasks,
                self.targets.record,
                self.law.record,
                state.q,
                state.v,
                state.foot_force,
            )
        if verdict == GOOD:
            self._bad_in_a_row = 0
            if self._status[0] & _CLIPPED:
                self.clipped += 1
        else:
            self._answer_bad(verdict, state)
        return self._command

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
        }

    def describe(self) -> Mapping[str, Any]:
        """Gait, gains, weights and limits."""
        return {"gait": dict(self.gait.describe()), "control": asdict(self.parameters)}


@njit(cache=True)
def _tick(dynamics, gait, tasks, targets, record, q, v, foot_force):  # type: ignore[no-untyped-def]
    """Task accelerations, then the law; returns what the state is."""
    verdict = task_targets(dynamics, gait, tasks, targets, q, v, foot_force)
    if verdict == GOOD:
        law(dynamics[0], targets[0], record[0], v, tasks[0].rotation)
    return verdict
