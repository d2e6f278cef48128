"""Torque limits in the condensed program.

The torque of joint j is linear in the root's acceleration, in o and in the forces,

    τ_j = m_j a_r + t_j o + n_j − J_jᵀ f − J_tjᵀ u

with the limbs eliminated as in the root's equations. So a limit that binds is a seventh equation of
their kind, m_j a_r + n_j = J_jᵀ f + J_tjᵀ u − t_j o + s, where s is the torque at its limit
(:mod:`harpy_pin.wbc.optimum`). Only limits that the optimum without them violates enter. What gives
way to them is said in :mod:`harpy_pin.wbc.giving_way`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.condense import CondensationRecord
from harpy_pin.wbc.newton import NewtonRecord
from harpy_pin.wbc.optimum import BEYOND, enter_limit
from harpy_pin.wbc.targets import TargetsRecord


class TorqueLimitsRecord(RecordOf):
    """The torque limits that bind, and their equations."""

    joint: NDArray[np.int64] = sized("joints", whole=True)  # of each equation
    mass: Vector = sized("joints", 6)  # m_j of each
    free_map: Vector = sized("joints", "thrusts + others + 3 feet")  # −t_j
    # at which end each joint's torque was in the last tick: 0 at none, 1 at the lower one, 2 at the
    # upper one; and its multiplier then
    last_end: NDArray[np.int64] = sized("joints", whole=True)
    last_multiplier: Vector = sized("joints")


@kernel
def limit_of_joint(
    d: DynamicsRecord,
    t: TargetsRecord,
    e: CondensationRecord,
    m: TorqueLimitsRecord,
    v: Vector,
    k: int,
) -> float:
    """m_j and −t_j of limit k into its rows; returns n_j."""
    j, thrusts = 6 + m.joint[k], d.thruster_jacobian.shape[0]
    row, mass, free, first = d.mass_matrix[j], m.mass[k], m.free_map[k], thrusts + e.others.shape[0]
    bias: float = d.bias[j] + d.damping[j] * v[j]
    mass[:], free[:] = row[:6], 0.0
    if e.others.shape[0] > 0:
        free[thrusts:first] = -row[e.others]
        bias += row[e.others] @ e.posture
    rows = e.inverse.shape[2]
    for limb in range(e.limb.shape[0]):
        own = row[e.limb[limb]]
        bias += own @ e.limb_bias[limb]
        mass += own @ e.limb_map[limb]
        if t.held[rows * limb // 3] == 0.0:
            free[first + rows * limb : first + rows * (limb + 1)] = -(own @ e.inverse[limb])
    if e.centred:
        mass[:] = np.array(mass) @ e.root_per_centre
        bias -= mass[:3] @ e.centre_bias
        free += mass[:2] @ e.centre_free
    return bias


@kernel
def add_torque_limit(
    d: DynamicsRecord,
    t: TargetsRecord,
    e: CondensationRecord,
    m: TorqueLimitsRecord,
    n: NewtonRecord,
    v: Vector,
    limit: float,
    end: int,
) -> None:
    """The equation of the next limit, of the joint that is entered for it already."""
    k, at = n.limits, 6 + n.limits
    bias = limit_of_joint(d, t, e, m, v, k)
    body, free = e.inverse_body_weight * m.mass[k], e.inverse_weight * m.free_map[k]
    n.demand[at] = m.mass[k] @ e.desired + bias
    n.compliance[at, :6] = n.compliance[:6, at] = e.mass @ body + e.free_map.T @ free
    row, column = n.compliance[at, 6 : at + 1], n.compliance[6 : at + 1, at]
    row[:] = column[:] = m.mass[: k + 1] @ body + m.free_map[: k + 1] @ free
    n.force_map[:, at] = d.foot_jacobian[:, 6 + m.joint[k]]
    n.thrust_map[:, at] = d.thruster_jacobian[:, 6 + m.joint[k]]
    enter_limit(n, -limit, limit, end)


@kernel
def add_violated(
    d: DynamicsRecord,
    t: TargetsRecord,
    e: CondensationRecord,
    m: TorqueLimitsRecord,
    n: NewtonRecord,
    v: Vector,
    torque: Vector,
    limit: Vector,
) -> bool:
    """The limits that torques (joints,) violate; whether there are any."""
    before, violated = n.limits, False
    for j in range(torque.shape[0]):
        known = np.any(m.joint[:before] == j)
        if not known and abs(torque[j]) > limit[j] + BEYOND * (1.0 + limit[j]):
            violated = True
            m.joint[n.limits] = j
            n.multiplier[6 + n.limits] = 0.0
            add_torque_limit(d, t, e, m, n, v, limit[j], 1 if torque[j] < 0.0 else 2)
    return violated


@kernel
def begin_limits(
    d: DynamicsRecord,
    t: TargetsRecord,
    e: CondensationRecord,
    m: TorqueLimitsRecord,
    n: NewtonRecord,
    v: Vector,
    limit: Vector,
) -> None:
    """The limits at which the last tick ended, again."""
    for j in range(limit.shape[0]):
        if m.last_end[j] != 0:
            m.joint[n.limits], n.multiplier[6 + n.limits] = j, m.last_multiplier[j]
            add_torque_limit(d, t, e, m, n, v, limit[j], m.last_end[j])


@kernel
def note_limits(m: TorqueLimitsRecord, n: NewtonRecord) -> None:
    """Keep the limits at which this tick ended."""
    m.last_end[:] = 0
    for k in range(n.limits):
        m.last_end[m.joint[k]] = n.limit_piece[k]
        m.last_multiplier[m.joint[k]] = n.multiplier[6 + k]
