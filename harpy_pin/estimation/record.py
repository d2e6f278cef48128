"""What the kernels of the estimator read and work in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector

ERRORS = 15
"""Errors before those of the footholds: rotation, velocity, position, biases of gyroscope and
accelerometer.
"""


class FilterRecord(RecordOf):
    """The invariant extended Kalman filter; vectors are in world axes unless said otherwise."""

    period: float  # since the last step, s
    gravity: Vector  # (3,) m/s²
    gyroscope_density: float  # white noise, rad/s/√Hz
    accelerometer_density: float  # m/s²/√Hz
    gyroscope_walk: float  # of the bias, rad/s/√s
    accelerometer_walk: float  # of the bias, m/s²/√s
    foothold_density: float  # of the velocity of a foot in stance, m/s/√Hz
    encoder_noise: float  # rad
    foothold_noise: float  # of a foot's position by kinematics, besides that of the encoders, m
    height_noise: (
        float  # of the ground's height under a foothold, m; infinite where it is not known
    )
    gate: float  # squared Mahalanobis distance from which on a foot has slipped
    start: Vector  # (15,) standard deviations at the start
    rotation: Vector = sized(3, 3)  # body axes to world
    velocity: Vector = sized(3)  # of the inertial unit, m/s
    position: Vector = sized(3)  # of the inertial unit, m
    rest: Vector = sized(3)  # that rounding took off it, m
    gyroscope_bias: Vector = sized(3)  # body axes, rad/s
    accelerometer_bias: Vector = sized(3)  # body axes, m/s²
    foothold: Vector = sized(
        "feet", 3
    )  # place of each foot in stance less that of the inertial unit, m
    held: NDArray[np.int64] = sized(
        "feet", whole=True
    )  # (feet,) 1 while a foothold is part of the filter
    covariance: Vector = sized("3 feet + 15", "3 feet + 15")  # of the errors
    work: Vector = sized("3 feet + 15", "3 feet + 15")
    rows: Vector = sized(3, "3 feet + 15")
    correction: Vector = sized("3 feet + 15")
    innovation: float  # low-passed squared Mahalanobis distance of three, of feet in stance


class ContactRecord(RecordOf):
    """Forces of the legs by their motor torques, and which feet touch the ground."""

    rate: float  # of the momentum observer, 1/s
    load: float  # normal force of a foot as likely in contact as not, share of the weight
    load_width: float  # by which the log-odds change by one, share of the weight
    prior: float  # log-odds of contact that the gait is sure of
    foot_speed: float  # at which the log-odds of contact have fallen by one, m/s
    rest: float  # log-odds of contact of a foot at rest where the ground is, late in its swing
    rest_speed: float  # from which on it is not at rest, m/s
    near: float  # distance from the ground below which it is there, m
    damping: float  # that makes the forces of singular legs finite, m²
    weight: Vector  # (feet,) of the robot, N, divided by how many contact points each foot has
    of_sole: NDArray[np.int64]  # (feet,) 1 for a contact point of a flat foot
    # (legs, joints) columns in v of the joints that no other leg has; −1 beyond the last
    leg_joints: NDArray[np.int64]
    leg_feet: NDArray[np.int64]  # (legs, feet) contact points of each leg; −1 beyond the last
    left: Vector = sized("nv")  # forces that motors and thrusters do not explain, N and N·m
    external: Vector = sized("joints")  # torques of the contact forces, N·m
    residual: Vector = sized(
        "joints"
    )  # the same with those that the model of the joints lacks, low-passed, N·m
    motion: Vector = sized("joints", 3)  # acceleration, velocity and its smooth sign, low-passed
    sums: Vector = sized(
        "joints", 9
    )  # of the products of these and the residual, while a leg swings
    joint: Vector = sized(
        "joints", 3
    )  # armature, damping, dry friction that the model lacks: kg m², N·m·s/rad, N·m
    force: Vector = sized("feet", 3)  # of the ground on each foot, world, N
    probability: Vector = sized("feet")  # of contact
    since: Vector = sized("feet")  # for how long each foot has been in contact, s
    unlearned: float  # time since the last sample of what follows, s
    skid: float  # mean square speed of feet that land, m²/s²
    # sums of the products of tangential force, rolling and slip
    slips: Vector = sized(5)
    creep: float  # speed of a foot that a tangential force of the weight pulls, m/s
    sunk: float  # share of the radius of round feet that soft ground takes
    share: Vector = sized("feet")  # of the force that is believed
    loaded: NDArray[np.int64] = sized(
        "feet", whole=True
    )  # (feet,) 1 where force and gait alone say contact
    velocity: Vector = sized("nv")  # of the last step
    acceleration: Vector = sized("nv")  # of this step


class EstimatorRecord(RecordOf):
    """All of it."""

    filter: FilterRecord
    contact: ContactRecord
    dynamics: DynamicsRecord
    mounting: Vector  # (3, 3) axes of the inertial unit to the body's
    place: Vector  # (3,) of the inertial unit in the body, body axes, m
    angle_place: NDArray[np.int64]  # (joints,) of each joint in q
    unbounded: NDArray[np.int64]  # (joints,) 1 for a joint whose q is a cosine and a sine
    foot_radius: Vector  # (feet,) of round feet, m
    gyroscope_range: float  # rad/s
    accelerometer_range: float  # m/s²
    period: float  # at which steps are expected, s
    t: float  # of the last step, s; NaN before the first
    level: int  # 1 where the first sample says how the body is tilted
    begun: int = ZERO  # 1 from the first good sample on
    saturated: int = ZERO
    thrust: Vector = sized("thrusts")  # variables of the thrusters since the last step, N
    intended: Vector = sized(
        "nv"
    )  # acceleration that the controller intends, NaN where there is none
    weight: float  # of the robot, N
    status: int = ZERO
    same_in_a_row: int = ZERO
    late_in_a_row: int = ZERO
    pauses_in_a_row: int = ZERO
    missing: float  # periods in a row without a good sample of the inertial unit
    felt: Vector = sized(
        6
    )  # means of accelerometer, and of forces of feet and thrusters per mass, body axes, m/s²
    gravity: float  # mean of the accelerometer as a share of gravity
    # share of the weight that feet and thrusters bear in the mean, along that of the accelerometer
    borne: float
    up: float  # cosine of the angle between the accelerometer's mean and the estimate's vertical
    # 1 while readings have been implausible, and the estimate has not begun anew since
    astray: int = ZERO
    turning: float  # mean square speed of loaded feet that only the gyroscope sees, m²/s²
    turned: float  # time for which it counts as contradicting the legs, s
    unread: float  # time since the joints were read, s
    read: Vector = sized(2, "joints")  # angles and velocities as they were then, rad and rad/s
    # changes of the angles less those by the velocities, over some tenths of a second, rad
    mismatch: Vector = sized("joints")
    unlike: float  # time for which joints are not read for that, s
    contested: float  # time for which innovations count as beyond their covariance, s
    settling: float  # time for which the velocity is not called known yet, s
    loose: float  # time since a foothold was measured, s
    # time for which loaded feet have agreed with each other, and not with the estimate, s
    lost: float
    angular_velocity: Vector = sized(3)  # body axes, less the bias, rad/s
    raw_angular_velocity: Vector = sized(3)  # of the last good sample, body axes, rad/s
    raw_acceleration: Vector = sized(3)  # of the last good sample, body axes, m/s²
    before: Vector = sized(6)  # both, of the sample before
    angular_acceleration: Vector = sized(3)  # body axes, rad/s²
    q: Vector  # (nq,) the estimate
    v: Vector = sized("nv")
    foot_position: Vector = sized("feet", 3)
    foot_velocity: Vector = sized("feet", 3)
    foot_force: Vector = sized("feet", 3)
    rolling: Vector = sized("feet", 3)  # velocities of the centres of feet that stand, world, m/s
    local_foot: Vector = sized("feet", 3)  # less the inertial unit, body axes, m
    local_speed: Vector = sized("feet", 3)  # against the body, body axes, m/s
