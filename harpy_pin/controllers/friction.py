"""An estimate of the friction coefficient under each foot, from measured foot forces and slip.

A controller assumes a friction coefficient μ̂. Two observations correct it, both exact for
Coulomb's law, and both of a foot under load:

- it slides: then its force is on the cone, and the ratio r = −f_t·v̂ / f_z, with v̂ the direction
  of the slip, *is* the coefficient of sliding friction. The estimate falls to (1 − ε) r at once;
- it sticks: then the ratio r = ‖f_t‖ / f_z *proves* μ ≥ r. The estimate is never below (1 − ε)
  times the ratios proven on this foothold, of which old ones are forgotten with a time constant.

What is measured is low-passed. The ratio of a slide is the power that friction takes, −f_t·v, over
the one it would take at a coefficient of one, f_z ‖v‖, each low-passed: so samples in which a foot
already sticks again have no weight.

Where a foot sticks the estimate rises slowly. This is a guess, not a measurement, but a controller
that keeps inside the cone of the estimate would never find out otherwise that the ice has ended. A
foot that touches down has a new place and knows nothing of it. It takes over the lowest estimate of
the other feet in stance where that is lower than its own.

What holds, for every sequence of samples:

1. least estimate ≤ μ̂ ≤ assumed, at every tick.
2. While the measured speed of a foot stays below the threshold, and it is loaded without a break,
   its estimate never falls: the low-passed velocity is a weighted mean of the measured ones.
3. While the low-passed speed is beyond the threshold, the estimate never rises. A foot that slides
   on along a line at a ratio r has μ̂ ≤ max((1 − ε) r, proven ratio, least estimate) one time
   constant of the low-pass after its contact began, and comes there exponentially where its slide
   began later.
4. A foot that sticks under load has its assumed coefficient back after (assumed − least estimate) /
   rate of recovery.
5. A sample of a foot that is not finite, or beyond ``MAX_SAMPLE``, changes nothing about that foot.

Not proved: that the estimate is below the true coefficient before a foot has slid. The friction of
a place that no foot has tried is unknown; the first foot on ice slides until that is noticed
(``docs/friction.md`` says how far).
"""

from __future__ import annotations

import numpy as np

from harpy_pin import checks
from harpy_pin.controllers.tick import TaskTickRecord
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.entry import MAX_SAMPLE, all_possible
from harpy_pin.model.record import RecordOf, Records, make_record, sized
from harpy_pin.model.state import Vector

LEAST_ESTIMATE = 0.03
"""The estimate is never below it, or below the assumed coefficient where that is lower."""
SLIP_SPEED = 0.025
"""Low-passed speed from which on a foot slides, m/s. A foot slower than half of it sticks."""
LEAST_LOAD = 5.0
"""Measured normal force from which on a foot is looked at, N."""
FILTER_TIME = 0.005
"""Time constant of the low-pass, s."""
MARGIN = 0.05
"""ε, share by which measured ratios are reduced."""
MEMORY = 0.1
"""Time constant with which proven ratios are forgotten, s."""
RECOVERY = 0.15
"""Rate at which the estimate of a foot that sticks rises, 1/s."""


class FrictionRecord(RecordOf):
    """Memory of the estimate."""

    assumed: float  # as given
    weight: float  # of a new sample in the low-pass
    keep: float  # share of the proven ratio that is left after a tick
    rise: float  # of the estimate of a foot that sticks, per tick
    lowest: float  # estimate that there may be
    least: float  # lowest estimate of the feet that were loaded when one last did
    estimate: Vector  # (feet,) μ̂
    proven: Vector = sized(
        "feet"
    )  # (feet,) ratio proven on the present foothold, with the margin taken off
    loaded: Vector = sized("feet")  # (feet,) 1 while a foot is looked at
    samples: Vector = sized("feet")  # (feet,) how many there were since it began
    velocity: Vector = sized("feet", 2)  # (feet, 2) low-passed, m/s
    force: Vector = sized("feet", 3)  # (feet, 3) low-passed, N
    sweep: Vector = sized("feet", 2)  # (feet, 2) low-passed f_z v, N·m/s
    loss: Vector = sized("feet")  # (feet,) low-passed power that friction takes, −f_t·v, W


