"""The condensed whole-body controller: gait, tasks and optimum in one compiled call."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin.arguments import checked
from harpy_pin.controllers.condensed_tick import CondensedTickRecord, find_optimum, take_optimum
from harpy_pin.controllers.joint_targets import set_condensed_law
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.stage import Stage, Stages
from harpy_pin.controllers.task_controller import TaskController
from harpy_pin.controllers.tick import take_sample, tick_of, write_thrust
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import Gait, GaitTargetRecord
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.record import field
from harpy_pin.model.state import State, Vector
from harpy_pin.wbc.condensed.condensed_solver import CondensedSolver, condensed_record
from harpy_pin.wbc.condensed.task_memory import REFERENCES, AnyTask, adopt_tasks, known_tasks


@cache
def around_optimum(part: Kernel[None]) -> Kernel[None]:
    """The stage that calls a kernel of :attr:`Stage.around_optimum`."""

    @kernel
    def stage(
        r: CondensedTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
    ) -> None:
        p = r.condensed
        part(r, p.input_lower, p.input_upper, p.inputs, True)

    return stage


class CondensedController(TaskController):
    """Walks by the optimum in six unknowns; its tasks are those of :class:`WholeBodyController`.

    A tick, :meth:`~harpy_pin.controllers.gait_controller.GaitController.step`, calls the gait's
    kernels and then those of :mod:`harpy_pin.controllers.tick`: the sample is taken, tasks are set,
    the optimum is found (:func:`~harpy_pin.wbc.condensed.solve.solve_condensed`), and the command
    is written.
    Where no forces in the cones are within reach of the motors, the last command is held for
    ``hold_ticks`` ticks, as :class:`WholeBodyController` holds it where its program has no
    solution; then the torques are clipped.

    Args:
        gait: where body and feet should be.
        parameters: gains, weights and limits, by default those that fit gait and robot
            (:meth:`WholeBodyParameters.for_gait`); ``formulation`` and ``solver`` are not used.
        stages: of your own, see :class:`Stage`.

    Attributes:
        solver: the optimum of the last tick, with its forces and status.
        added: tasks that :meth:`add` has put in, with their weights.
    """

    _set_law = set_condensed_law

    @checked
    def __init__(
        self,
        gait: Gait,
        parameters: WholeBodyParameters | None = None,
        *,
        stages: Sequence[Stage] = (),
    ) -> None:
        super().__init__(gait, parameters, stages)
        self._use({})

    def _use(self, tasks: Mapping[AnyTask, ArrayLike]) -> None:
        """Begin anew, with tasks of one's own."""
        p = self.parameters
        condensed = condensed_record(
            self.robot, p.weights, p.limits, tasks=[*tasks], hold_ticks=p.hold_ticks
        )
        self._begin_tasks(CondensedTickRecord, condensed=condensed)
        record = self._record_["condensed"]
        self.added = adopt_tasks(tasks, record, record["newton"])
        self.solver = CondensedSolver(
            self.robot, p.weights, p.limits, tasks=[*tasks], record=record
        )
        self._intended = self.solver.acceleration
        self._clipped = field(self.solver._record_, "clipped")
        status, steps = (field(self.solver._record_, "status_and_steps")[k, ...] for k in range(2))
        self._signals |= {
            "desired_force": self.solver.force,
            "condensed_status": status,
            "newton_steps": steps,
        }
        self._step.prepare(
            self._record_, self.target._record_, *self._measured(State(0.0, *self._sample))
        )

    def _rebuild(self) -> None:
        """See :meth:`GaitController._rebuild`."""
        super()._rebuild()
        optimum: Stages = find_optimum, take_optimum
        command: Stages = (*self._kernels_of("after_optimum"), write_thrust)
        if around := [around_optimum(part) for part in self._kernels_of("around_optimum")]:
            *before, after = around
            pairs = (stage for part in before for stage in (part, find_optimum))
            optimum, command = (*pairs, after, take_optimum), command[:-1]
        stages = *self._before(), *optimum, *command
        self._step = tick_of((take_sample,), stages, self._closing())

    def _tell(self, status: int, state: State) -> None:
        """See :meth:`GaitController._tell`: also of a task whose reference or weight is not
        finite.
        """
        super()._tell(status, state)
        for task, weight in self.added.items():
            given = (weight, *(getattr(task, name, None) for name in REFERENCES))
            if not all(np.isfinite(one).all() for one in given if one is not None):
                kind = type(task).__name__
                warnings.warn(f"a reference or weight of a {kind} is not finite", stacklevel=3)

    def reset(self) -> None:
        """Forget the last command, the active sets and the estimates."""
        super().reset()
        self.solver.reset()
        for name in ("inputs", "last_inputs"):
            self.solver._record_[name] = 0
        self._clipped[:] = 0, self.parameters.hold_ticks  # there is no command to hold

    @property
    def clipped(self) -> int:
        """Ticks in which no forces in the cones were within reach of the motors, since the last
        reset.
        """
        return int(self._clipped[0])

    def add(
        self,
        task: AnyTask,
        *,
        weight: ArrayLike,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> Vector:
        """Add a task of your own, before the walk: the controller begins anew, and its kernels are
        compiled for the new size.

        From here on the task keeps its references in the controller's memory:
        ``task.position[:] = ...`` is all that a change takes. Gains are read here, once. A
        reference that is not finite leaves no optimum: the robot sinks, and :meth:`step` warns.

        Args:
            task: :class:`~harpy_pin.wbc.FrameTask`, :class:`~harpy_pin.wbc.JointTask`, one
                :class:`~harpy_pin.wbc.CentreOfMassTask`, or one angular
                :class:`~harpy_pin.wbc.MomentumTask`; every other one is
                :meth:`WholeBodyController.add`'s.
            weight: of the squares of its error, (rows,) or one for all; those of the gait's own
                tasks are in :class:`~harpy_pin.wbc.weights.WholeBodyWeights`.
            lower: refused, as ``upper`` is: ranges are :meth:`WholeBodyController.add`'s.
            upper: see there.

        Returns:
            (rows,) its weights, which may be overwritten in place.

        Raises:
            InputError: a task of another kind, unknown frames or joints, weights out of their
                domain, or a range.
        """
        for name, given in (("lower", lower), ("upper", upper)):
            if given is not None:
                message = "a range of a task is for the whole-body QP, make_controller('wbc', ...)"
                raise InputError(message, name=name, value=given)
        p = self.parameters
        known_tasks([*self.added, task])
        alone = condensed_record(self.robot, p.weights, p.limits, tasks=[task])
        adopt_tasks({task: weight}, alone, alone["newton"])  # refused before anything is changed
        self._use({**{one: kept.copy() for one, kept in self.added.items()}, task: weight})
        return self.added[task]
