"""One step of the estimator: from readings to a state."""

from __future__ import annotations

import numpy as np

from harpy_pin.estimation.contact import (
    LIKELY,
    contact_probability,
    learn_joints,
    leg_forces,
    observe_torques,
)
from harpy_pin.estimation.intended import feel_intended, is_intended, move_joints
from harpy_pin.estimation.invariant_filter import (
    begin_filter,
    leave,
    predict,
    slide,
    take_kinematics,
    touch_down,
)
from harpy_pin.estimation.plausibility import (
    BACKWARDS,
    BAD_TARGET,
    CONTESTED,
    EXPECTED,
    GOOD,
    INCONSISTENCY,
    LIGHT,
    NO_SAMPLE,
    PAUSES,
    SETTLES,
    SWING,
    believe_feet,
    compare,
    encoders_agree,
    judge,
    level,
    weigh,
)
from harpy_pin.estimation.record import EstimatorRecord
from harpy_pin.estimation.slip import learn_slip, looseness, roll_and_creep
from harpy_pin.kernels import kernel
from harpy_pin.model.entry import HOLD_TICKS, all_possible
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import place_bodies, point_terms, set_joint_angles

MOST_PERIODS = 100.0
"""Periods without a step that are made up for."""
LEAST = 0.05
"""Share of a period that the time must have gone on by."""
EXACT = 1e-6
"""Share of a period by which clocks of simulations are off: their periods are exact."""
DOUBT = (2.0, 20.0)
"""Error of angular velocity, rad/s, and acceleration, m/s², in a period without a good sample."""
SHORT, INTERPOLATED = 10.0, 0.1
"""Periods over which a line between two samples is as good as those between, and its share of that
error beyond.
"""
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

    ``normal_force`` (feet,) is that of foot sensors, N, NaN where there is none. Thrusts are in the
    record. Returns the status.
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
    e.before[:3], e.before[3:] = e.raw_angular_velocity, e.raw_acceleration
    unit = _read_unit(e, gyroscope, accelerometer)
    if e.begun == 0 and not unit:
        e.status = NO_SAMPLE
        return NO_SAMPLE
    e.t, e.late_in_a_row = t, 0
    told, intended = legs, is_intended(e)
    if legs:
        legs = encoders_agree(e, joint_position, joint_velocity)
    if intended and not unit:
        feel_intended(e)
    if legs:
        set_joint_angles(e.q, e.angle_place, e.unbounded, joint_position)
        e.v[6:] = joint_velocity
    elif intended:
        move_joints(e, stance, phase, ground_height)
    if e.begun == 0:
        _begin(e)
    else:
        _predict(e, periods)
        doubted = 0.0 if unit and not e.saturated else periods
        doubted *= AS_INTENDED if intended and not unit else 1.0
        e.missing = e.missing + doubted if doubted > 0.0 else 0.0
        _doubt(e, max(periods - SHORT, 0.0))
        _place_body(e)
    e.unread += e.filter.period
    e.settling = SETTLES if e.unread > SWING else e.settling - e.filter.period
    if legs:
        _accelerate(e)
        observe_torques(e.contact, e.dynamics, e.v, torque, e.thrust, e.unread)
        learn_joints(e.contact, stance, phase, e.filter.period)
        leg_forces(e.contact, e.dynamics)
        e.contact.force[:, 2] = np.where(
            abs(normal_force) < np.inf, normal_force, e.contact.force[:, 2]
        )
        weigh(e)
        contact_probability(e.contact, e.dynamics, stance, phase, ground_height)
        _use_feet(e)
        e.unread = 0.0
    _write_state(e)
    e.status = judge(e, unit and told, periods)
    return e.status


@kernel
def _read_unit(e: EstimatorRecord, gyroscope: Vector, accelerometer: Vector) -> bool:
    """Keep the inertial unit's sample in body axes; a bad one leaves the last one. Returns whether
    it was good.
    """
    if not (all_possible(gyroscope) and all_possible(accelerometer)):
        return False
    beyond = np.any(abs(gyroscope) >= e.gyroscope_range) | np.any(
        abs(accelerometer) >= e.accelerometer_range
    )
    e.saturated = 1 if beyond else 0
    w = e.mounting @ gyroscope
    same = np.all(w == e.raw_angular_velocity)
    if e.begun != 0:
        rate = (w - e.raw_angular_velocity) / e.filter.period
        e.angular_acceleration[:] = np.clip(rate, -MAX_ACCELERATION, MAX_ACCELERATION)
    e.raw_angular_velocity[:] = w
    e.raw_acceleration[:] = e.mounting @ accelerometer
    e.same_in_a_row = e.same_in_a_row + 1 if same else 0
    return True


@kernel
def _begin(e: EstimatorRecord) -> None:
    """The first step: with the tilt that the accelerometer says, and the lowest foot on the ground,
    where asked to.
    """
    begin_filter(e.filter)
    e.felt[:3], e.felt[3:] = e.raw_acceleration, e.raw_acceleration
    compare(e)
    if e.level:
        if e.gravity > LIGHT:
            level(e)
        _place_body(e)
        e.filter.position[2] -= np.min(e.dynamics.foot_position[:, 2])
    _place_body(e)
    e.contact.velocity[6:] = e.v[6:]
    e.begun = 1


