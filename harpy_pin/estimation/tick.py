"""One step of the estimator: from readings to a state."""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.estimation.contact import LIKELY, contact_probability, learn_joints, leg_forces, observe_torques
from harpy_pin.estimation.intended import feel_intended, is_intended, move_joints
from harpy_pin.estimation.invariant_filter import begin_filter, leave, predict, slide, take_kinematics, touch_down
from harpy_pin.estimation.plausibility import (
    BACKWARDS,
    BAD_TARGET,
    LIGHT,
    NO_SAMPLE,
    PAUSES,
    SETTLES,
    believe_feet,
    compare,
    judge,
    level,
    weigh,
)
from harpy_pin.estimation.record import EstimatorRecord
from harpy_pin.model.entry import HOLD_TICKS, all_possible
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import update_terms

MOST_PERIODS = 100.0
"""Periods without a step that are made up for."""
LEAST = 0.05
"""Share of a period that the time must have gone on by."""
EXACT = 1e-6
"""Share of a period by which clocks of simulations are off: their periods are exact."""
SWING = 0.05
"""Time without readings of the joints in which a foot may have come to stand elsewhere, s."""
DOUBT = (2.0, 20.0)
"""Error of angular velocity, rad/s, and acceleration, m/s², in a period without a good sample."""
SHORT, INTERPOLATED = 10.0, 0.1
"""Periods over which a line between two samples is as good as those between, and its share of that error beyond."""
AS_INTENDED = 0.01
"""Share of the variance of that error where the motion is the intended one."""
MAX_ACCELERATION = 1e4
"""Of joints and body by differences, rad/s² and m/s²."""


@kernel(
    gyroscope=(3,),
    accelerometer=(3,),
    joint_position="e.unbounded",
    joint_velocity="e.unbounded",
    torque="e.unbounded",
    normal_force="e.foot_radius",
    stance="e.foot_radius",
    phase="e.foot_radius",
    ground_height="e.foot_radius",
)
def estimate(
    e: EstimatorRecord,
    t: float,
    gyroscope: Vector,
    accelerometer: Vector,
    joint_position: Vector,
    joint_velocity: Vector,
    torque: Vector,
    normal_force: Vector,
    stance: Vector,
    phase: Vector,
    ground_height: Vector,
) -> int:
    """One step; see :meth:`harpy_pin.estimation.estimator.Estimator.step`, whose arrays these are.

    ``normal_force`` (feet,) is that of foot sensors, N, NaN where there is none. Thrusts are in the record.
    Returns the status.
    """
    if not (all_possible(stance) and all_possible(phase) and all_possible(ground_height)):
        e.status = BAD_TARGET
        return BAD_TARGET
    legs = all_possible(joint_position) and all_possible(joint_velocity) and all_possible(torque)
    legs = legs and all_possible(e.thrust)
    if not abs(t) < np.inf or (not legs and e.begun == 0):
        e.status = NO_SAMPLE
        return NO_SAMPLE
    periods = 1.0
    if e.begun != 0:
        elapsed = t - e.t
        if elapsed < LEAST * e.period:
            e.late_in_a_row += 1
            if e.late_in_a_row > HOLD_TICKS:  # the clock was set back
                e.t, e.late_in_a_row = t, 0
            e.status = BACKWARDS
            return BACKWARDS
        e.pauses_in_a_row = e.pauses_in_a_row + 1 if elapsed > MOST_PERIODS * e.period else 0
        elapsed = min(elapsed, MOST_PERIODS * e.period) if e.pauses_in_a_row < PAUSES else e.period
        periods = max(np.floor(elapsed / e.period + 0.5), 1.0)
        exact = abs(elapsed - periods * e.period) <= EXACT * e.period
        e.filter.period = periods * e.period if exact else elapsed
    for i in range(3):
        e.before[i], e.before[3 + i] = e.raw_angular_velocity[i], e.raw_acceleration[i]
    unit = _read_unit(e, gyroscope, accelerometer)
    if e.begun == 0 and not unit:
        e.status = NO_SAMPLE
        return NO_SAMPLE
    e.t, e.late_in_a_row = t, 0
    intended = is_intended(e)
    if intended and not unit:
        feel_intended(e)
    if legs:
        _place_joints(e, joint_position, joint_velocity)
    elif intended:
        move_joints(e, stance)
    if e.begun == 0:
        _begin(e)
    else:
        _predict_all(e, periods)
        doubted = 0.0 if unit and not e.saturated else periods
        doubted *= AS_INTENDED if intended and not unit else 1.0
        e.missing = e.missing + doubted if doubted > 0.0 else 0.0
        _doubt(e, max(periods - SHORT, 0.0))
        _body_state(e)
        update_terms(e.dynamics, e.q, e.v)
    e.unread += e.filter.period
    e.settling = SETTLES if e.unread > SWING else e.settling - e.filter.period
    if legs:
        _accelerate(e)
        observe_torques(e.contact, e.dynamics, torque, e.thrust, e.unread)
        learn_joints(e.contact, stance, phase, e.filter.period)
        leg_forces(e.contact, e.dynamics)
        for k in range(normal_force.shape[0]):
            if abs(normal_force[k]) < np.inf:
                e.contact.force[k, 2] = normal_force[k]
        weigh(e)
        contact_probability(e.contact, e.dynamics, stance, phase, ground_height)
        _use_feet(e)
        e.unread = 0.0
    _write_state(e)
    e.status = judge(e, unit and legs, periods)
    return e.status


