"""What the condensed controller and the whole-body QP share: the tasks of a gait, and estimates of friction."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from harpy_pin.controllers.friction_estimator import FrictionEstimator
from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.tasks import TasksRecord, tasks_record
from harpy_pin.gaits.gait import Gait
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.record import field
from harpy_pin.wbc.weights import WholeBodyTargets

__all__ = ["TaskController"]


class TaskController(GaitController):
    """A whole-body controller.

    Args:
        gait: where body and feet should be.
        parameters: gains, weights and limits.

    Attributes:
        dynamics: terms at the last state.
        targets: tasks of the last state.
    """

    parameters: WholeBodyParameters

    def __init__(self, gait: Gait, parameters: WholeBodyParameters | None) -> None:
        p = parameters if parameters is not None else WholeBodyParameters()
        super().__init__(gait, p)
        expect_lag = getattr(self.gait, "expect_lag", None)
        if expect_lag is not None:  # a gait that flies
            expect_lag(p.thrust_lag)

    def _begin_tasks(self, kind: type[TasksRecord], **parts: ArrayLike) -> None:
        """Make the record of the controller, and take it up; see :func:`tasks_record`."""
        record: Any = tasks_record(self.gait, self.parameters, kind, **parts)
        self.dynamics = Dynamics(self.robot, record=record["dynamics"])
        self.targets = WholeBodyTargets(self.robot, record=record["targets"])
        self._begin(record)
        self._signals["held"] = self.targets.held
        self._friction: FrictionEstimator | None = None
        if self.parameters.estimate_friction:
            self._friction = FrictionEstimator(assumed=self.parameters.limits.mu, record=record["friction"])
            self._signals["friction_estimate"] = self._friction.estimate
        if self.parameters.estimate_joint_friction:
            for name in ("viscous", "coulomb"):
                self._signals[f"{name}_estimate"] = field(record["joint_friction"], name)

    def reset(self) -> None:
        """Forget the last command, and the estimates of friction."""
        super().reset()
        for name in ("known", "inputs", "sums", "viscous", "coulomb"):
            self._record_["joint_friction"][name] = 0
        if self._friction is not None:
            self._friction.reset()
