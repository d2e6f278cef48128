"""Limits of the acceleration of robots that fly on rotors, and the tilt of their thrust.

A robot with nearly parallel rotors has thrust along one direction of its body only. It accelerates sideways by tilting
its thrust. With a_d the acceleration desired of its body and g that of gravity, the thrust along the lift
axis l (fixed to the body) has to be the robot's mass times

    s = a_d − g

so the desired orientation has l along s: upright with the gait's heading, then turned by the shortest way. Until it is
reached, the thrust has only the part of s along the present direction R l, and the desired acceleration is reduced to
that: a = (s · R l) R l + g. This is the usual cascade of multirotors (Lee, Leok and McClamroch, "Geometric tracking
control of a quadrotor UAV on SE(3)", 2010), without the feedforward of the desired rotation.

The horizontal part of s is limited to a tilt of ``MAX_LEAN``, and its vertical part to at least half of gravity, so
that the robot never turns over to descend faster. Robots with thrust in all directions have this limit, too: beyond
what their rotors can do sideways they would lose their orientation.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.state import Vector

__all__ = ["MAX_LEAN"]

MAX_LEAN = 0.4
"""Largest angle between the thrust that is desired and the vertical, rad."""
_SLOPE = float(np.tan(MAX_LEAN))


@kernel
def limit_push(gravity: Vector, body: Vector) -> None:
    """Limit the thrust per mass s = a_d − g that an acceleration needs.

    Args:
        gravity: (3,) world axes, m/s²; nothing is limited without.
        body: (3,) a_d in and out, world axes, m/s².
    """
    weight = np.sqrt(gravity[0] ** 2 + gravity[1] ** 2 + gravity[2] ** 2)
    if weight == 0.0:
        return
    along = weight
    for i in range(3):
        along -= body[i] * gravity[i] / weight
    across = 0.0
    for i in range(3):
        body[i] += (along - weight) * gravity[i] / weight
        across += body[i] * body[i]
    along = max(along, 0.5 * weight)
    share = min(1.0, _SLOPE * along / max(np.sqrt(across), 1e-12))
    for i in range(3):
        body[i] = share * body[i] - (along - weight) * gravity[i] / weight


@kernel
def lean(
    rotation: Vector, gravity: Vector, lift: Vector, heading: float, body: Vector, quaternion: Vector
) -> tuple[float, float, float, float]:
    """Take the desired tilt out of the body's orientation, and what is out of reach now out of its acceleration.

    Args:
        rotation: (3, 3) body to world.
        gravity: (3,) world axes, m/s².
        lift: (3,) l, of unit length, body axes.
        heading: yaw of the upright body, rad.
        body: (3,) a_d in, after :func:`limit_push`; a out; world axes, m/s².
        quaternion: (4,) of the body: x, y, z, w.

    Returns:
        (x, y, z, w), the body's orientation turned back by the desired tilt: where the body has that tilt, this is the
        upright one with that heading.
    """
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    desired = np.empty(3)
    length = 0.0
    for i in range(3):
        desired[i] = body[i] - gravity[i]
        length += desired[i] * desired[i]
    length = np.sqrt(length)
    if length < 1e-9:  # weightless, and no acceleration desired
        return x, y, z, w
    # The part along the present direction.
    now = 0.0
    for i in range(3):
        now += desired[i] * (rotation[i, 0] * lift[0] + rotation[i, 1] * lift[1] + rotation[i, 2] * lift[2])
    for i in range(3):
        body[i] = gravity[i] + now * (rotation[i, 0] * lift[0] + rotation[i, 1] * lift[1] + rotation[i, 2] * lift[2])
    # The shortest turn from the upright body's lift axis a to the desired direction b: quaternion (a × b, 1 + a · b).
    c, s = np.cos(heading), np.sin(heading)
    ax, ay, az = c * lift[0] - s * lift[1], s * lift[0] + c * lift[1], lift[2]
    bx, by, bz = desired[0] / length, desired[1] / length, desired[2] / length
    tx, ty, tz, tw = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx, 1.0 + ax * bx + ay * by + az * bz
    norm = np.sqrt(tx * tx + ty * ty + tz * tz + tw * tw)
    if norm < 1e-9:  # the lift axis points down: there is no shortest turn
        return x, y, z, w
    tx, ty, tz, tw = -tx / norm, -ty / norm, -tz / norm, tw / norm
    return (
        tw * x + tx * w + ty * z - tz * y,
        tw * y - tx * z + ty * w + tz * x,
        tw * z + tx * y - ty * x + tz * w,
        tw * w - tx * x - ty * y - tz * z,
    )