@kernel
def _read_unit(e: EstimatorRecord, gyroscope: Vector, accelerometer: Vector) -> bool:
    """Keep the inertial unit's sample in body axes; a bad one leaves the last one. Returns whether it was good."""
    if not (all_possible(gyroscope) and all_possible(accelerometer)):
        return False
    e.saturated = 0
    same, m, t = 1, e.mounting, e.filter.period
    for i in range(3):
        if abs(gyroscope[i]) >= e.gyroscope_range or abs(accelerometer[i]) >= e.accelerometer_range:
            e.saturated = 1
        w = m[i, 0] * gyroscope[0] + m[i, 1] * gyroscope[1] + m[i, 2] * gyroscope[2]
        a = m[i, 0] * accelerometer[0] + m[i, 1] * accelerometer[1] + m[i, 2] * accelerometer[2]
        if w != e.raw_angular_velocity[i]:
            same = 0
        if e.begun != 0:
            rate = min(max((w - e.raw_angular_velocity[i]) / t, -MAX_ACCELERATION), MAX_ACCELERATION)
            e.angular_acceleration[i] = rate
        e.raw_angular_velocity[i], e.raw_acceleration[i] = w, a
    e.same_in_a_row = e.same_in_a_row + 1 if same == 1 else 0
    return True


@kernel
def _begin(e: EstimatorRecord) -> None:
    """The first step: with the tilt that the accelerometer says, and the lowest foot on the ground, where asked to."""
    f, c = e.filter, e.contact
    begin_filter(f)
    for i in range(3):
        e.felt[i] = e.felt[3 + i] = e.raw_acceleration[i]
    compare(e)
    if e.level:
        if e.gravity > LIGHT:
            level(e)
        _body_state(e)
    update_terms(e.dynamics, e.q, e.v)
    if e.level:
        lowest = 0.0
        for k in range(e.foot_radius.shape[0]):
            height = e.dynamics.foot_position[k, 2]
            lowest = height if k == 0 else min(lowest, height)
        f.position[2] -= lowest
    _body_state(e)
    update_terms(e.dynamics, e.q, e.v)
    for j in range(6, e.v.shape[0]):
        c.velocity[j] = e.v[j]
    e.begun = 1


@kernel
def _doubt(e: EstimatorRecord, gap: float) -> None:
    """Let rotation and velocity be less certain, after periods without a good sample and a gap of others.

    Over a gap the error may be as large as the difference between the samples at its ends.
    """
    p, t, jump = e.filter.covariance, e.period, 0.0
    variance = e.missing + (INTERPOLATED * gap) ** 2
    for i in range(3):
        jump += (e.raw_acceleration[i] - e.before[3 + i]) ** 2
        p[i, i] += variance * (DOUBT[0] * t) ** 2
    for i in range(3):
        p[3 + i, 3 + i] += variance * (DOUBT[1] * t) ** 2 + jump * (gap * t) ** 2


@kernel
def _place_joints(e: EstimatorRecord, position: Vector, velocity: Vector) -> None:
    """Joint angles and velocities into the configuration."""
    for j in range(position.shape[0]):
        n = e.angle_place[j]
        if e.unbounded[j]:
            e.q[n], e.q[n + 1] = np.cos(position[j]), np.sin(position[j])
        else:
            e.q[n] = position[j]
        e.v[6 + j] = velocity[j]


@kernel
def _predict_all(e: EstimatorRecord, periods: float) -> None:
    """Go on to the time of the readings, by pieces of about a period: the samples that are missing lie on a line."""
    f = e.filter
    elapsed = f.period
    f.period = elapsed / periods
    for n in range(int(periods)):
        _predict(e, (n + 1.0) / periods)
    f.period = elapsed


