"""The explicit whole-body controller: gait → tasks → law in contact forces, in one compiled call."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from math import isfinite
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from harpy_pin.control.bridge import Bridge
from harpy_pin.control.whole_body import WholeBodyParameters, gap_of, governed_gait, task_record, task_targets
from harpy_pin.errors import InputError
from harpy_pin.explicit.law import ExplicitLaw, LawStatus, law
from harpy_pin.gait.base import Gait, GaitTarget
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import BAD, GOOD, MISFIT, as_state
from harpy_pin.model.record import field
from harpy_pin.model.state import Command, State
from harpy_pin.wbc.settings import WholeBodyTargets

__all__ = ["ExplicitController"]

_CLIPPED = int(LawStatus.TORQUE_CLIPPED)


class ExplicitController:
    """Walks by the optimum in contact forces; the tasks are those of :class:`WholeBodyController`.

    Args:
        gait: where body and feet should be.
        parameters: gains, weights and limits; formulation, solver and reuse do not enter.

    Attributes:
        law: of the last tick, with its forces and status.
        clipped: ticks whose torques had to be clipped, since the last reset.
    """

    def __init__(self, gait: Gait, parameters: WholeBodyParameters | None = None) -> None:
        self.robot = gait.robot
        self.parameters = p = parameters if parameters is not None else WholeBodyParameters()
        self.gait, self._governor = governed_gait(gait, p)
        self._gap = np.zeros(4) if self._governor is None else self._governor.gap
        self.period = p.period
        self.dynamics = Dynamics(self.robot)
        self.law = ExplicitLaw(self.robot, p.weights, p.limits)
        self.targets = WholeBodyTargets(self.robot)
        self.target: GaitTarget = self.gait.target
        self.clipped = 0
        self._tasks = task_record(gait, p)
        self._status = field(self.law.record, "status_and_systems")
        self._reference = np.zeros(6)
        thrusts = 3 * len(self.robot.thrusters)
        self._command = Command(self.law.inputs[thrusts:], self.law.inputs[:thrusts].reshape(-1, 3))
        self._bridge = Bridge()
        self._convert = False  # whether states come in a form that kernels do not take

    @property
    def bad_samples(self) -> int:
        """States that were not all numbers, since the last reset."""
        return self._bridge.bad_samples

    def reset(self) -> None:
        """Forget the active sets, and what was bent."""
        self._bridge.reset()
        self.law.reset()
        if self._governor is not None:
            self._governor.reset()
        self.clipped = 0

    def step(self, state: State) -> Command:
        """One tick: joint torques and thrusts.

        Raises:
            InputError: an array of the state has the wrong shape, or no numbers.
        """
        if self._convert:
            state = as_state(state, self.robot)
        try:
            self.prepare(state)
            return self.act(state)
        except Exception:
            fit = as_state(state, self.robot)
            if fit is state:
                raise
            self._convert = True
        return self.step(fit)

    def prepare(self, state: State) -> None:
        """Targets of the gait, and the robot's dynamics at the state."""
        if isfinite(state.t):
            self.target = self.gait.update(state.t)
        self.dynamics.update(state.q, state.v)

    def act(self, state: State) -> Command:
        """Tasks, law, torques and thrusts; for a bad sample what :class:`~harpy_pin.control.bridge.Bridge` says."""
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
                self._gap,
            )
        if verdict == GOOD:
            self._bridge.in_a_row = 0
            if self._status[0] & _CLIPPED:
                self.clipped += 1
        elif verdict == MISFIT:
            as_state(state, self.robot)
            raise InputError("the gait's targets are no numbers", name="gait", value=self.gait)
        else:
            self._bridge.hold(self._command)
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
            **({} if self._governor is None else self._governor.telemetry()),
        }

    def describe(self) -> Mapping[str, Any]:
        """Gait, gains, weights and limits."""
        return {"gait": dict(self.gait.describe()), "control": asdict(self.parameters)}


@njit(cache=True)
def _tick(dynamics, gait, tasks, targets, record, q, v, foot_force, gap):  # type: ignore[no-untyped-def]
    """Task accelerations, the law, and the gap that it leaves; returns what the state is."""
    verdict = task_targets(dynamics, gait, tasks, targets, q, v, foot_force)
    if verdict == GOOD:
        p = record[0]
        law(dynamics[0], targets[0], p, v, tasks[0].rotation)
        gap_of(p.wanted, p.root.acceleration, tasks[0].rotation, gap)
    return verdict
