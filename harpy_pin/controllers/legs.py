"""One leg of the governed controller: inverse kinematics and joint PID."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.model.kinematics import LegRecord, leg_inverse, leg_jacobian
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.controllers.governed_tick import ControlRecord
    from harpy_pin.gaits.gait import GaitTargetRecord

MAX_JOINT_RATE = 20.0
"""Largest joint velocity target, rad/s: near a straight leg the inverse Jacobian has no bound."""


@kernel
def track_foot(k: int, p: ControlRecord, leg: LegRecord, goal: GaitTargetRecord, q: Vector, v: Vector) -> None:
    """Inverse kinematics and joint PID of leg k."""
    point, motion, jacobian, rate = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty(3)
    target = p.joint_target[3 * k : 3 * k + 3]
    _to_body(k, p, goal, v[3:6], point, motion)
    p.out_of_reach[k] = leg_inverse(leg, point, target)
    leg_jacobian(leg, target, jacobian)
    solve_three(jacobian, motion, rate)
    if p.out_of_reach[k] > 0.0:
        rate[:] = 0.0
    for i in range(3):
        j = 3 * k + i
        error = target[i] - q[7 + j]
        rate[i] = min(max(rate[i], -MAX_JOINT_RATE), MAX_JOINT_RATE)
        p.integral[j] += p.joint_i[j] * error * p.period
        p.integral[j] = min(max(p.integral[j], -p.integral_limit), p.integral_limit)
        u = p.joint_p[j] * error + p.integral[j] + p.joint_d[j] * (rate[i] - v[6 + j])
        p.torque[j] = min(max(u, -p.torque_limit[j]), p.torque_limit[j])


@kernel
def _to_body(k: int, p: ControlRecord, goal: GaitTargetRecord, spin: Vector, point: Vector, motion: Vector) -> None:
    """The target of foot k in body axes, and its rate at constant ``world_frame_blend``.

    A stance foot (blend 0) follows its target in body axes: p. A swing foot (blend 1) follows it in the world, so that
    it lands where and when it should: Rᵀ (c_t + p − c).
    """
    body, position, velocity, blend = goal.body, goal.foot_position[k], goal.foot_velocity[k], goal.world_frame_blend[k]
    for i in range(3):
        point[i] = 0.0
        motion[i] = 0.0
        for j in range(3):
            point[i] += p.rotation[j, i] * (body[j] + position[j] - p.measured[j])
            motion[i] += p.rotation[j, i] * (body[3 + j] + velocity[j] - p.measured[3 + j])
    cross = (
        spin[1] * point[2] - spin[2] * point[1],
        spin[2] * point[0] - spin[0] * point[2],
        spin[0] * point[1] - spin[1] * point[0],
    )
    for i in range(3):
        motion[i] = (1.0 - blend) * velocity[i] + blend * (motion[i] - cross[i])
        point[i] = (1.0 - blend) * position[i] + blend * point[i]


@kernel
def solve_three(a: Vector, b: Vector, x: Vector) -> None:
    """x = a⁻¹ b for 3×3 a by Cramer's rule; zero where a is singular (a straight or folded leg)."""
    c0 = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
    c1 = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
    c2 = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
    det = a[0, 0] * c0 + a[0, 1] * c1 + a[0, 2] * c2
    if abs(det) < 1e-9:
        x[:] = 0.0
        return
    x[0] = (b[0] * c0 + a[0, 1] * (b[2] * a[1, 2] - b[1] * a[2, 2]) + a[0, 2] * (b[1] * a[2, 1] - b[2] * a[1, 1])) / det
    x[1] = (a[0, 0] * (b[1] * a[2, 2] - b[2] * a[1, 2]) + b[0] * c1 + a[0, 2] * (a[1, 0] * b[2] - b[1] * a[2, 0])) / det
    x[2] = (a[0, 0] * (a[1, 1] * b[2] - b[1] * a[2, 1]) + a[0, 1] * (b[1] * a[2, 0] - a[1, 0] * b[2]) + b[0] * c2) / det
