"""Forces of whole feet: the corners of a flat foot are drawn one by one, and counted together."""

from __future__ import annotations

import numpy as np

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["WholeFeet"]


class WholeFeet:
    """Which contact points are one foot.

    Args:
        robot: with feet.

    Attributes:
        names: of the feet.
    """

    def __init__(self, robot: Robot) -> None:
        self._starts = np.cumsum((0, *robot.corners[:-1]))
        flat = bool(robot.flat_feet)
        firsts = [robot.feet[start] for start in self._starts]
        self.names = tuple(name.rpartition("_")[0] if flat else name for name in firsts)

    def force(self, points: Vector) -> Vector:
        """(feet, 3) sums of the forces of the contact points, N."""
        return np.asarray(np.add.reduceat(points, self._starts, axis=0))

    def least(self, values: Vector) -> Vector:
        """(feet,) the least value among the contact points of each foot."""
        return np.asarray(np.minimum.reduceat(values, self._starts))