def friction_record(*, assumed: float, feet: int, period: float) -> Records[FrictionRecord]:
    """A new :class:`FrictionRecord`; arguments and errors as of
    :class:`~harpy_pin.controllers.governed.FrictionEstimator`."""
    assumed = checks.number("assumed friction", assumed, low=0.0, high=checks.MAX_FRICTION)
    period = checks.number("period", period, low=0.0, strict=True)
    return make_record(
        FrictionRecord,
        {"feet": feet},
        assumed=assumed,
        weight=1.0 - np.exp(-period / FILTER_TIME),
        keep=np.exp(-period / MEMORY),
        rise=period * RECOVERY,
        lowest=min(LEAST_ESTIMATE, assumed),
        least=assumed,
        estimate=np.full(feet, assumed),
    )


@kernel
def update_friction(
    p: FrictionRecord, foot_force: Vector, foot_velocity: Vector, held: Vector
) -> None:
    """Take one sample into account; see
    :meth:`~harpy_pin.controllers.governed.FrictionEstimator.update`, which checks the arrays."""
    least = np.inf
    for k in range(p.estimate.shape[0]):
        f, v = foot_force[k], foot_velocity[k]
        if all_possible(f) and abs(v[0]) <= MAX_SAMPLE and abs(v[1]) <= MAX_SAMPLE:
            if held[k] != 0.0 and f[2] > LEAST_LOAD:
                _filter(p, k, f, v)
                if p.samples[k] * p.weight >= 1.0:
                    _conclude(p, k)
            else:
                p.loaded[k] = p.samples[k] = 0.0
        if p.loaded[k] != 0.0:
            least = min(least, p.estimate[k])
    if least < np.inf:
        p.least = least


@kernel
def _filter(p: FrictionRecord, k: int, f: Vector, v: Vector) -> None:
    """Low-pass the sample of a foot under load; a new foothold starts with the estimates of the
    other feet.
    """
    p.samples[k] += 1.0
    weight = max(p.weight, 1.0 / p.samples[k])  # at first the mean of all
    if p.loaded[k] == 0.0:
        p.loaded[k] = 1.0
        p.proven[k] = 0.0
        others = np.where(p.loaded != 0.0, p.estimate, p.estimate[k])
        p.estimate[k] = np.min(others)
    p.force[k] += weight * (f - p.force[k])
    p.velocity[k] += weight * (v[:2] - p.velocity[k])
    p.sweep[k] += weight * (f[2] * v[:2] - p.sweep[k])
    p.loss[k] += weight * (-(f[:2] @ v[:2]) - p.loss[k])


@kernel
def _conclude(p: FrictionRecord, k: int) -> None:
    """Update the estimate from the low-passed sample of a foot."""
    force, sweep = p.force[k], p.sweep[k]
    speed = np.sqrt(p.velocity[k] @ p.velocity[k])
    if speed > SLIP_SPEED:
        ratio = p.loss[k] / np.sqrt(sweep @ sweep)
        if ratio > 0.0:  # friction acts against the slip; what does not is noise
            bound = max((1.0 - MARGIN) * ratio, p.proven[k], p.lowest)
            p.estimate[k] = min(p.estimate[k], bound)
        p.proven[k] *= p.keep
    elif speed < 0.5 * SLIP_SPEED:
        ratio = np.sqrt(force[:2] @ force[:2]) / force[2]
        p.proven[k] = max(p.keep * p.proven[k], (1.0 - MARGIN) * ratio)
        p.estimate[k] = min(max(p.estimate[k] + p.rise, p.proven[k]), p.assumed)
    else:
        p.proven[k] *= p.keep


class FrictionTickRecord(TaskTickRecord):
    """A whole-body controller with this estimate."""

    friction: FrictionRecord


@kernel
def estimate_friction(
    r: FrictionTickRecord, g: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The stage of a tick after its tasks: the estimate, for the friction cones."""
    t = r.targets
    if t.tilted:
        update_friction(r.friction, t.measured, r.dynamics.foot_velocity, t.held)
    else:
        update_friction(r.friction, foot_force, r.dynamics.foot_velocity, t.held)
    t.friction[:] = r.friction.estimate
