"""Where feet land: below their hips at the middle of the stance, and farther in the direction of a
velocity that is not wanted (Raibert, "Legged robots that balance", 1986).
"""

import numpy as np

from harpy_pin.model.state import Vector


def along(velocity: Vector, t: Vector) -> tuple[Vector, Vector]:
    """Path of a body that goes and turns steadily: places (…, 3), m, and yaws (…,), rad.

    Args:
        velocity: (3,) forward, to the left, m/s, and turning, rad/s.
        t: (…,) times from the present on, s.
    """
    yaw = velocity[2] * t
    half = 0.5 * yaw
    chord = t * np.sinc(half / np.pi)  # on a circle, and on a straight line
    x, y = velocity[:2]
    c, s = np.cos(half), np.sin(half)
    return np.stack((chord * (c * x - s * y), chord * (s * x + c * y), 0.0 * yaw), axis=-1), yaw


def footholds(
    hip: Vector, middle: Vector, *, velocity: Vector, excess: Vector, catch: float, lean: float
) -> Vector:
    """(N, feet, 3) in the axes of the heading, about the body's present place, level with it, m.

    Args:
        hip: (feet, 3) places of the feet below the body in its posture, m.
        middle: (N, feet) middles of the stances, from the present on, s.
        velocity: (3,) that is wanted: forward, to the left, m/s, and turning, rad/s.
        excess: (3,) measured velocity of the body less the one that is wanted, m/s.
        catch: how far a foothold goes for an excess, s.
        lean: how far it goes outwards in a turn, for the acceleration inwards, s².
    """
    place, yaw = along(velocity, middle)
    c, s = np.cos(yaw), np.sin(yaw)
    x, y = hip[:, 0], hip[:, 1]
    feet = place + np.stack((c * x - s * y, s * x + c * y, 0.0 * c), axis=-1)
    outwards = lean * velocity[2] * np.array([velocity[1], -velocity[0], 0.0])
    feet += catch * excess + outwards
    feet[..., 2] = 0.0
    return feet
