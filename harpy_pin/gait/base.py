"""What every controller asks of a gait: targets of body and feet, at any time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["Gait", "GaitTarget"]


class GaitTarget:
    """Targets at one time; overwritten by the next :meth:`Gait.update`.

    Attributes:
        packed: (33,) all of it in one array, for kernels; the others are views of it, in this order.
        body: (9,) position c_t (m), velocity (m/s), acceleration (m/s²) of the body, world.
        foot_position: (2, 3) left and right foot relative to the body's target, world axes, m.
        foot_velocity: (2, 3) likewise, m/s.
        foot_acceleration: (2, 3) likewise, m/s².
        stance: (2,) 1 where the foot should be on the ground, else 0.
        progress: (2,) share of its present stance or swing that each foot has done, 0 to 1.
        level: (2,) for controllers that place feet relative to the measured body: 1 where the target holds in world
            axes (a foot in the air must meet the ground, however the body tilts), 0 where it holds in body axes (a
            leg that carries sets the body upright), between them while the foot changes over.
    """

    __slots__ = (
        "body",
        "foot_acceleration",
        "foot_position",
        "foot_velocity",
        "level",
        "packed",
        "progress",
        "stance",
    )

    def __init__(self) -> None:
        self.packed: Vector = np.zeros(33)
        self.body: Vector = self.packed[:9]
        self.foot_position: Vector = self.packed[9:15].reshape(2, 3)
        self.foot_velocity: Vector = self.packed[15:21].reshape(2, 3)
        self.foot_acceleration: Vector = self.packed[21:27].reshape(2, 3)
        self.stance: Vector = self.packed[27:29]
        self.progress: Vector = self.packed[29:31]
        self.level: Vector = self.packed[31:]


class Gait(Protocol):
    """Targets of a walk for one robot.

    Attributes:
        robot: who walks.
        target: the targets of the last :meth:`update`.
        step_duration: time from one touchdown to the next, s.
        double_support: share of it with both feet on the ground.
    """

    robot: Robot
    target: GaitTarget
    step_duration: float
    double_support: float

    def update(self, t: float) -> GaitTarget:
        """Targets at time t ≥ 0, s: the object :attr:`target` itself."""
        ...

    def initial_state(self, *, sink: float = 0.0) -> tuple[Vector, Vector]:
        """Configuration (nq,) and velocity (nv,) that match the targets at t = 0.

        Args:
            sink: how deep the lower foot is in the ground, m (see ``Simulator.static_sink``).
        """
        ...

    def describe(self) -> Mapping[str, Any]:
        """Parameters, for the log's metadata."""
        ...
