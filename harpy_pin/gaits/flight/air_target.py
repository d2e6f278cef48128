"""Targets in the air: those with which a whole-body controller asks for given accelerations of body, legs and feet."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from harpy_pin.gaits.gait import GaitTarget
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.state import Vector

__all__: list[str] = []

ORIENTATION = (400.0, 40.0)
"""Gains of the body's orientation of the controllers, 1/s² and 1/s: its target leans so that they ask for what it
should do."""
MOST_LEAN = 0.5
"""Largest angle between the body and its target, rad."""


def ask_for(o: GaitTarget, d: Dynamics, q: Vector, v: Vector, a: Vector) -> None:
    """Write the targets: places and velocities are the measured ones, accelerations those that are asked for.

    Args:
        o: out.
        d: terms at q and v.
        q: (nq,) measured configuration.
        v: (nv,) measured velocity.
        a: (nv,) acceleration.
    """
    turn = d.rotation
    o.body[:3], o.body[3:6] = q[:3], turn @ v[:3]
    o.body[6:9] = turn @ (a[:3] + np.cross(v[3:6], v[:3]))
    lean = (a[3:6] + ORIENTATION[1] * v[3:6]) / ORIENTATION[0]
    lean *= min(1.0, MOST_LEAN / max(float(np.linalg.norm(lean)), 1e-12))
    o.up[:], o.heading[0] = _up_and_heading(turn @ pin.exp3(lean))
    o.heading[1:] = 0.0
    o.foot_position[:] = d.foot_position - o.body[:3]
    o.foot_velocity[:] = d.foot_velocity - o.body[3:6]
    o.foot_acceleration[:] = (d.foot_jacobian @ a + d.foot_drift).reshape(-1, 3) - o.body[6:9]
    o.stance[:], o.phase[:] = 0.0, 0.4
    o.normal[:] = (0.0, 0.0, 1.0)


def _up_and_heading(rotation: Vector) -> tuple[Vector, float]:
    """Direction of the body's z axis, and the yaw after it is turned upright the shortest way."""
    up = rotation[:, 2]
    upright = pin.Quaternion.FromTwoVectors(np.array((0.0, 0.0, 1.0)), up).matrix().T @ rotation
    return up, float(np.arctan2(upright[1, 0], upright[0, 0]))
