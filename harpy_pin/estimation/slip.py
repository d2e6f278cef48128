"""How feet move that stand: they skid as they land, creep under load, and roll.

A round foot that soft ground lets in rolls on a smaller radius, and friction of a soft contact lets
a foot creep with a velocity in proportion to the tangential force. Where several feet stand, their
velocities v differ from those of rolling u as

    v − u = −s u − c f / weight + noise,

each less its mean over these feet: least squares with forgetting, drawn to zero, find the share s
of the radius that is lost and the creep c. How fast feet skid right after touchdowns is the noise
of those that land next.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.estimation.record import EstimatorRecord
from harpy_pin.kernels import kernel

LANDS, SEEN = 0.02, 0.005
"""Time after its touchdown in which a foot skids, s, and in the beginning of which its velocity is
that of the swing.
"""
FADES, CORRELATED = 0.008, 0.02
"""Time constant with which a skid fades, s, and twice that over which its velocity stays the
same.
"""
SKID_TIME, LEAST_SKID, MOST_SKID = 0.3, 9e-4, 0.25
"""Time constant of the mean of skids, s of landings; their largest square, m²/s², and that below
which they are noise of encoders and estimate.
"""
EVERY = 0.008
"""Time between two samples of all this, s."""
FORGOTTEN = 10.0
"""Time constant of the fit, s."""
RIDGE = (0.005, 3e-4)
"""Sums of squares of the force, s, and of rolling, m²/s, that draw the fit half-way to zero."""
MOST_CREEP, MOST_SUNK = 5.0, 0.5
"""Largest creep, m/s. A sphere that is let in up to its centre rolls on half of its radius."""


@kernel
def roll(e: EstimatorRecord) -> None:
    """Velocities of the centres of round feet that roll on the level: ω × (0, 0, radius), world
    axes.
    """
    for k in range(e.foot_radius.shape[0]):
        w = e.filter.rotation @ e.dynamics.tree.twist[e.dynamics.body[k], 3:]
        e.rolling[k] = e.foot_radius[k] * np.array([w[1], -w[0], 0.0])


@kernel
def roll_and_creep(e: EstimatorRecord) -> None:
    """The same on the radius that is left, with the creep."""
    c = e.contact
    roll(e)
    if c.creep > 0.0 or c.sunk > 0.0:
        e.rolling[:] = (1.0 - c.sunk) * e.rolling
        e.rolling[:, :2] -= c.creep / e.weight * c.force[:, :2]


@kernel
def learn_slip(e: EstimatorRecord) -> None:
    """Skid, creep and lost radius, by the velocities that feet have before they correct anything,
    from a sample for each time :data:`EVERY`.
    """
    c = e.contact
    c.unlearned += e.filter.period
    if c.unlearned < EVERY:
        return
    t = c.unlearned
    c.unlearned = 0.0
    on = np.where(c.since > LANDS, 1.0, 0.0)
    landing = np.where((c.since > SEEN) & (c.since < LANDS), 1.0, 0.0)
    count, landed = np.sum(on), np.sum(landing)
    if count + landed > 0.0:
        roll(e)
        slip, u, s = e.dynamics.foot_velocity[:, :2] - e.rolling[:, :2], e.rolling[:, :2], c.slips
        if landed > 0.0:
            square = min(landing @ np.sum(slip**2, axis=1) / landed, MOST_SKID)
            c.skid += min(landed * t / SKID_TIME, 1.0) * (square - c.skid)
        if count > 1.0:
            slip -= on @ slip / count
            turned = u - on @ u / count
            pull = (c.force[:, :2] - on @ c.force[:, :2] / count) / e.weight
            s *= 1.0 - min(t / FORGOTTEN, 1.0)
            s[0] += t * (on @ np.sum(pull * pull, axis=1))
            s[1] += t * (on @ np.sum(pull * turned, axis=1))
            s[2] += t * (on @ np.sum(turned * turned, axis=1))
            s[3] -= t * (on @ np.sum(pull * slip, axis=1))
            s[4] -= t * (on @ np.sum(turned * slip, axis=1))
            a, b = s[0] + RIDGE[0], s[2] + RIDGE[1]
            lost = (a * s[4] - s[1] * s[3]) / (a * b - s[1] * s[1])
            c.sunk = min(max(lost, 0.0), MOST_SUNK)
            c.creep = min(max((s[3] - s[1] * c.sunk) / a, 0.0), MOST_CREEP)


@kernel
def looseness(e: EstimatorRecord, k: int) -> float:
    """Density of a foothold's random walk, as a share of the usual one."""
    c, density = e.contact, e.filter.foothold_density
    if c.since[k] > 8.0 * FADES:
        return float(1.0 / c.probability[k])
    skid = CORRELATED * max(c.skid - LEAST_SKID, 0.0) * np.exp(-c.since[k] / FADES)
    return float(np.sqrt(1.0 + skid / (density * density)) / c.probability[k])
