"""What an estimator takes in the place of readings that are missing: the motion that the controller
intends.

Its optimum is an acceleration of all coordinates, which the command brings about where the model is
right. Over some tenths of a second, without any reading, the robot moves by that, and the
controller goes on as if it saw it.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.estimation.contact import LATEST
from harpy_pin.estimation.record import EstimatorRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.entry import all_possible
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import joint_angles, set_joint_angles

LONGEST = 0.5
"""Time without readings of the joints for which the intended motion is taken, s."""


@kernel
def is_intended(e: EstimatorRecord) -> bool:
    """Whether there is a motion to go on by."""
    return e.begun != 0 and e.unread < LONGEST and all_possible(e.intended)


@kernel
def feel_intended(e: EstimatorRecord) -> None:
    """What the inertial unit would have said, body axes."""
    f, w, o, a = e.filter, e.angular_velocity, e.place, e.intended
    e.raw_angular_velocity[:] = w + f.period * a[3:6] + f.gyroscope_bias
    e.raw_acceleration[:] = a[:3] + np.cross(w, e.v[:3] + np.cross(w, o)) + np.cross(a[3:6], o)
    e.raw_acceleration += f.accelerometer_bias - f.rotation.T @ f.gravity


@kernel
def move_joints(e: EstimatorRecord, stance: Vector, phase: Vector, ground_height: Vector) -> None:
    """Joints as intended, and the weight on the feet that the gait has in stance, or that have come
    down; its arrays (feet,) are those of a step.
    """
    t, c = e.filter.period, e.contact
    angle = joint_angles(e.q, e.angle_place, e.unbounded)
    angle += t * (e.v[6:] + 0.5 * t * e.intended[6:])
    set_joint_angles(e.q, e.angle_place, e.unbounded, angle)
    e.v[6:] += t * e.intended[6:]
    down = (phase >= LATEST) & (e.dynamics.foot_position[:, 2] < ground_height + c.near)
    c.share[:], c.force[:, :2] = np.where(down, 1.0, stance), 0.0
    c.force[:, 2] = c.share * c.weight * e.weight / np.maximum(float(c.weight @ c.share), c.weight)