@kernel
def _predict(e: EstimatorRecord, share: float) -> None:
    """Go on by a period, with the sample at that share of the way from the last one to the new one."""
    f, rolling = e.filter, np.zeros((e.foot_velocity.shape[0], 3))
    acceleration = np.empty(3)
    for i in range(3):
        back = 1.0 - share
        w = e.raw_angular_velocity[i] + back * (e.before[i] - e.raw_angular_velocity[i])
        a = e.raw_acceleration[i] + back * (e.before[3 + i] - e.raw_acceleration[i])
        e.angular_velocity[i] = w - f.gyroscope_bias[i]
        acceleration[i] = a - f.accelerometer_bias[i]
    for k in range(e.foot_radius.shape[0]):
        if e.foot_radius[k] > 0.0 and f.held[k] != 0:
            _roll(e, k, rolling[k])
    predict(f, e.angular_velocity, acceleration, rolling)


@kernel
def _roll(e: EstimatorRecord, k: int, out: Vector) -> None:
    """Velocity of the centre of a round foot that rolls on the level: ω × (0, 0, radius), world axes."""
    t, r, radius = e.dynamics.tree, e.filter.rotation, e.foot_radius[k]
    w = t.twist[e.dynamics.body[k]]
    x = r[0, 0] * w[3] + r[0, 1] * w[4] + r[0, 2] * w[5]
    y = r[1, 0] * w[3] + r[1, 1] * w[4] + r[1, 2] * w[5]
    out[0], out[1] = radius * y, -radius * x


@kernel
def _body_state(e: EstimatorRecord) -> None:
    """Configuration and velocity of the body from the filter's state of the inertial unit."""
    f, r, o = e.filter, e.filter.rotation, e.place
    for i in range(3):
        e.angular_velocity[i] = e.raw_angular_velocity[i] - f.gyroscope_bias[i]
    w = e.angular_velocity
    sx, sy, sz = w[1] * o[2] - w[2] * o[1], w[2] * o[0] - w[0] * o[2], w[0] * o[1] - w[1] * o[0]
    e.v[0] = r[0, 0] * f.velocity[0] + r[1, 0] * f.velocity[1] + r[2, 0] * f.velocity[2] - sx
    e.v[1] = r[0, 1] * f.velocity[0] + r[1, 1] * f.velocity[1] + r[2, 1] * f.velocity[2] - sy
    e.v[2] = r[0, 2] * f.velocity[0] + r[1, 2] * f.velocity[1] + r[2, 2] * f.velocity[2] - sz
    for i in range(3):
        e.q[i] = f.position[i] - r[i, 0] * o[0] - r[i, 1] * o[1] - r[i, 2] * o[2]
        e.v[3 + i] = w[i]
    _quaternion(r, e.q)


@kernel
def _quaternion(r: Vector, q: Vector) -> None:
    """The quaternion of a rotation into q[3:7], of the two the one nearer to that which is there."""
    x = np.sqrt(max(1.0 + r[0, 0] - r[1, 1] - r[2, 2], 0.0))
    y = np.sqrt(max(1.0 - r[0, 0] + r[1, 1] - r[2, 2], 0.0))
    z = np.sqrt(max(1.0 - r[0, 0] - r[1, 1] + r[2, 2], 0.0))
    w = np.sqrt(max(1.0 + r[0, 0] + r[1, 1] + r[2, 2], 0.0))
    if w >= max(x, y, z):
        x, y, z = (r[2, 1] - r[1, 2]) / w, (r[0, 2] - r[2, 0]) / w, (r[1, 0] - r[0, 1]) / w
    elif x >= max(y, z):
        y, z, w = (r[0, 1] + r[1, 0]) / x, (r[0, 2] + r[2, 0]) / x, (r[2, 1] - r[1, 2]) / x
    elif y >= z:
        x, z, w = (r[0, 1] + r[1, 0]) / y, (r[1, 2] + r[2, 1]) / y, (r[0, 2] - r[2, 0]) / y
    else:
        x, y, w = (r[0, 2] + r[2, 0]) / z, (r[1, 2] + r[2, 1]) / z, (r[1, 0] - r[0, 1]) / z
    norm = np.sqrt(x * x + y * y + z * z + w * w)
    if x * q[3] + y * q[4] + z * q[5] + w * q[6] < 0.0:
        norm = -norm
    q[3], q[4], q[5], q[6] = x / norm, y / norm, z / norm, w / norm


