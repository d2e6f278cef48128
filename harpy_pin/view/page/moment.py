"""The moment at which a page opens: where a run tells most about its contact forces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from harpy_pin.log.measures import STUMBLE
from harpy_pin.model.state import Vector
from harpy_pin.view.scene.frames import Frames

__all__ = ["Moment", "telling_moment"]

LOADED = 0.2
"""A foot is loaded above this share of the mean normal force of all feet."""
START = 0.5
"""A longer run has begun by then, s: before, the feet settle on the ground."""


class Moment(NamedTuple):
    """A moment of a run.

    Attributes:
        time: since the run began, s.
        reason: what happens, in a few words.
        power: that friction takes from the robot there, W; zero where no foot slides.
    """

    time: float
    reason: str
    power: float


def telling_moment(frames: Frames) -> Moment:
    """Where a loaded foot loses most to friction while it slides; else where one that holds uses most of its friction.

    A foot that slides fast under a small force, as at touchdown, tells less than one that slides under load: what
    counts is speed times tangential force. A body that has tilted as far as in a stumble is falling already; what
    happens after that does not count, nor does a slip in a single frame, a touchdown.
    """
    feet, time = [name.replace("_", " ") for name in frames.robot.feet], frames.time
    if not feet:
        return Moment(0.0, "the start: this robot has no feet", 0.0)
    contacts = frames.contacts[frames.rows]
    loaded = contacts.force[..., 2] > LOADED * float(contacts.normal.sum(axis=1).mean()) / len(feet)
    loaded &= _upright(frames["q"])[:, None]
    speed, tangential = (np.hypot(v[..., 0], v[..., 1]) for v in (contacts.velocity, contacts.force))
    slides = np.pad(contacts.slides, ((1, 1), (0, 0)))
    lasting = slides[1:-1] & (slides[:-2] | slides[2:])
    row, foot, power = _largest(np.where(lasting & loaded, speed * tangential, 0.0))
    if power > 0.0:
        how = f"slides at {1e3 * speed[row, foot]:.0f} mm/s under {contacts.force[row, foot, 2]:.0f} N"
        return Moment(float(time[row]), f"{feet[foot]} {how}", power)
    if contacts.mu is not None:
        settled = time >= (START if time[-1] > 4.0 * START else 0.0)
        used = np.where(loaded & settled[:, None] & np.isfinite(contacts.used), contacts.used, 0.0)
        row, foot, share = _largest(used)
        if share > 0.0:
            return Moment(float(time[row]), f"{feet[foot]} uses {100.0 * share:.0f} % of its friction", 0.0)
    return Moment(float(time[_largest(tangential)[0]]), "largest tangential force", 0.0)


def _largest(values: Vector) -> tuple[int, int, float]:
    """Row and column of the largest value, and the value."""
    row, column = np.unravel_index(int(np.argmax(values)), values.shape)
    return int(row), int(column), float(values[row, column])


def _upright(q: Vector) -> NDArray[np.bool_]:
    """(n,) whether no row so far has a body that tilts by more than a stumble does."""
    tilt = np.arccos(np.clip(1.0 - 2.0 * (q[:, 3] ** 2 + q[:, 4] ** 2), -1.0, 1.0))
    return np.asarray(np.logical_and.accumulate(tilt <= STUMBLE))
