"""Stiffness of the ground that fits a robot's weight."""

from __future__ import annotations

from functools import cache

from harpy_pin.model.robot import Robot, load_robot

__all__ = ["fitting_stiffness", "resting_stiffness", "walking_stiffness"]

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


@cache
def fitting_stiffness(name: str, walks: bool) -> float | None:
    """Stiffness of the ground of a robot by default, N/m; None for Harpy, whose ground is the paper's.

    Args:
        name: of the robot, in the catalogue.
        walks: whether it walks.

    Raises:
        RobotError: the robots of the catalogue are not installed.
    """
    if name == "harpy":
        return None
    return (walking_stiffness if walks else resting_stiffness)(load_robot(name))
