"""Whether readings can be true: against gravity, the weight on the feet, the legs and the filter's covariance.

Where they were not, or loaded feet agree with each other and not with the estimate, the estimate begins anew.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.estimation.contact import LIKELY
from harpy_pin.estimation.invariant_filter import leave, rotation_of, turn_by
from harpy_pin.estimation.record import ERRORS, EstimatorRecord
from harpy_pin.model.state import Vector

GOOD, NO_SAMPLE, STUCK, SATURATED, INCONSISTENT, BACKWARDS, GAP = 0, 1, 2, 3, 4, 5, 6
CLOCK, UNLOADED, WEIGHTLESS, UPSIDE_DOWN, TURNING, NO_FOOTHOLD, UNSURE, BAD_TARGET = 7, 8, 9, 10, 11, 12, 13, 14
"""Status of a step, see :attr:`harpy_pin.estimation.estimator.Estimator.status`."""
SAME = 50
"""Equal samples of the gyroscope in a row that no working one gives."""
EXPECTED = 3.0
"""Mean of the squared Mahalanobis distance of three measurements."""
INCONSISTENCY = 3.0
"""Factor on it that says that the readings do not belong together."""
BIASED, SHAKEN = 8.0, 12.0
"""Estimated biases of gyroscope and accelerometer that say the same, in standard deviations of the sensor. Contacts
that shake the robot and creep look like up to ten of an accelerometer."""
PAUSES = 3
"""Longer pauses in a row, from which on the clock has another unit: steps are then taken to be a period apart."""
AGREE = 0.3
"""Difference between the velocities by two loaded feet that both stand, m/s."""
LOST = 0.05
"""Time after which loaded feet that agree with each other are believed against the estimate, s."""
ANEW = (0.1, 0.1)
"""Standard deviations of tilt, rad, and velocity, m/s, that are then begun anew."""
AVERAGE = 1.0
"""Time constant of the means that accelerometer, gyroscope and forces are judged by, s."""
LIGHT, HEAVY = 0.5, 2.0
"""Shares of gravity between which the accelerometer's mean is. Jumps of 0.3 m in a row have 0.87 to 1.18."""
UPRIGHT = 0.5
"""Cosine of the largest angle between the accelerometer's mean and the estimate's vertical."""
BORNE = 0.5
"""Share of the weight that feet and thrusters bear in the mean at least; they bear 0.98 to 1.03 of it in walks, and
0.77 in jumps."""
TURNS = 0.03
"""Speed at which loaded feet move against each other by the gyroscope alone, m/s; a good one stays below zero."""
FLIGHT = 1.0
"""Time without a foothold from which on it is said, s. Jumps of 0.3 m last 0.8 s with thrusters."""
KNOWN = 0.025
"""Standard deviation of the velocity up to which an estimate is good, m/s: with probability 0.95 within 5 cm/s."""
SMALL = 1e-9
"""Acceleration across the vertical that tells no axis, m/s²."""


@kernel
def level(e: EstimatorRecord) -> None:
    """Turn the body, with its heading, so that the accelerometer's mean points up."""
    r, a, turn = e.filter.rotation, e.felt, np.empty((3, 3))
    x, y, z = a[1] * r[2, 2] - a[2] * r[2, 1], a[2] * r[2, 0] - a[0] * r[2, 2], a[0] * r[2, 1] - a[1] * r[2, 0]
    across = np.sqrt(x * x + y * y + z * z)
    angle = np.arctan2(across, a[0] * r[2, 0] + a[1] * r[2, 1] + a[2] * r[2, 2]) / max(across, SMALL)
    rotation_of(angle * x, angle * y, angle * z, turn)
    turn_by(r, turn)


@kernel
def weigh(e: EstimatorRecord) -> None:
    """Means of what the accelerometer feels, and of what feet and thrusters bear of each kilogram, body axes, m/s²."""
    d, share = e.dynamics, min(e.period / AVERAGE, 1.0)
    for i in range(3):
        s = 0.0
        for k in range(e.contact.force.shape[0]):
            for x in range(3):
                s += d.foot_jacobian[3 * k + x, i] * e.contact.force[k, x]
        for n in range(e.thrust.shape[0]):
            s += d.thruster_jacobian[n, i] * e.thrust[n]
        e.felt[i] += share * (e.raw_acceleration[i] - e.felt[i])
        e.felt[3 + i] += share * (s / d.mass_matrix[0, 0] - e.felt[3 + i])
    compare(e)


