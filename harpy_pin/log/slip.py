"""How far feet slip: along the ground while they touch it, summed at every physics step.

On ground that is not flat "along the ground" is along its tangent plane at the foot.

Two numbers for each foot since the simulator's last reset:

- the *path*: lengths of the horizontal displacements of all steps in which the ground pushes the
  foot;
- the *net* displacement: distance between the places of touchdown and of last touch, summed over
  all contacts. A break of less than 20 ms is a bounce and does not end a contact, so that small
  hops hide nothing.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.kernels import kernel
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector

DEBOUNCE = 0.02
"""Longest break of a contact that is a bounce, s."""


class SlipRecord(RecordOf):
    """What :func:`note_slip` keeps."""

    path: Vector = sized("feet")  # (feet,) m
    net: Vector = sized("feet")  # (feet,) m, the present contact's included
    ended: Vector = sized("feet")  # (feet,) net displacements of the contacts that have ended, m
    touchdown: Vector = sized("feet", 3)  # (feet, 3) where the present or last contact began, m
    before: Vector = sized("feet", 3)  # (feet, 3) where each foot was before the step, m
    away: Vector = sized("feet", fill=np.inf)  # (feet,) since the last touch, s


@kernel
def forget_slip(s: SlipRecord, position: Vector) -> None:
    """Begin anew, with the feet where they are."""
    s.path[:] = s.net[:] = s.ended[:] = 0.0
    s.away[:] = np.inf
    s.before[:] = position


@kernel
def note_slip(
    s: SlipRecord, level: bool, frame: Vector, position: Vector, force: Vector, dt: float
) -> None:
    """Take a step dt, s, into account: its forces (3 feet,), world axes, N, and the positions
    (feet, 3) at its end, m.

    Frames (feet, 3, 3) of the contacts are not read where the ground is level.
    """
    for k in range(position.shape[0]):
        f, r = force[3 * k : 3 * k + 3], frame[k]
        normal = f[2] if level else r[:, 2] @ f
        if normal > 0.0:
            if s.away[k] > DEBOUNCE:
                s.ended[k] = s.net[k]
                s.touchdown[k] = s.before[k]
            s.away[k] = 0.0
            s.path[k] += _distance(level, r, s.before[k], position[k])
            s.net[k] = s.ended[k] + _distance(level, r, s.touchdown[k], position[k])
        else:
            s.away[k] += dt
        s.before[k] = position[k]


@kernel
def _distance(level: bool, frame: Vector, begin: Vector, end: Vector) -> float:
    """Distance of two places along the ground, m."""
    x, y = end[:2] - begin[:2]
    if not level:
        x, y = frame[:, :2].T @ (end - begin)
    return float(np.hypot(x, y))
