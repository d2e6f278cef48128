"""Whether readings can be true: against gravity, the weight on the feet, the legs and the filter's
covariance.

Where they were not, or loaded feet agree with each other and not with the estimate, the estimate
begins anew.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.estimation.contact import LIKELY
from harpy_pin.estimation.invariant_filter import leave
from harpy_pin.estimation.record import ERRORS, EstimatorRecord
from harpy_pin.kernels import diagonal, kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import exp

GOOD, NO_SAMPLE, STUCK, SATURATED, INCONSISTENT, BACKWARDS, GAP, CLOCK = range(8)
UNLOADED, WEIGHTLESS, UPSIDE_DOWN, TURNING, ENCODERS, NO_FOOTHOLD, UNSURE, BAD_TARGET = range(8, 16)
"""Status of a step, see :attr:`harpy_pin.estimation.estimator.Estimator.status`."""
SAME = 50
"""Equal samples of the gyroscope in a row that no working one gives."""
EXPECTED = 3.0
"""Mean of the squared Mahalanobis distance of three measurements."""
INCONSISTENCY = 5.0
"""Factor on it that says that the readings do not belong together. Where soft ground lets feet
creep it is up to 4.6.
"""
CONTESTED = 2.0
"""Time for which that is said, s: what was learned in it takes as long to be put right."""
BIASED, SHAKEN = 8.0, 12.0
"""Estimated biases of gyroscope and accelerometer that say the same, in standard deviations of the
sensor. Contacts that shake the robot and creep look like up to ten of an accelerometer.
"""
PAUSES = 3
"""Longer pauses in a row, from which on the clock has another unit: steps are then taken to be a
period apart.
"""
AGREE = 0.3
"""Difference between the velocities by two loaded feet that both stand, m/s."""
LOST = 0.05
"""Time after which loaded feet that agree with each other are believed against the estimate, s."""
ANEW = (0.1, 0.1)
"""Standard deviations of tilt, rad, and velocity, m/s, that are then begun anew."""
AVERAGE = 1.0
"""Time constant of the means that accelerometer, gyroscope and forces are judged by, s."""
LIGHT, HEAVY = 0.5, 2.0
"""Shares of gravity between which the accelerometer's mean is. Jumps of 0.3 m in a row have 0.87 to
1.18.
"""
UPRIGHT = 0.5
"""Cosine of the largest angle between the accelerometer's mean and the estimate's vertical."""
BORNE = 0.5
"""Share of the weight that feet and thrusters bear in the mean at least; they bear 0.98 to 1.03 of
it in walks, and 0.77 in jumps.
"""
TURNS, TURNS_TIME = 0.03, 0.1
"""Rms speed of loaded feet that the gyroscope alone gives them, m/s, over this time, s: their
velocities, or those against each other, are at least half without it. A good one stays below zero.
"""
TURNS_WITHIN = (-0.05, 1.0)
"""Squares of it that one step may add, m²/s²: no good past hides a fault for long."""
DOUBTED = 0.5
"""Time for which that is said, s."""
FLIGHT = 1.0
"""Time without a foothold from which on it is said, s. Jumps of 0.3 m last 0.8 s with thrusters."""
KNOWN = 0.025
"""Standard deviation of the velocity up to which an estimate is good, m/s: with probability 0.95
within 5 cm/s.
"""
SETTLES, ANEW_SETTLES = 0.2, 0.6
"""Time after new footholds for which feet may still be wrongly in contact, and after a new begin in
a walk for which the tilt may be wrong, s.
"""
MISMATCH, MISMATCH_TIME = 0.2, 0.5
"""Difference between the changes of a joint's angle and those by its velocity, rad, over this time,
s, from which on joints are not read, for as long again.
"""
SWING = 0.05
"""Time without readings of the joints in which a foot may have come to stand elsewhere, s."""
SMALL = 1e-9
"""Acceleration across the vertical that tells no axis, m/s²."""


@kernel
def level(e: EstimatorRecord) -> None:
    """Turn the body, with its heading, so that the accelerometer's mean points up."""
    r, felt = e.filter.rotation, e.felt[:3]
    axis = np.cross(felt, r[2])
    across = np.sqrt(axis @ axis)
    r[:] = r @ exp(np.arctan2(across, felt @ r[2]) / max(across, SMALL) * axis)


@kernel
def weigh(e: EstimatorRecord) -> None:
    """Means of what the accelerometer feels, and of what feet and thrusters bear of each kilogram,
    body axes, m/s².
    """
    d, share = e.dynamics, min(e.period / AVERAGE, 1.0)
    borne = e.contact.force.reshape((e.contact.force.size,)) @ d.foot_jacobian[:, :3]
    if e.thrust.shape[0] > 0:
        borne += e.thrust @ d.thruster_jacobian[:, :3]
    e.felt[:3] += share * (e.raw_acceleration - e.felt[:3])
    e.felt[3:] += share * (borne / np.sum(d.tree.mass) - e.felt[3:])
    compare(e)


@kernel
def encoders_agree(e: EstimatorRecord, angle: Vector, velocity: Vector) -> bool:
    """Whether the changes of the joints' angles are those by their velocities, in the mean."""
    elapsed, change = e.unread + e.filter.period, angle - e.read[0]
    change = np.where(e.unbounded != 0, np.arctan2(np.sin(change), np.cos(change)), change)
    change -= 0.5 * elapsed * (velocity + e.read[1])
    e.read[0], e.read[1] = angle, velocity
    known = 1.0 if e.begun != 0 and elapsed < SWING else 0.0
    change += (1.0 - elapsed / MISMATCH_TIME) * e.mismatch
    e.mismatch[:] = known * np.clip(change, -2.0 * MISMATCH, 2.0 * MISMATCH)
    beyond = np.any(abs(e.mismatch) > MISMATCH)
    e.unlike = MISMATCH_TIME if beyond else max(e.unlike - e.filter.period, 0.0)
    return e.unlike == 0.0


