"""A gait that begins at another place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from harpy_pin.gaits.gait import FullGait, GaitTarget
from harpy_pin.model.state import State, Vector

__all__: list[str] = []


class LandedGait:
    """The targets of a gait, moved over the ground.

    Args:
        gait: whose they are.

    Attributes:
        target: of the last update.
    """

    def __init__(self, gait: FullGait) -> None:
        self.gait, self.robot = gait, gait.robot
        self.step_duration, self.double_support = gait.step_duration, gait.double_support
        self.target = GaitTarget(len(gait.robot.feet))
        begin = gait.update(0.0)
        self._middle: Vector = (begin.body[:3] + begin.foot_position.mean(axis=0))[:2]
        self._shift = np.zeros(2)

    def move_to(self, feet: Vector) -> None:
        """Begin with the middle of the feet at a place.

        Args:
            feet: (3,) the place, m.
        """
        self._shift = feet[:2] - self._middle

    def update(self, t: float) -> GaitTarget:
        """See :meth:`~harpy_pin.gaits.gait.Gait.update`.

        Args:
            t: time, s.
        """
        self.target.record[:] = self.gait.update(t).record
        self.target.body[:2] += self._shift
        return self.target

    def observe(self, state: State) -> None:
        """Hand the measured state, moved back, to the gait, if it takes one.

        Args:
            state: of the present tick.
        """
        observe = getattr(self.gait, "observe", None)
        if observe is not None:
            moved = state.copy()
            moved.q[:2] -= self._shift
            moved.foot_position[:, :2] -= self._shift
            observe(moved)

    def initial_state(self, *, penetration: float = 0.0) -> tuple[Vector, Vector]:
        """That of the gait.

        Args:
            penetration: how deep the lower foot is in the ground, m.
        """
        return self.gait.initial_state(penetration=penetration)

    def describe(self) -> Mapping[str, Any]:
        """The gait's parameters."""
        return self.gait.describe()
