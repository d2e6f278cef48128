"""Limits of the joints: torques within those of the motors, and motion that stays within the range.

A limit is the range of a quantity x a + n − J_xᵀ f that is linear in accelerations and forces: of
a torque x is the joint's row of the mass matrix, of an acceleration a unit vector, without n and
forces. Only limits that the optimum without them violates enter it, each as one unknown ν more
(:mod:`harpy_pin.wbc.optimum`), and the elimination as a right-hand side. A range of an acceleration
yields by ``COMPLIANCE`` times ν: a joint whose motor is too weak to stop passes its end.

**Ends of a joint.** An acceleration of the period h is such that the joint keeps its largest
velocity, does not pass its end, and can still stop before it at the deceleration d:

    v + h a ≤ v_max,    v + h a ≤ √(2 d r),    r = q_max − ⅛ d h² − q − h v − ½ h² a

(Del Prete, Joint position and velocity bounds in discrete-time acceleration/torque control of robot
arms, 2018). The second one is quadratic in v + h a. A joint that stops within a period goes up to ⅛
d h² farther than one that brakes steadily.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.elimination import (
    ROOT,
    EliminationRecord,
    eliminate_last,
    last_equation,
)
from harpy_pin.wbc.condensed.limbs import LimbsRecord, limbs_equation, limbs_of_limit
from harpy_pin.wbc.newton import NewtonRecord
from harpy_pin.wbc.optimum import BEYOND, enter_limit

COMPLIANCE = 1e-6
"""By which a range of an acceleration yields, as that of contacts."""
CLIPPED = 1e-6
"""How far a torque must be beyond its range at last not to belong to the motion, relative to
1 + the limit.
"""


class LimitsRecord(RecordOf):
    """Ranges of torques and accelerations, and which of them bind."""

    torque_range: Vector  # (joints, 2) N m
    acceleration_range: Vector  # (joints, 2) of the last tick, rad/s²
    place: NDArray[np.int64]  # (joints,) of each joint in q
    position_range: Vector  # (joints, 2) rad; infinite for joints that turn without end
    velocity_limit: Vector  # (joints,) rad/s
    period: float  # of the ticks, s; zero where accelerations are not limited
    deceleration: float  # that every joint is capable of, rad/s²
    # of each limit in the equation: the joint's number, and for accelerations the number of joints
    # more
    bound: NDArray[np.int64] = sized("joints", whole=True)
    row: Vector = sized("nv")


@kernel
def joint_ends(m: LimitsRecord, q: Vector, v: Vector) -> None:
    """``acceleration_range`` at a state."""
    h, d = m.period, m.deceleration
    if h == 0.0:
        return
    for j in range(m.place.shape[0]):
        for end in range(2):
            sign = 1.0 if end == 1 else -1.0
            speed = sign * v[ROOT + j]
            room = sign * (m.position_range[j, end] - q[m.place[j]]) - 0.125 * d * h * h
            # u = v + h a: u² + d h u − d (2 room − h v) ≤ 0 for u ≥ 0
            reach = 0.25 * d * d * h * h + d * (2.0 * room - h * speed)
            fastest = np.sqrt(max(reach, 0.0)) - 0.5 * d * h
            fastest = min(max(fastest, 0.0), m.velocity_limit[j])
            # with a velocity that is too large already, as fast as it is capable of
            m.acceleration_range[j, end] = sign * max((fastest - speed) / h, -d)


@kernel
def begin_limits(
    m: LimitsRecord, d: DynamicsRecord, e: EliminationRecord, b: LimbsRecord, n: NewtonRecord
) -> None:
    """The limits at which the last tick ended, again."""
    last, joints, first = n.limits, m.place.shape[0], n.bare.shape[0]
    n.limits = 0
    for k in range(last):
        bound, end = m.bound[k], n.limit_piece[k]
        if end == 0:
            continue
        is_torque = bound < joints
        limit = m.torque_range[bound] if is_torque else m.acceleration_range[bound - joints]
        if abs(limit[end - 1]) < np.inf:
            n.multiplier[first + n.limits] = n.multiplier[first + k]
            add_limit(m, d, e, b, n, bound, end)


@kernel
def add_limit(
    m: LimitsRecord,
    d: DynamicsRecord,
    e: EliminationRecord,
    b: LimbsRecord,
    n: NewtonRecord,
    bound: int,
    end: int,
) -> None:
    """A limit into the elimination and the equation, at its lower end, 1, or its upper one, 2."""
    joints, at = m.place.shape[0], n.bare.shape[0] + n.limits
    k = at - ROOT
    m.bound[n.limits] = bound
    is_torque = bound < joints
    j = bound if is_torque else bound - joints
    if is_torque:
        m.row[:] = d.mass_matrix[ROOT + j]
    else:
        m.row[:] = 0.0
        m.row[ROOT + j] = 1.0
    bias = limbs_of_limit(b, k, m.row)
    eliminate_last(e, k, m.row)
    last_equation(e, k, n.compliance, n.demand)
    limbs_equation(b, k, n.compliance)
    n.demand[at] += bias
    if is_torque:
        n.demand[at] += e.bias[ROOT + j]
    else:
        n.compliance[at, at] += COMPLIANCE
    n.force_map[:, at] = np.where(is_torque, d.foot_jacobian[:, ROOT + j], 0.0)
    n.thrust_map[:, at] = np.where(is_torque, d.thruster_jacobian[:, ROOT + j], 0.0)
    limit = m.torque_range[j] if is_torque else m.acceleration_range[j]
    enter_limit(n, limit[0], limit[1], end)


@kernel
def add_violated(
    m: LimitsRecord,
    d: DynamicsRecord,
    e: EliminationRecord,
    b: LimbsRecord,
    n: NewtonRecord,
    torque: Vector,
) -> bool:
    """The limits that torques (joints,) and accelerations violate; whether there are any."""
    joints, violated = m.place.shape[0], False
    if n.limits == joints:
        begin_limits(m, d, e, b, n)  # without those that do not bind
    before = n.limits
    for bound in range(2 * joints):
        j = bound % joints
        value = torque[j] if bound < joints else e.acceleration[ROOT + j]
        lower, upper = m.torque_range[j] if bound < joints else m.acceleration_range[j]
        end = 0
        if value < lower - BEYOND * (1.0 + abs(lower)):
            end = 1
        elif value > upper + BEYOND * (1.0 + abs(upper)):
            end = 2
        known = np.any(m.bound[:before] == bound)
        if end != 0 and not known:
            violated = True
            if n.limits < joints:
                n.multiplier[n.bare.shape[0] + n.limits] = 0.0
                add_limit(m, d, e, b, n, bound, end)
    return violated


@kernel
def within_limits(m: LimitsRecord, torque: Vector) -> bool:
    """Whether torques (joints,) were within their ranges, to rounding; now they are."""
    lower, upper = m.torque_range[:, 0], m.torque_range[:, 1]
    above = torque >= lower - CLIPPED * (1.0 + abs(lower))
    within = bool(np.all(above & (torque <= upper + CLIPPED * (1.0 + abs(upper)))))
    torque[:] = np.clip(torque, lower, upper)
    return within
