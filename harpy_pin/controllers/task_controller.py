"""What the condensed controller and the whole-body QP share: the tasks of a gait, and estimates of
friction.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.controllers.friction import estimate_friction, forget_friction, friction_record
from harpy_pin.controllers.gait_controller import GaitController
from harpy_pin.controllers.joint_friction import (
    JointFrictionEstimateRecord,
    estimate_joint_friction,
    note_inputs,
)
from harpy_pin.controllers.joint_targets import joint_targets_record
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.tasks import TaskSettingsRecord, TasksRecord, set_tasks
from harpy_pin.controllers.thrust_lag import advance, thrust_lag_record
from harpy_pin.controllers.tick import Stages, TaskTickRecord, write_torque
from harpy_pin.gaits.gait import Gait
from harpy_pin.kernels import Kernel
from harpy_pin.model.dynamics import Dynamics, dynamics_record
from harpy_pin.model.record import Records, field, fields, make_record
from harpy_pin.wbc.weights import WholeBodyTargets, joint_weights, targets_record

FEWEST_TICKS, FEWEST_ON_TWO = 8, 20
"""Ticks of a step, on more than two feet and on two, from which on eleven robots of twelve stood in
the compliant plant, at any period.
"""

_ESTIMATES: dict[str, tuple[Any, ...]] = {
    "joint_inertia_estimate": ("motors", "lacking", 0),
    "joint_damping_estimate": ("motors", "lacking", 1),
    "friction_estimate": ("friction", "estimate"),
    "viscous_estimate": ("joint_friction", "viscous"),
    "coulomb_estimate": ("joint_friction", "coulomb"),
}
"""Signals by name: part of the record, its field, and a row of it."""
_FORGOTTEN = {
    "motors": ("follows", "lacking", "motion", "square"),
    "joint_friction": ("known", "inputs", "sums", "viscous", "coulomb"),
    "lag": ("settled",),
}
"""What a reset sets to zero, by part of the record."""


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

    def _begin_tasks(self, kind: type[TaskTickRecord], **values: ArrayLike) -> None:
        """Make the record of the controller, of this class with these values, and take it up.

        Behind its own fields it has those of the stages that not every tick has.
        """
        robot, p = self.robot, self.parameters
        lag = thrust_lag_record(robot, p)
        parts = {
            "friction": friction_record(assumed=p.limits.mu, feet=len(robot.feet), period=p.period)
            if p.estimate_friction
            else None,
            "joint_friction": make_record(JointFrictionEstimateRecord, robot.sizes, period=p.period)
            if p.estimate_joint_friction
            else None,
            "lag": lag,
            "motors": joint_targets_record(robot, p, self.gait.initial_state()[0]),
        }
        apart = np.int64(lag is not None or bool(robot.rotors))
        own = tasks_record(self.gait, p, kind, apart=apart, **values)
        given = {name: part for name, part in parts.items() if part is not None}
        record: Any = make_record(None, **fields(own), **given)
        self.dynamics = Dynamics(robot, record=record["dynamics"])
        self.targets = WholeBodyTargets(robot, record=record["targets"])
        self._begin(record)
        self._signals["held"] = self.targets.held
        for name, (part, estimate, *row) in _ESTIMATES.items():
            if part in given:
                self._signals[name] = field(record[part], estimate)[*row, ...]

    def _has(self, part: str) -> bool:
        """Whether a tick has the stages of a part."""
        return part in (self._record_.dtype.names or ())

    def _before(self) -> Stages:
        """Stages between the sample and the optimum."""
        return (
            *((estimate_joint_friction,) if self._has("joint_friction") else ()),
            set_tasks,
            *((estimate_friction,) if self._has("friction") else ()),
        )

    def _after(self) -> Stages:
        """Stages after the optimum."""
        return (note_inputs,) if self._has("joint_friction") else ()

    def _closing(self, set_law: Kernel[None]) -> Stages:
        """Stages that close a tick, with this one of the motors' law."""
        return (
            write_torque,
            *((set_law,) if self._has("motors") else ()),
            *((advance,) if self._has("lag") else ()),
        )

    def reset(self) -> None:
        """Forget the last command, and the estimates of friction."""
        super().reset()
        self._record_["inputs"] = 0
        if self._command.law is not None:
            self._command.law[:] = 0.0
        for part, names in _FORGOTTEN.items():
            for name in names if self._has(part) else ():
                self._record_[part][name] = 0
        if self._has("friction"):
            friction: Any = self._record_["friction"]
            forget_friction(friction)