@kernel
def compare(e: EstimatorRecord) -> None:
    """What these means are of gravity and of the weight, and whether they are upright."""
    felt, g = e.felt[:3], e.filter.gravity
    square = float(felt @ felt)
    e.gravity = np.sqrt(square / float(g @ g))
    e.borne = float(felt @ e.felt[3:]) / max(square, SMALL)
    e.up = float(felt @ e.filter.rotation[2]) / np.sqrt(max(square, SMALL))


@kernel
def believe_feet(e: EstimatorRecord) -> None:
    """Begin anew where loaded feet agree with each other for a while, and none with the estimate.

    A foot that the estimate lets move too fast is not in contact for it, so that nothing else could
    correct it. It also begins anew once readings are plausible again that were not, and whose
    biases and tilt were wrong.
    """
    c, f = e.contact, e.filter
    wrong = WEIGHTLESS <= e.status <= ENCODERS
    e.astray = 1 if wrong else e.astray
    if LIGHT < e.gravity < HEAVY and e.borne > BORNE and e.up < UPRIGHT:
        level(e)
    on, astray = np.where(c.loaded != 0, 1.0, 0.0), e.astray != 0 and not wrong
    own = np.cross(e.local_foot, e.angular_velocity) - e.local_speed
    count = np.sum(on)
    loaded = max(count, 1.0)
    mean = on @ own / loaded
    agree = (on == 0.0) | (np.max(abs(own - mean), axis=1) < AGREE)
    least = 1.0 if astray else 2.0
    lost = np.all(agree & (astray | (c.probability < LIKELY))) and count >= least
    _judge_gyroscope(e, on / loaded, own)
    e.lost = e.lost + f.period if lost else 0.0
    if e.lost >= LOST:
        if not wrong:
            level(e)
            e.astray = 0
        _begin_anew(e, mean)
        e.lost, e.settling = 0.0, ANEW_SETTLES
        e.contested, f.innovation = 0.0, EXPECTED


@kernel
def _judge_gyroscope(e: EstimatorRecord, share: Vector, own: Vector) -> None:
    """Whether loaded feet move that stand without what the gyroscope says, or against each other.

    ``share`` (feet,) of each in the mean; ``own`` (feet, 3), m/s, velocities of the inertial unit
    if the feet stand, body axes.
    """
    f = e.filter
    velocity = f.rotation.T @ f.velocity
    fast, slow = own - velocity, e.local_speed + velocity
    square = share @ (np.sum(fast**2, axis=1) - 4.0 * np.sum(slow**2, axis=1))
    fast_mean, slow_mean = share @ fast, share @ slow
    common = fast_mean @ fast_mean - 4.0 * slow_mean @ slow_mean
    spread = min(max(square - min(common, 0.0), TURNS_WITHIN[0]), TURNS_WITHIN[1])
    e.turning += min(f.period / TURNS_TIME, 1.0) * (spread - e.turning)
    e.turned = DOUBTED if e.turning > TURNS * TURNS else max(e.turned - f.period, 0.0)


@kernel
def _begin_anew(e: EstimatorRecord, velocity: Vector) -> None:
    """Take a velocity of the inertial unit, body axes, m/s, and the biases of the start.

    Place and heading stay as they are.
    """
    f, p = e.filter, e.filter.covariance
    for k in range(f.held.shape[0]):
        leave(f, k)
    anew, variance = f.rotation @ velocity, diagonal(p)
    p[:6], p[9:ERRORS] = 0.0, 0.0
    p[:, :6], p[:, 9:ERRORS] = 0.0, 0.0
    variance[:2], variance[3:6] = ANEW[0] ** 2, ANEW[1] ** 2
    variance[6:9] += ((f.velocity - anew) * e.loose) ** 2
    variance[9:ERRORS] = f.start[9:ERRORS] ** 2
    f.velocity[:] = anew
    f.gyroscope_bias[:] = 0.0
    f.accelerometer_bias[:] = 0.0


@kernel
def judge(e: EstimatorRecord, good: bool, periods: float) -> int:
    """What is to be said of this step."""
    if not good:
        return NO_SAMPLE
    if e.same_in_a_row >= SAME:
        return STUCK
    if e.saturated:
        return SATURATED
    if e.pauses_in_a_row >= PAUSES:
        return CLOCK
    if e.unlike > 0.0:
        return ENCODERS
    if not LIGHT < e.gravity < HEAVY:
        return WEIGHTLESS
    if min(e.borne, e.up) < -UPRIGHT:
        return UPSIDE_DOWN
    f = e.filter
    if not BORNE < e.borne < BORNE + f.held.shape[0]:
        return UNLOADED
    if e.turned > 0.0:
        return TURNING
    consistent = e.contested == 0.0 and e.lost == 0.0 and e.astray == 0 and e.up > UPRIGHT
    unsure = e.loose > FLIGHT or e.settling > 0.0
    variance = diagonal(f.covariance)[3:6]
    steady = np.all(abs(f.gyroscope_bias) <= BIASED * f.start[9:12])
    straight = np.all(abs(f.accelerometer_bias) <= SHAKEN * f.start[12:15])
    known = np.all((variance > 0.0) & (variance <= KNOWN * KNOWN))
    if not (consistent and steady and straight):
        return INCONSISTENT
    if periods > 1.0:
        return GAP
    if unsure or not known:
        return NO_FOOTHOLD if e.loose > 0.0 else UNSURE
    return GOOD
