"""What the condensed controller and the whole-body QP share: the tasks of a gait, and estimates of
friction.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.controllers.friction import estimate_friction, friction_record
from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.controllers.joint_targets import motors_stage
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.stage import Stage, Stages
from harpy_pin.controllers.tasks import TaskSettingsRecord, TasksRecord, set_tasks
from harpy_pin.controllers.tick import TaskTickRecord, write_torque
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import Gait
from harpy_pin.kernels import Kernel
from harpy_pin.model.dynamics import Dynamics, dynamics_record
from harpy_pin.model.record import Records, field, fields, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.wbc.weights import WholeBodyTargets, joint_weights, targets_record

FEWEST_TICKS, FEWEST_ON_TWO = 8, 20
"""Ticks of a step, on more than two feet and on two, from which on eleven robots of twelve stood in
the compliant plant, at any period.
"""

NAMED_STAGES: Mapping[str, str] = {
    "estimate_joint_friction": "harpy_pin.contrib.joint_friction",
    "thrust_lag": "harpy_pin.contrib.thrust_lag",
    "thrust_turning_lag": "harpy_pin.contrib.thrust_lag",
}
"""Modules that are imported for the parameter that asks for their stage, the one of their
``make_stage(gait, parameters)``; None where the robot needs none.
"""


def tasks_record(
    gait: Gait,
    parameters: WholeBodyParameters,
    kind: type[TasksRecord] = TasksRecord,
    **parts: ArrayLike,
) -> Records[TasksRecord]:
    """A new :class:`TasksRecord`, or one of another ``kind`` with further parts."""
    robot, p = gait.robot, checks.instance("parameters", parameters, WholeBodyParameters)
    lift = robot.lift_axis
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
        dry=robot.dry_friction if robot.dry_friction.any() else np.zeros(0),
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
        **parts,
    )


def _friction_stage(robot: Robot, p: WholeBodyParameters) -> Stage | None:
    """The estimate in a whole-body controller of a robot; None without one."""
    if not p.estimate_friction:
        return None
    record = friction_record(assumed=p.limits.mu, feet=len(robot.feet), period=p.period)
    return Stage(
        name="friction",
        memory=fields(record),
        after_tasks=(estimate_friction,),
        signals={"friction_estimate": "estimate"},
    )


class TaskController(GaitController):
    """A whole-body controller.

    Args:
        gait: where body and feet should be.
        parameters: gains, weights and limits; by default those that fit gait and robot
            (:meth:`WholeBodyParameters.for_gait`).
        stages: of a user's own.

    Attributes:
        dynamics: terms at the last state.
        targets: tasks of the last state.
    """

    parameters: WholeBodyParameters
    _set_law: ClassVar[Kernel[None]]  # of the motors

    def __init__(
        self, gait: Gait, parameters: WholeBodyParameters | None, stages: Sequence[Stage]
    ) -> None:
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
        modules = dict.fromkeys(NAMED_STAGES[name] for name in NAMED_STAGES if getattr(p, name))
        found = (
            _friction_stage(self.robot, p),
            motors_stage(self.gait, p, self._set_law),
            *(import_module(module).make_stage(self.gait, p) for module in modules),
            *(checks.instance("stages", stage, Stage) for stage in stages),
        )
        self._stages = tuple(stage for stage in found if stage is not None)
        if sum(bool(stage.around_optimum) for stage in self._stages) > 1:
            raise InputError("one stage around the optimum at most", name="stages", value=stages)

    def _begin_tasks(self, kind: type[TaskTickRecord], **values: ArrayLike) -> None:
        """Make the record of the controller, of this class with these values, and take it up.

        Behind its own fields it has the memory of the stages.
        """
        robot = self.robot
        apart = np.int64(bool(self._kernels_of("around_optimum") or robot.rotors))
        parts = fields(tasks_record(self.gait, self.parameters, kind, apart=apart, **values))
        for stage in self._stages:
            if stage.name in parts:
                message = f"'{stage.name}' is a name that the controller's record has"
                raise InputError(message, name="stages", value=stage)
            if stage.memory:
                parts[stage.name] = stage._record
        record: Any = make_record(None, **parts)
        self.dynamics = Dynamics(robot, record=record["dynamics"])
        self.targets = WholeBodyTargets(robot, record=record["targets"])
        self._begin(record)
        self._signals["held"] = self.targets.held
        for stage in self._stages:
            for name, (entry, *index) in stage.signals.items():
                self._signals[name] = field(record[stage.name], entry)[*index, ...]

    def _kernels_of(self, phase: str) -> Stages:
        """Kernels of the stages in a phase of a tick."""
        return tuple(part for stage in self._stages for part in getattr(stage, phase))

    def _before(self) -> Stages:
        """Stages between the sample and the optimum."""
        return *self._kernels_of("before_tasks"), set_tasks, *self._kernels_of("after_tasks")

    def _closing(self) -> Stages:
        """Stages that close a tick."""
        return write_torque, *self._kernels_of("closing")

    def reset(self) -> None:
        """Forget the last command, and the estimates of friction."""
        super().reset()
        self._record_["inputs"] = 0
        for stage in self._stages:
            if stage.memory:
                self._record_[stage.name] = stage._record