@kernel
def _accelerate(e: EstimatorRecord) -> None:
    """Acceleration of all coordinates: of the body by the inertial unit, of the joints by differences."""
    f, c, r, w, b, o = e.filter, e.contact, e.filter.rotation, e.angular_velocity, e.angular_acceleration, e.place
    # Of the body's origin: a − α × o − ω × (ω × o) + Rᵀ g, less ω × v for components in body axes.
    sx, sy, sz = w[1] * o[2] - w[2] * o[1], w[2] * o[0] - w[0] * o[2], w[0] * o[1] - w[1] * o[0]
    sx, sy, sz = sx + e.v[0], sy + e.v[1], sz + e.v[2]
    turn = np.empty(3)
    turn[0] = b[1] * o[2] - b[2] * o[1] + w[1] * sz - w[2] * sy
    turn[1] = b[2] * o[0] - b[0] * o[2] + w[2] * sx - w[0] * sz
    turn[2] = b[0] * o[1] - b[1] * o[0] + w[0] * sy - w[1] * sx
    for i in range(3):
        weight = r[0, i] * f.gravity[0] + r[1, i] * f.gravity[1] + r[2, i] * f.gravity[2]
        c.acceleration[i] = e.raw_acceleration[i] - f.accelerometer_bias[i] + weight - turn[i]
        c.acceleration[3 + i] = b[i]
    for j in range(6, e.v.shape[0]):
        difference = (e.v[j] - c.velocity[j]) / e.unread
        c.acceleration[j] = min(max(difference, -MAX_ACCELERATION), MAX_ACCELERATION)
        c.velocity[j] = e.v[j]


@kernel
def _use_feet(e: EstimatorRecord) -> None:
    """Correct by the feet that touch the ground; others, and those that slipped, are forgotten."""
    f, c, noise = e.filter, e.contact, np.empty((3, 3))
    _local_feet(e)
    believe_feet(e)
    e.loose += f.period
    for k in range(f.held.shape[0]):
        if f.held[k] != 0 and (c.probability[k] < LIKELY or e.unread > SWING):
            leave(f, k)
        if c.probability[k] >= LIKELY:
            e.loose = 0.0
            _kinematic_noise(e, k, noise)
            place = e.local_foot[k]
            if f.held[k] != 0:
                slide(f, k, 1.0 / c.probability[k])
                if not take_kinematics(f, k, place, noise):
                    touch_down(f, k, place, noise)
            else:
                touch_down(f, k, place, noise)


@kernel
def _local_feet(e: EstimatorRecord) -> None:
    """Place of the feet less that of the inertial unit, and their speeds against the body, in body axes."""
    d, r, o = e.dynamics, e.dynamics.tree.rotation, e.place
    for k in range(e.local_foot.shape[0]):
        x, y, z = d.foot_position[k, 0] - e.q[0], d.foot_position[k, 1] - e.q[1], d.foot_position[k, 2] - e.q[2]
        for i in range(3):
            e.local_foot[k, i] = r[0, i] * x + r[1, i] * y + r[2, i] * z - o[i]
        h, w, s = e.local_foot[k], e.angular_velocity, e.local_speed[k]
        x, y, z = h[0] + o[0], h[1] + o[1], h[2] + o[2]
        for i in range(3):
            s[i] = r[0, i] * d.foot_velocity[k, 0] + r[1, i] * d.foot_velocity[k, 1] + r[2, i] * d.foot_velocity[k, 2]
            s[i] -= e.v[i]
        s[0] -= w[1] * z - w[2] * y
        s[1] -= w[2] * x - w[0] * z
        s[2] -= w[0] * y - w[1] * x


@kernel
def _kinematic_noise(e: EstimatorRecord, k: int, out: Vector) -> None:
    """Covariance of a foot's place by kinematics, world axes, m²."""
    f, d = e.filter, e.dynamics
    for a in range(3):
        for b in range(3):
            s = 0.0
            for j in range(6, e.v.shape[0]):
                s += d.foot_jacobian[3 * k + a, j] * d.foot_jacobian[3 * k + b, j]
            out[a, b] = s * f.encoder_noise**2
        out[a, a] += f.foothold_noise**2


@kernel
def _write_state(e: EstimatorRecord) -> None:
    """The estimate, with the feet that belong to it."""
    _body_state(e)
    f, r, w = e.filter, e.filter.rotation, e.angular_velocity
    for k in range(e.local_foot.shape[0]):
        h, s, o = e.local_foot[k], e.local_speed[k], e.place
        x, y, z = h[0] + o[0], h[1] + o[1], h[2] + o[2]
        sx = s[0] + e.v[0] + w[1] * z - w[2] * y
        sy = s[1] + e.v[1] + w[2] * x - w[0] * z
        sz = s[2] + e.v[2] + w[0] * y - w[1] * x
        for i in range(3):
            e.foot_position[k, i] = f.position[i] + r[i, 0] * h[0] + r[i, 1] * h[1] + r[i, 2] * h[2]
            e.foot_velocity[k, i] = r[i, 0] * sx + r[i, 1] * sy + r[i, 2] * sz
            e.foot_force[k, i] = e.contact.share[k] * e.contact.force[k, i]
