"""The condensed whole-body optimum from Python: the records of a robot, and one solve."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntFlag

import numpy as np
from numpy.typing import NDArray

from harpy_pin.arguments import checked
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import as_array
from harpy_pin.model.memory import KeepsViews, fixed_arrays
from harpy_pin.model.record import Record, Records, field, make_record, same_layout
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.solve import CondensedRecord, solve_condensed
from harpy_pin.wbc.condensed.structure import (
    determined_limbs,
    elimination_record,
    feet_record,
    limbs_record,
    limits_record,
    tree_paths,
)
from harpy_pin.wbc.condensed.task_memory import AnyTask, task_records
from harpy_pin.wbc.condensed.tasks import MOMENTA
from harpy_pin.wbc.newton import newton_record
from harpy_pin.wbc.problem import problem_values
from harpy_pin.wbc.tasks.task import CentreOfMassTask, MomentumTask
from harpy_pin.wbc.weights import WholeBodyLimits, WholeBodyTargets, WholeBodyWeights, check_terms


class CondensedStatus(IntFlag):
    """How a tick ended; up to three it is the optimum."""

    OPTIMAL = 0
    THRUST_LIMITED = 1
    """A thrust is at its limit."""
    TORQUE_LIMITED = 2
    """A torque is at its limit."""
    SUBOPTIMAL = 4
    """The search for the forces ended at its bound; they are in their pyramids."""
    TORQUE_CLIPPED = 8
    """Torques were clipped: the forces that follow are not the ones intended."""


def condensed_record(
    robot: Robot,
    weights: WholeBodyWeights,
    limits: WholeBodyLimits,
    *,
    tasks: Sequence[AnyTask] = (),
    hold_ticks: float = 0,
) -> Records[CondensedRecord]:
    """A new :class:`CondensedRecord`; arguments and errors as of :class:`CondensedSolver`.

    There is room for ``tasks`` of one's own. For ``hold_ticks`` ticks in a row :func:`hold_last`
    gives the last inputs in the place of clipped ones.
    """
    values = problem_values(robot, weights, limits)
    own = task_records(robot, tasks, width=tree_paths(robot)[1].shape[1])
    limbs = determined_limbs(robot, (*own.filling, *own.others))
    system, first_row = elimination_record(
        robot, limbs, task_bodies=own.filling, relative=own.relative
    )
    others = [foot for foot in range(len(robot.corners)) if foot not in limbs]
    of_momentum = any(isinstance(task, CentreOfMassTask | MomentumTask) for task in tasks)
    newton = newton_record(
        {**robot.sizes, "momenta": 2 + (MOMENTA if of_momentum else 0), "relative": own.relative},
        limits,
        force_weight=weights.force,
        thrust_weight=weights.thrust,
    )
    return make_record(
        CondensedRecord,
        robot.sizes,
        limbs=limbs_record(robot, limbs, relative=own.relative),
        others=feet_record(robot, others, first_row),
        system=system,
        newton=newton,
        limits=limits_record(robot, limits),
        frames=own.frames,
        joints=own.joints,
        momentum=own.momentum,
        configuration=np.zeros(robot.nq),
        hold_ticks=np.int64(hold_ticks),
        clipped=np.array(
            [0, hold_ticks], dtype=np.int64
        ),  # before the first command there is none to hold
        **values,
    )


@fixed_arrays("acceleration", "force", "inputs", "record")
class CondensedSolver(KeepsViews):
    """Contact forces, torques and thrusts of one tick in one call.

    Args:
        robot: any, whose feet are points or soles, none of them on its base.
        weights: of the tasks, by default those that fit the robot; limbs that their feet determine
            have no free posture.
        limits: of the constraints.
        tasks: of one's own in the record.
        record: where everything is kept, a part of a larger record, made by
            :func:`condensed_record`.

    Attributes:
        force: (feet, 3) contact forces of the last tick, world axes, N; zero in swing.
        inputs: (thrust variables + joints,) [u; τ] of the last tick, N and N·m; see
            :mod:`harpy_pin.model.rotor`.
        acceleration: (nv,) generalised acceleration that follows.
        status: of the last tick.
        steps: Newton's steps of the last tick's search.

    Raises:
        InputError: a foot is fixed to the base.
    """

    _record_: Records[CondensedRecord]
    _inputs_: Vector

    @checked
    def __init__(
        self,
        robot: Robot,
        weights: WholeBodyWeights | None = None,
        limits: WholeBodyLimits | None = None,
        *,
        tasks: Sequence[AnyTask] = (),
        record: Record | None = None,
    ) -> None:
        self.robot = robot
        self.weights = weights if weights is not None else WholeBodyWeights.for_robot(robot)
        self.limits = limits if limits is not None else WholeBodyLimits()
        own = condensed_record(robot, self.weights, self.limits, tasks=tasks)
        self.record = own if record is None else same_layout(record, own)
        self.force: Vector = field(self._record_, "force").reshape(-1, 3)
        self.inputs: Vector = field(self._record_, "inputs")
        self.acceleration: Vector = field(self._record_["system"], "acceleration")
        self._outcome: NDArray[np.int64] = field(self._record_, "status_and_steps")

    def reset(self) -> None:
        """Forget where the last tick's search ended."""
        for name in ("free_piece", "limited_piece"):
            self._record_[name] = 0
        self._record_["newton"]["limits"] = 0

    @property
    def status(self) -> CondensedStatus:
        """Status of the last tick."""
        return CondensedStatus(int(self._outcome[0]))

    @property
    def steps(self) -> int:
        """Newton's steps of the last tick's search."""
        return int(self._outcome[1])

    def solve(self, dynamics: Dynamics, v: Vector, targets: WholeBodyTargets) -> Vector:
        """One tick.

        Args:
            dynamics: terms at the present state.
            v: (nv,) generalised velocity.
            targets: of the tasks.

        Returns:
            (thrust variables + joints,) [u; τ]: the array :attr:`inputs` itself.

        Raises:
            InputError: terms or targets of another robot, or an array of another shape.
        """
        check_terms(self.robot, dynamics, targets)
        v = as_array("v", v, (self.robot.nv,))
        solve_condensed(dynamics._record_, targets._record_, self._record_, v)
        return self._inputs_