@kernel
def compare(e: EstimatorRecord) -> None:
    """What these means are of gravity and of the weight, and whether they are upright."""
    a, g, r = e.felt, e.filter.gravity, e.filter.rotation
    square = a[0] ** 2 + a[1] ** 2 + a[2] ** 2
    e.gravity = np.sqrt(square / (g[0] ** 2 + g[1] ** 2 + g[2] ** 2))
    e.borne = (a[0] * a[3] + a[1] * a[4] + a[2] * a[5]) / max(square, SMALL)
    e.up = (a[0] * r[2, 0] + a[1] * r[2, 1] + a[2] * r[2, 2]) / np.sqrt(max(square, SMALL))


@kernel
def believe_feet(e: EstimatorRecord) -> None:
    """Begin anew where loaded feet agree with each other for a while, and none with the estimate.

    A foot that the estimate lets move too fast is not in contact for it, so that nothing else could correct it. It also
    begins anew once readings are plausible again that were not, and whose biases and tilt were wrong.
    """
    c, w, mean, own = e.contact, e.angular_velocity, np.zeros(6), np.zeros((e.local_foot.shape[0], 6))
    wrong = WEIGHTLESS <= e.status <= TURNING
    e.astray = 1 if wrong else e.astray
    if LIGHT < e.gravity < HEAVY and e.borne > BORNE and e.up < UPRIGHT:
        level(e)
    loaded, lost = 0.0, True
    for k in range(own.shape[0]):
        lost = lost and (c.probability[k] < LIKELY or (e.astray != 0 and not wrong))
        if c.loaded[k] != 0:
            h, s, u = e.local_foot[k], e.local_speed[k], own[k]
            u[0] = w[2] * h[1] - w[1] * h[2] - s[0]
            u[1] = w[0] * h[2] - w[2] * h[0] - s[1]
            u[2] = w[1] * h[0] - w[0] * h[1] - s[2]
            loaded += 1.0
            for i in range(3):
                u[3 + i] = s[i]
                mean[i] += u[i]
                mean[3 + i] += s[i]
    lost = lost and loaded > 1.0
    spread = 0.0
    for k in range(own.shape[0]):
        for i in range(3):
            if c.loaded[k] != 0:
                off, still = own[k, i] - mean[i] / loaded, own[k, 3 + i] - mean[3 + i] / loaded
                lost = lost and abs(off) < AGREE
                spread += (off * off - 4.0 * still * still) / loaded
    if loaded > 1.0:
        e.turning += min(e.period / AVERAGE, 1.0) * (min(max(spread, -1.0), 1.0) - e.turning)
    e.lost = e.lost + e.filter.period if lost else 0.0
    if e.lost >= LOST:
        if not wrong:
            level(e)
            e.astray = 0
        _begin_anew(e, mean, 1.0 / loaded)
        e.lost = 0.0


@kernel
def _begin_anew(e: EstimatorRecord, velocity: Vector, share: float) -> None:
    """Take a share of a velocity of the inertial unit, body axes, m/s, and the biases of the start.

    Place and heading stay as they are.
    """
    f, r, p = e.filter, e.filter.rotation, e.filter.covariance
    for k in range(f.held.shape[0]):
        leave(f, k)
    for i in range(ERRORS):
        if not 6 <= i < 9:
            for j in range(p.shape[0]):
                p[i, j] = p[j, i] = 0.0
            p[i, i] = f.start[i] ** 2
    for i in range(3):
        anew = share * (r[i, 0] * velocity[0] + r[i, 1] * velocity[1] + r[i, 2] * velocity[2])
        p[6 + i, 6 + i] += ((f.velocity[i] - anew) * e.loose) ** 2
        f.velocity[i] = anew
        f.gyroscope_bias[i] = f.accelerometer_bias[i] = 0.0
        p[i, i], p[3 + i, 3 + i] = ANEW[0] ** 2 if i < 2 else 0.0, ANEW[1] ** 2


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
    if not LIGHT < e.gravity < HEAVY:
        return WEIGHTLESS
    if min(e.borne, e.up) < -UPRIGHT:
        return UPSIDE_DOWN
    f = e.filter
    if not BORNE < e.borne < BORNE + f.held.shape[0]:
        return UNLOADED
    if e.turning > TURNS * TURNS:
        return TURNING
    consistent = f.innovation <= INCONSISTENCY * EXPECTED and e.lost == 0.0 and e.astray == 0 and e.up > UPRIGHT
    unsure = e.loose > FLIGHT
    for i in range(3):
        consistent = consistent and abs(f.gyroscope_bias[i]) <= BIASED * f.start[9 + i]
        consistent = consistent and abs(f.accelerometer_bias[i]) <= SHAKEN * f.start[12 + i]
        unsure = unsure or not 0.0 < f.covariance[3 + i, 3 + i] <= KNOWN * KNOWN
    if not consistent:
        return INCONSISTENT
    if periods > 1.0:
        return GAP
    if unsure:
        return NO_FOOTHOLD if e.loose > 0.0 else UNSURE
    return GOOD
