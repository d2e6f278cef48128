"""What the condensed controller and the whole-body QP share: the tasks of a gait, and estimates of
friction.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.controllers.friction import (
    JointFrictionEstimateRecord,
    forget_friction,
    friction_record,
)
from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.controllers.joint_targets import joint_targets_record
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.tasks import TaskSettingsRecord, TasksRecord
from harpy_pin.gaits.gait import Gait
from harpy_pin.model.dynamics import Dynamics, dynamics_record
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.wbc.weights import WholeBodyTargets, joint_weights, targets_record

FEWEST_TICKS, FEWEST_ON_TWO = 8, 20
"""Ticks of a step, on more than two feet and on two, from which on eleven robots of twelve stood in
the compliant plant, at any period.
"""


def tasks_record(
    gait: Gait,
    parameters: WholeBodyParameters,
    kind: type[TasksRecord] = TasksRecord,
    **parts: ArrayLike,
) -> Records[TasksRecord]:
    """A new :class:`TasksRecord`, or one of another ``kind`` with further parts."""
    robot, p = gait.robot, checks.instance("parameters", parameters, WholeBodyParameters)
    lift, feet = robot.lift_axis, len(robot.feet)
    free = np.array([name == "arms" for name in joint_weights(robot)], dtype=bool)
    free &= robot.joint_lower < robot.joint_upper  # a file that names no limits has equal ones
    tasks = make_record(
        TaskSettingsRecord,
        body=p.body,
        orientation=p.orientation,
        swing=p.swing,
        posture=p.posture,
        contact_damping=min(p.contact_damping, 1.0 / p.period),
        min_normal_force=p.min_normal_force,
        max_normal_force=p.max_normal_force,
        contact_threshold=p.contact_threshold,
        double_support=gait.double_support,
        rest=gait.initial_state()[0][7:],
        ends=(
            np.where(free, robot.joint_lower, -np.inf),
            np.where(free, robot.joint_upper, np.inf),
        ),
        flat_feet=np.array(robot.flat_feet, dtype=np.int64),
        flies=np.int64(bool(robot.rotors) and not robot.feet),
        leans=np.int64(lift is not None),
        lift=np.zeros(3) if lift is None else lift,
    )
    return make_record(
        kind,
        robot.sizes,
        dynamics=dynamics_record(robot),
        tasks=tasks,
        targets=targets_record(robot),
        friction=friction_record(
            assumed=p.limits.mu, feet=feet, period=p.period, on=p.estimate_friction
        ),
        joint_friction=make_record(
            JointFrictionEstimateRecord,
            robot.sizes,
            on=np.int64(p.estimate_joint_friction),
            period=p.period,
            dry=robot.dry_friction if robot.dry_friction.any() else np.zeros(0),
        ),
        **parts,
    )


class TaskController(GaitController):
    """A whole-body controller.

    Args:
        gait: where body and feet should be.
        parameters: gains, weights and limits; by default those that fit gait and robot
            (:meth:`WholeBodyParameters.for_gait`).

    Attributes:
        dynamics: terms at the last state.
        targets: tasks of the last state.
    """

    parameters: WholeBodyParameters

    def __init__(self, gait: Gait, parameters: WholeBodyParameters | None) -> None:
        p = parameters if parameters is not None else WholeBodyParameters.for_gait(gait)
        super().__init__(gait, p)
        self.gait.expect_lag(p.thrust_lag)
        self.gait.expect_friction(p.limits.mu)
        ticks = self.gait.step_duration / p.period
        fewest = FEWEST_TICKS if len(self.robot.corners) > 2 else FEWEST_ON_TWO
        if ticks < fewest:
            period = self.gait.step_duration / fewest
            message = f"'{self.robot.name}' has {ticks:.1f} ticks of {p.period:g} s in a step"
            warnings.warn(
                f"{message} and may fall: take a period of {period:.2g} s at most", stacklevel=4
            )

    def _begin_tasks(
        self, kind: type[TasksRecord], with_targets: type[TasksRecord], **parts: ArrayLike
    ) -> None:
        """Make the record of the controller, and take it up.

        Its class is ``kind``, or with joint targets another one; see :func:`tasks_record`.
        """
        motors = joint_targets_record(self.robot, self.parameters, self.gait.initial_state()[0])
        if motors is not None:
            kind, parts = with_targets, {**parts, "motors": motors}
        record: Any = tasks_record(self.gait, self.parameters, kind, **parts)
        self.dynamics = Dynamics(self.robot, record=record["dynamics"])
        self.targets = WholeBodyTargets(self.robot, record=record["targets"])
        self._begin(record)
        self._signals["held"] = self.targets.held
        if motors is not None:
            for i, name in enumerate(("inertia", "damping")):
                self._signals[f"joint_{name}_estimate"] = field(record["motors"], "lacking")[i]
        if self.parameters.estimate_friction:
            self._signals["friction_estimate"] = field(record["friction"], "estimate")
        if self.parameters.estimate_joint_friction:
            for name in ("viscous", "coulomb"):
                self._signals[f"{name}_estimate"] = field(record["joint_friction"], name)

    def reset(self) -> None:
        """Forget the last command, and the estimates of friction."""
        super().reset()
        if self._command.law is not None:
            self._command.law[:] = 0.0
            for name in ("follows", "lacking", "motion", "square"):
                self._record_["motors"][name] = 0
        for name in ("known", "inputs", "sums", "viscous", "coulomb"):
            self._record_["joint_friction"][name] = 0
        friction: Any = self._record_["friction"]
        forget_friction(friction)
