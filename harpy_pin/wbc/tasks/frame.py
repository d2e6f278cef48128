"""The acceleration of a frame: of its origin, its axes, or both."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.memory import fixed_arrays
from harpy_pin.model.state import State, Vector
from harpy_pin.wbc.tasks.task import MotionTask, check_stiffness, reference_position

AXES = ("world", "local")
PARTS = {"position": slice(0, 3), "orientation": slice(3, 6), "both": slice(0, 6)}


@fixed_arrays("acceleration", "position", "rotation", "velocity")
class FrameTask(MotionTask):
    """Acceleration of a frame of the robot: of its origin, of its axes, or of both (linear first).

    Args:
        frame: its name in the model: a link, a joint, a foot, a thruster.
        part: ``position``, ``orientation`` or ``both``.
        axes: in which the rows are written: ``world``, or ``local`` for those of the frame.
        position: (3,) where the origin should be, world, m.
        rotation: (3, 3) frame to world as it should be.
        velocity: (3,) or (6,) reference in ``axes``, m/s and rad/s; zero by default.
        acceleration: (3,) or (6,) reference in ``axes``, m/s² and rad/s²; zero by default.
        gains: (k_p, k_d), 1/s² and 1/s.

    Attributes:
        position, rotation, velocity, acceleration, gains: as given; they may be overwritten between ticks.

    Raises:
        InputError: an unknown part or axes; a k_p without the reference it needs; a position or a rotation without a
            k_p. An unknown frame is refused when the task is added.
    """

    def __init__(
        self,
        frame: str,
        *,
        part: str = "position",
        axes: str = "world",
        position: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        gains: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        checks.one_of("part", part, PARTS)
        checks.one_of("axes", axes, AXES)
        self.frame, self.part, self.axes = frame, part, axes
        self._rows = PARTS[part]
        super().__init__(self._rows.stop - self._rows.start, velocity, acceleration, gains)
        if part != "orientation":
            self.position = reference_position(position, 3, self.gains)
        else:  # which reads none
            self.position = None if position is None else checks.vector("position", position, 3)
        if rotation is None and part != "position" and self.gains[0] != 0.0:
            raise InputError("a gain k_p needs a rotation to go to", name="rotation")
        self.rotation = None if rotation is None else checks.vector("rotation", rotation, (3, 3))
        if self.rotation is not None and part != "position":
            check_stiffness("rotation", self.gains)
        self._model: Any = None
        self._data: Any = None
        self._frame = 0

    @checked
    def rows(self, dynamics: Dynamics, state: State) -> tuple[Vector, Vector]:
        """See :meth:`Task.rows`."""
        model = dynamics.model
        if self._model is not model:
            self._frame = dynamics.robot.frame_id(self.frame)
            self._model, self._data = model, model.createData()
        data, frame, world = self._data, self._frame, pin.LOCAL_WORLD_ALIGNED
        jacobian = pin.computeFrameJacobian(model, data, state.q, frame, world)
        pin.forwardKinematics(model, data, state.q, state.v, np.zeros(model.nv))
        place = pin.updateFramePlacement(model, data, frame)
        drift = pin.getFrameClassicalAcceleration(model, data, frame, world).vector
        error = np.zeros(6)
        if self.position is not None:
            error[:3] = self.position - place.translation
        if self.rotation is not None:
            error[3:] = pin.log3(self.rotation @ place.rotation.T)
        stacked = np.column_stack((jacobian, jacobian @ state.v, drift, error))
        if self.axes == "local":
            stacked = (place.rotation.T @ stacked.reshape(2, 3, -1)).reshape(6, -1)
        stacked = stacked[self._rows]
        velocity, drift, error = stacked[:, -3:].T
        return stacked[:, :-3], self.desired(error, velocity) - drift
