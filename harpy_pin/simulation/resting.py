"""The ground that fits a robot's weight."""

from __future__ import annotations

from harpy_pin.model.robot import Robot

__all__ = ["resting_stiffness"]

GRAVITY = 9.81
"""m/s²."""
DEPTH = 0.005
"""How deep a robot at rest is in its ground, m."""


def resting_stiffness(robot: Robot) -> float:
    """Stiffness of the ground in which a robot at rest, on all its contact points, is 5 mm deep, N/m.

    Args:
        robot: any; one without feet counts as one with a single foot.
    """
    return robot.mass * GRAVITY / (max(len(robot.feet), 1) * DEPTH)
