"""Accelerations of joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.state import State, Vector
from harpy_pin.wbc.tasks.task import MotionTask, reference_position


@fixed_arrays("acceleration", "position", "velocity")
class JointTask(MotionTask):
    """Accelerations of joints.

    Args:
        joints: their names, or one name. The references below have their order; for one joint a number will do.
        position: (m,) angles to go to, rad.
        velocity: (m,) reference, rad/s; zero by default.
        acceleration: (m,) reference, rad/s²; zero by default.
        gains: (k_p, k_d), 1/s² and 1/s.

    Attributes:
        position, velocity, acceleration, gains: as given; they may be overwritten between ticks.

    Raises:
        InputError: a k_p without positions, or positions without a k_p; references of another length than ``joints``.
            Unknown joints are refused when the task is added.
    """

    def __init__(
        self,
        joints: str | Sequence[str],
        *,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        gains: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.joints = (joints,) if isinstance(joints, str) else checks.names("joints", joints)
        super().__init__(len(self.joints), velocity, acceleration, gains)
        self.position = reference_position(position, len(self.joints), self.gains)
        self._robot: Any = None
        self._columns: list[int] = []

    @checked
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""
        if self._robot is not dynamics.robot:
            names = dynamics.robot.joints
            for name in self.joints:
                checks.one_of("joint", name, names)
            self._robot, self._columns = dynamics.robot, [6 + names.index(name) for name in self.joints]
        columns = np.array(self._columns, dtype=np.int64)
        matrix = np.zeros((len(columns), len(state.v)))
        matrix[np.arange(len(columns)), columns] = 1.0
        error = None if self.position is None else self.position - state.q[columns + 1]
        return matrix, self.desired(error, state.v[columns])
