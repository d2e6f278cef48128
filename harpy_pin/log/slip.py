"""How far feet slip: along the ground while they touch it, summed at every physics step.

On ground that is not flat "along the ground" is along its tangent plane at the foot.

Two numbers for each foot since the simulator's last reset:

- the *path*: lengths of the horizontal displacements of all steps in which the ground pushes the foot;
- the *net* displacement: distance between the places of touchdown and of last touch, summed over all contacts. A break
  of less than 20 ms is a bounce and does not end a contact, so that small hops hide nothing.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled import kernel
from harpy_pin.model.record import RecordOf, Records, make_record, sized
from harpy_pin.model.state import Vector

__all__ = ["DEBOUNCE", "slip_record"]

DEBOUNCE = 0.02
"""Longest break of a contact that is a bounce, s."""


class SlipRecord(RecordOf):
    """What :func:`note_slip` keeps.

    Attributes:
        path: (feet,) m.
        net: (feet,) m, the present contact's included.
        ended: (feet,) net displacements of the contacts that have ended, m.
        touchdown: (feet, 3) where the present or last contact began, m.
        before: (feet, 3) where each foot was before the step, m.
        away: (feet,) since the last touch, s.
    """

    path: Vector = sized("feet")
    net: Vector = sized("feet")
    ended: Vector = sized("feet")
    touchdown: Vector = sized("feet", 3)
    before: Vector = sized("feet", 3)
    away: Vector = sized("feet", fill=np.inf)


class ContactRecord(RecordOf):
    """What every plant keeps of the contact.

    Attributes:
        force: (3 feet,) contact forces, world axes, N: guess in, forces of the step out.
        counts: (3,) most sweeps of the contact solver in a step so far, steps in which they ran out, and commands of
            one tick to a rotor that it could not carry out as given.
        slip: paths of the feet on the ground.
        frame: (feet, 3, 3) of each contact, see :mod:`harpy_pin.ground.contact_frame`; unused on flat ground.
    """

    force: Vector = sized("3 feet")
    counts: NDArray[np.int64] = sized(3, whole=True)
    slip: SlipRecord
    frame: Vector = sized("feet", 3, 3)


def slip_record(feet: int) -> Records[SlipRecord]:
    """A new :class:`SlipRecord`."""
    return make_record(SlipRecord, {"feet": feet})


@kernel
def forget_slip(s: SlipRecord, position: Vector) -> None:
    """Begin anew, with the feet where they are."""
    for k in range(position.shape[0]):
        s.path[k], s.net[k], s.ended[k], s.away[k] = 0.0, 0.0, 0.0, np.inf
        for i in range(3):
            s.before[k, i] = position[k, i]


@kernel
def note_slip(s: SlipRecord, position: Vector, force: Vector, dt: float) -> None:
    """Take one step into account.

    Args:
        s: element of the record.
        position: (feet, 3) at the end of the step, m.
        force: (3 feet,) over the step, N.
        dt: of the step, s.
    """
    for k in range(position.shape[0]):
        x, y = position[k, 0], position[k, 1]
        if force[3 * k + 2] > 0.0:
            if s.away[k] > DEBOUNCE:
                s.ended[k] = s.net[k]
                s.touchdown[k, 0], s.touchdown[k, 1] = s.before[k, 0], s.before[k, 1]
            s.away[k] = 0.0
            s.path[k] += np.hypot(x - s.before[k, 0], y - s.before[k, 1])
            s.net[k] = s.ended[k] + np.hypot(x - s.touchdown[k, 0], y - s.touchdown[k, 1])
        else:
            s.away[k] += dt
        s.before[k, 0], s.before[k, 1] = x, y


@kernel
def note_slip_along(s: SlipRecord, frame: Vector, position: Vector, force: Vector, dt: float) -> None:
    """Take one step on ground that is not flat into account.

    Args:
        s: element of the record.
        frame: (feet, 3, 3) of the contacts.
        position: (feet, 3) at the end of the step, m.
        force: (3 feet,) over the step, world axes, N.
        dt: of the step, s.
    """
    for k in range(position.shape[0]):
        r = frame[k]
        if r[0, 2] * force[3 * k] + r[1, 2] * force[3 * k + 1] + r[2, 2] * force[3 * k + 2] > 0.0:
            if s.away[k] > DEBOUNCE:
                s.ended[k] = s.net[k]
                s.touchdown[k] = s.before[k]
            s.away[k] = 0.0
            s.path[k] += _distance_along(r, s.before[k], position[k])
            s.net[k] = s.ended[k] + _distance_along(r, s.touchdown[k], position[k])
        else:
            s.away[k] += dt
        s.before[k] = position[k]


@kernel
def _distance_along(frame: Vector, begin: Vector, end: Vector) -> float:
    """Distance of two places along the ground, m."""
    along = across = 0.0
    for c in range(3):
        along += frame[c, 0] * (end[c] - begin[c])
        across += frame[c, 1] * (end[c] - begin[c])
    return float(np.hypot(along, across))
