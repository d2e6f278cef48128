"""The moment at which a page opens: where a run tells most about its contact forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from harpy_pin.log.measures import STUMBLE
from harpy_pin.log.run import Run
from harpy_pin.model.state import Vector
from harpy_pin.view.scene.forces import friction_used, sliding
from harpy_pin.view.scene.frames import is_per_axis, local_friction
from harpy_pin.view.scene.ground import about_normals, surface_of

__all__ = ["Moment", "telling_moment"]

LOADED = 0.2
"""A foot is loaded above this share of the mean normal force of all feet."""
START = 0.5
"""A longer run has begun by then, s: before, the feet settle on the ground."""


@dataclass(frozen=True)
class Moment:
    """A moment of a run.

    Attributes:
        time: s, on the run's own clock.
        reason: what happens, in a few words.
        power: that friction takes from the robot there, W; zero where no foot slides.
    """

    time: float
    reason: str
    power: float


def telling_moment(run: Run) -> Moment:
    """Where a loaded foot loses most to friction while it slides; else where one that holds uses most of its friction.

    A foot that slides fast under a small force, as at touchdown, tells less than one that slides under load: what
    counts is speed times tangential force. A body that has tilted as far as in a stumble is falling already; what
    happens after that does not count.

    Args:
        run: the rows that are drawn, so that what is said is seen. A slip at a single one of them, a touchdown, does
            not count.
    """
    surface, place, t = surface_of(run), run["foot_position"], run["t"]
    force, velocity = (about_normals(surface, place, run[name]) for name in ("foot_force", "foot_velocity"))
    names = run.metadata.get("feet")
    feet = force.shape[1]
    if feet == 0:
        return Moment(float(t[0]), "the start: this robot has no feet", 0.0)
    if not isinstance(names, list) or len(names) != feet:
        names = [f"foot {k + 1}" for k in range(feet)]
    normal = np.maximum(force[..., 2], 0.0)
    loaded = force[..., 2] > LOADED * float(normal.sum(axis=1).mean()) / feet
    loaded &= _upright(run["q"])[:, None]
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    tangential = np.hypot(force[..., 0], force[..., 1])
    slides = np.pad(sliding(force, velocity), ((1, 1), (0, 0)))
    lasting = slides[1:-1] & (slides[:-2] | slides[2:])
    power = np.where(lasting & loaded, speed * tangential, 0.0)
    row, foot = np.unravel_index(int(np.argmax(power)), power.shape)
    if power[row, foot] > 0.0:
        where, how = _words(names[foot]), f"slides at {1e3 * speed[row, foot]:.0f} mm/s"
        return Moment(float(t[row]), f"{where} {how} under {force[row, foot, 2]:.0f} N", float(power[row, foot]))
    mu = local_friction(run, run["foot_position"], time=t - t[0])
    if mu is not None:
        settled = t - t[0] >= (START if t[-1] - t[0] > 4.0 * START else 0.0)
        used = np.where(loaded & settled[:, None], friction_used(force, mu, per_axis=is_per_axis(run)), 0.0)
        used[~np.isfinite(used)] = 0.0  # no friction to use
        row, foot = np.unravel_index(int(np.argmax(used)), used.shape)
        if used[row, foot] > 0.0:
            share = f"uses {100.0 * used[row, foot]:.0f} % of its friction"
            return Moment(float(t[row]), f"{_words(names[foot])} {share}", 0.0)
    strongest = int(np.argmax(tangential.max(axis=1)))
    return Moment(float(t[strongest]), "largest tangential force", 0.0)


def _upright(q: Vector) -> NDArray[np.bool_]:
    """(n,) whether no row so far has a body that tilts by more than a stumble does."""
    tilt = np.arccos(np.clip(1.0 - 2.0 * (q[:, 3] ** 2 + q[:, 4] ** 2), -1.0, 1.0))
    return np.asarray(np.logical_and.accumulate(tilt <= STUMBLE))


def _words(name: object) -> str:
    """The name of a foot in words."""
    return str(name).replace("_", " ")
