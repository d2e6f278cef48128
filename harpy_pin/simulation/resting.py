"""Stiffness of the ground that fits a robot's weight."""

from __future__ import annotations

from harpy_pin.model.robot import Robot

__all__ = ["resting_stiffness", "walking_stiffness"]

GRAVITY = 9.81
"""m/s²."""
DEPTH, WALKING_DEPTH = 0.005, 0.002
"""How deep a robot at rest is in its ground, and how deep one point is that carries a walking robot alone, m."""


def resting_stiffness(robot: Robot) -> float:
    """Stiffness of the ground in which a robot at rest, on all its contact points, is 5 mm deep, N/m.

    Args:
        robot: any; one without feet counts as one with a single foot.
    """
    return robot.mass * GRAVITY / (max(len(robot.feet), 1) * DEPTH)


def walking_stiffness(robot: Robot) -> float:
    """Stiffness of the ground on which a robot walks, N/m: a point that carries all of it is 2 mm deep.

    On softer ground soles rock at touchdown, and slip.

    Args:
        robot: any.
    """
    return robot.mass * GRAVITY / WALKING_DEPTH