@kernel
def _doubt(e: EstimatorRecord, gap: float) -> None:
    """Let rotation and velocity be less certain, after periods without a good sample and a gap of
    others.

    Over a gap the error may be as large as the difference between the samples at its ends.
    """
    p, t, jump = e.filter.covariance, e.period, e.raw_acceleration - e.before[3:]
    beyond = e.filter.innovation > INCONSISTENCY * EXPECTED
    e.contested = CONTESTED if beyond else max(e.contested - e.filter.period, 0.0)
    variance = e.missing + (1.0 if beyond else 0.0) + (INTERPOLATED * gap) ** 2
    p[:3, :3] += variance * (DOUBT[0] * t) ** 2 * np.eye(3)
    p[3:6, 3:6] += (variance * (DOUBT[1] * t) ** 2 + jump @ jump * (gap * t) ** 2) * np.eye(3)


@kernel
def _predict(e: EstimatorRecord, periods: float) -> None:
    """Go on to the time of the readings, by pieces of about a period: the samples that are missing
    lie on a line from the last one to the new one.
    """
    f, angular_velocity, acceleration = e.filter, e.raw_angular_velocity, e.raw_acceleration
    elapsed = f.period
    f.period = elapsed / periods
    for n in range(int(periods)):
        back = 1.0 - (n + 1.0) / periods
        w = angular_velocity + back * (e.before[:3] - angular_velocity)
        a = acceleration + back * (e.before[3:] - acceleration)
        e.angular_velocity[:] = w - f.gyroscope_bias
        roll_and_creep(e)
        predict(f, e.angular_velocity, a - f.accelerometer_bias, e.rolling)
    f.period = elapsed


@kernel
def _body_state(e: EstimatorRecord) -> None:
    """Configuration and velocity of the body from the filter's state of the inertial unit."""
    f, r = e.filter, e.filter.rotation
    e.angular_velocity[:] = e.raw_angular_velocity - f.gyroscope_bias
    e.v[:3] = r.T @ f.velocity - np.cross(e.angular_velocity, e.place)
    e.v[3:6] = e.angular_velocity
    e.q[:3] = f.position - r @ e.place
    _quaternion(r, e.q)


@kernel
def _place_body(e: EstimatorRecord) -> None:
    """Where body and feet are and how they move, by the filter and the joints."""
    _body_state(e)
    place_bodies(e.dynamics.tree, e.q, e.v)
    point_terms(e.dynamics, e.q)


@kernel
def _quaternion(r: Vector, q: Vector) -> None:
    """The quaternion of a rotation into q[3:7], of the two the one nearer to that which is
    there.
    """
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
    found = np.array([x, y, z, w])
    q[3:7] = found / np.copysign(np.sqrt(found @ found), found @ q[3:7])


@kernel
def _accelerate(e: EstimatorRecord) -> None:
    """Acceleration of all coordinates: of the body by the inertial unit, of the joints by
    differences.
    """
    f, c, w, turning = e.filter, e.contact, e.angular_velocity, e.angular_acceleration
    # Of the body's origin: a − α × o − ω × (ω × o) + Rᵀ g, less ω × v for components in body axes.
    turn = np.cross(turning, e.place) + np.cross(w, np.cross(w, e.place) + e.v[:3])
    felt = e.raw_acceleration - f.accelerometer_bias
    c.acceleration[:3] = felt + f.rotation.T @ f.gravity - turn
    c.acceleration[3:6] = turning
    rate = (e.v[6:] - c.velocity[6:]) / e.unread
    c.acceleration[6:] = np.clip(rate, -MAX_ACCELERATION, MAX_ACCELERATION)
    c.velocity[6:] = e.v[6:]


@kernel
def _use_feet(e: EstimatorRecord) -> None:
    """Correct by the feet that touch the ground; others, and those that slipped, are forgotten."""
    f, c, noise = e.filter, e.contact, np.empty((3, 3))
    _local_feet(e)
    believe_feet(e)
    if e.status == GOOD:
        learn_slip(e)
    e.loose += f.period
    for k in range(f.held.shape[0]):
        if f.held[k] != 0 and (c.probability[k] < LIKELY or e.unread > SWING):
            leave(f, k)
        c.since[k] = c.since[k] + f.period if c.probability[k] >= LIKELY else 0.0
        if c.probability[k] >= LIKELY:
            e.loose = 0.0
            _kinematic_noise(e, k, noise)
            place = e.local_foot[k]
            if f.held[k] != 0:
                slide(f, k, looseness(e, k))
                if not take_kinematics(f, k, place, noise):
                    touch_down(f, k, place, noise)
            else:
                touch_down(f, k, place, noise)


@kernel
def _local_feet(e: EstimatorRecord) -> None:
    """Place of the feet less that of the inertial unit, and their speeds against the body, in body
    axes.
    """
    d, r = e.dynamics, e.dynamics.tree.rotation
    place = (d.foot_position - e.q[:3]) @ r
    e.local_foot[:] = place - e.place
    e.local_speed[:] = d.foot_velocity @ r - e.v[:3] - np.cross(e.angular_velocity, place)


@kernel
def _kinematic_noise(e: EstimatorRecord, k: int, out: Vector) -> None:
    """Covariance of a foot's place by kinematics, world axes, m²."""
    f, jacobian = e.filter, e.dynamics.foot_jacobian[3 * k : 3 * k + 3, 6:]
    out[:] = f.encoder_noise**2 * (jacobian @ jacobian.T) + f.foothold_noise**2 * np.eye(3)


@kernel
def _write_state(e: EstimatorRecord) -> None:
    """The estimate, with the feet that belong to it."""
    _body_state(e)
    f, r = e.filter, e.filter.rotation
    speed = e.local_speed + e.v[:3] + np.cross(e.angular_velocity, e.local_foot + e.place)
    e.foot_position[:] = f.position + e.local_foot @ r.T
    e.foot_velocity[:] = speed @ r.T
    e.foot_force[:] = e.contact.share[:, None] * e.contact.force
