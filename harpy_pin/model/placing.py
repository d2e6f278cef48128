"""One body from its parent: its placement, the screw of its joint, its acceleration."""

from __future__ import annotations

import numpy as np

from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import SLIDING, UNBOUNDED, TreeRecord
from harpy_pin.model.vectors import motion_cross, rotation_about


@kernel
def place_body(t: TreeRecord, q: Vector, i: int) -> None:
    """Placement of a body from its parent's, and the screw of the joint between them."""
    p, place, o, s = t.parent[i], t.place[i], t.position[i], t.screw[i]
    frame = t.axes[p] @ t.placement[i]
    axis = frame @ t.axis[i]
    o[:] = t.position[p] + t.axes[p] @ t.origin[i]
    if t.kind[i] == SLIDING:
        t.axes[i] = frame
        o += q[place] * axis
        s[:3], s[3:] = axis, 0.0
        return
    if t.kind[i] == UNBOUNDED:
        cosine, sine = q[place], q[place + 1]
    else:
        cosine, sine = np.cos(q[place]), np.sin(q[place])
    t.axes[i] = frame @ rotation_about(t.axis[i], cosine, sine)
    s[:3], s[3:] = np.cross(o, axis), axis


@kernel
def accelerated(t: TreeRecord, i: int, speed: float) -> Vector:
    """Acceleration of a body, less gravity, where its joint does not accelerate."""
    p = t.parent[i]
    moved: Vector = t.drift[p] + speed * motion_cross(t.twist[p], t.screw[i])
    return moved
