"""Targets of a planar gait."""

import numpy as np

from reproduction.gait.planar_gait import planar_targets


def targets(gait, t):
    """Positions, velocities and stance of the feet."""
    position, velocity, stance = np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2))
    planar_targets(t, gait.record[0], position, velocity, stance)
    return position, velocity, stance
