"""The tick of the governed controller: its legs, the parts that its phases call, and one kernel for
each governor.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from harpy_pin.controllers.parameters import GovernedParameters
from harpy_pin.controllers.tasks import possible_feet
from harpy_pin.controllers.tick import BAD_SAMPLE, VIOLATED, TickRecord, fading
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.governors.contact_force_kernels import ContactForceFilterRecord, answer_terms
from harpy_pin.governors.erg import ErgRecord, governed_update
from harpy_pin.governors.point_mass import Law
from harpy_pin.governors.rows import ForceRowsRecord
from harpy_pin.governors.thrust import (
    CentreGainsRecord,
    allocate,
    centre_feedback,
    limit_thrust,
    roll_yaw,
)
from harpy_pin.ground.contact_frame import is_level
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.contact_map import ContactMapRecord
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.entry import (
    BAD,
    GOOD,
    MISFIT,
    all_finite,
    all_possible,
    all_possible_rows,
    is_unit,
)
from harpy_pin.model.kinematics import LegGeometry, LegRecord, leg_inverse, leg_jacobian
from harpy_pin.model.record import ZERO, Records, fields, make_record, sized
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import body_rotation, update_terms

FULL = int(Law.FULL)
MAX_JOINT_RATE = 20.0
"""Largest joint velocity target, rad/s: near a straight leg the inverse Jacobian has no bound."""


class ControlRecord(CentreGainsRecord, TickRecord):
    """Settings, state and command of :class:`~harpy_pin.controllers.governed.GovernedController`,
    for kernels.
    """

    period: float  # between ticks, s
    reference_velocity: int  # whether x_r has the velocity ċ_t
    attitude_p: float  # of each thruster, N/rad
    attitude_d: float  # of each thruster, N·s/rad
    joint_p: Vector  # (6,) N·m/rad
    joint_i: Vector  # (6,) N·m/(rad·s)
    joint_d: Vector  # (6,) N·m·s/rad
    integral_limit: float  # N·m
    torque_limit: Vector  # (6,) N·m, infinite where there is none
    thrust_limit: float  # of each thruster, N; infinite where there is none
    measured: Vector = sized(9)  # (9,) [c; ċ; u]
    rotation: Vector = sized(3, 3)  # (3, 3) body to world
    reference: Vector = sized(6)  # (6,) x_r
    bent: Vector = sized(6)  # (6,) x_w after the contact-force filter
    joint_target: Vector = sized(6)  # (6,) rad
    integral: Vector = sized(6)  # (6,) N·m
    out_of_reach: Vector = sized(2)  # (2,) m
    tilted: int = ZERO  # 1 where the ground at a foot is not level
    started: int = ZERO  # 1 after the first good sample, at which the applied reference begins
    left: LegRecord  # geometry of the left leg
    right: LegRecord  # of the right one


def control_record(parameters: GovernedParameters, robot: Robot) -> Records[ControlRecord]:
    """A new :class:`ControlRecord`."""
    p, joints = parameters, parameters.joints
    left, right = (LegGeometry.from_robot(robot, foot).record for foot in robot.feet)
    limit = robot.thrust_limit if p.limits else np.inf
    return make_record(
        ControlRecord,
        robot.sizes,
        period=p.period,
        reference_velocity=p.reference_velocity,
        attitude_p=p.attitude.k_p,
        attitude_d=p.attitude.k_d,
        joint_p=joints.k_p * 2,
        joint_i=joints.k_i * 2,
        joint_d=joints.k_d * 2,
        integral_limit=joints.integral_limit,
        torque_limit=robot.torque_limit if p.limits else np.full(6, np.inf),
        thrust_limit=limit if p.thrust else 0.0,
        left=left,
        right=right,
        **fields(p.centre.record),
    )


@kernel
def measure(
    p: ControlRecord,
    goal: GaitTargetRecord,
    q: Vector,
    v: Vector,
    foot_position: Vector,
    foot_force: Vector,
) -> int:
    """Evaluate a sample; after a bad one the last command stays, and fades. Returns what the sample
    is.
    """
    p.verdict = _measure(p, goal, q, v, foot_position, foot_force)
    factor = fading(p)
    if p.verdict != GOOD:
        p.torque *= factor
        p.thrust *= factor
    return p.verdict


@kernel
def _measure(
    p: ControlRecord,
    goal: GaitTargetRecord,
    q: Vector,
    v: Vector,
    foot_position: Vector,
    foot_force: Vector,
) -> int:
    """x_r, [c; ċ; u] and the body's rotation; u is held while no foot is loaded. Returns what the
    sample is.
    """
    measured, rotation = p.measured, p.rotation
    if (
        q.shape != (13,)
        or v.shape != (12,)
        or foot_position.shape != (2, 3)
        or foot_force.shape != (2, 3)
    ):
        return MISFIT
    if not (all_possible(q) and all_possible(v) and is_unit(q)):
        return BAD
    if not (all_possible_rows(foot_position) and all_possible_rows(foot_force)):
        return BAD
    if not all_possible(goal.body) or goal.heading[0] != 0.0:
        return BAD if all_finite(goal.body) and goal.heading[0] == 0.0 else MISFIT
    if not possible_feet(goal):
        return BAD
    body_rotation(q, rotation)
    p.reference[:] = goal.body[:6]
    if not p.reference_velocity:
        p.reference[3:] = 0.0
    measured[:3] = q[:3]
    measured[3:6] = rotation @ v[:3]
    load = foot_force[:, 2]
    if np.sum(load) > 0.0:
        measured[6:] = load @ foot_position / np.sum(load)
    elif np.isnan(measured[6]):
        measured[6:] = 0.5 * (foot_position[0] + foot_position[1])  # no foot has been loaded yet
    p.tilted = 0 if is_level(goal.normal) else 1
    return GOOD


@kernel
def track_foot(
    k: int, p: ControlRecord, leg: LegRecord, goal: GaitTargetRecord, q: Vector, v: Vector
) -> None:
    """Inverse kinematics and joint PID of leg k."""
    point, motion, jacobian, j = np.empty(3), np.empty(3), np.empty((3, 3)), 3 * k
    _to_body(k, p, goal, v[3:6], point, motion)
    target, integral, limit = (
        p.joint_target[j : j + 3],
        p.integral[j : j + 3],
        p.torque_limit[j : j + 3],
    )
    p.out_of_reach[k] = leg_inverse(leg, point, target)
    leg_jacobian(leg, target, jacobian)
    rate = np.where(p.out_of_reach[k] > 0.0, 0.0, solve_three(jacobian, motion))
    error = target - q[7 + j : 10 + j]
    error_rate = np.clip(rate, -MAX_JOINT_RATE, MAX_JOINT_RATE) - v[6 + j : 9 + j]
    change = p.joint_i[j : j + 3] * error * p.period
    integral[:] = np.clip(integral + change, -p.integral_limit, p.integral_limit)
    torque = p.joint_p[j : j + 3] * error + integral + p.joint_d[j : j + 3] * error_rate
    p.torque[j : j + 3] = np.clip(torque, -limit, limit)


@kernel
def _to_body(
    k: int, p: ControlRecord, goal: GaitTargetRecord, spin: Vector, point: Vector, motion: Vector
) -> None:
    """The target of foot k in body axes, and its rate at constant ``world_frame_blend``.

    A stance foot (blend 0) follows its target in body axes: p. A swing foot (blend 1) follows it in
    the world, so that it lands where and when it should: Rᵀ (c_t + p − c).
    """
    position, velocity, blend = (
        goal.foot_position[k],
        goal.foot_velocity[k],
        goal.world_frame_blend[k],
    )
    place = p.rotation.T @ (goal.body[:3] + position - p.measured[:3])
    moving = p.rotation.T @ (goal.body[3:6] + velocity - p.measured[3:6]) - np.cross(spin, place)
    point[:] = (1.0 - blend) * position + blend * place
    motion[:] = (1.0 - blend) * velocity + blend * moving


@kernel
def solve_three(a: Vector, b: Vector) -> Vector:
    """a⁻¹ b for 3×3 a by Cramer's rule; zero where a is singular (a straight or folded leg)."""
    x, y, z = a[:, 0], a[:, 1], a[:, 2]
    adjugate = np.array([np.cross(y, z), np.cross(z, x), np.cross(x, y)])
    det = adjugate[0] @ x
    return np.where(abs(det) < 1e-9, 0.0, adjugate @ b / det)


@kernel
def actuate(
    p: ControlRecord,
    goal: GaitTargetRecord,
    applied: Vector,
    q: Vector,
    v: Vector,
    foot_force: Vector,
) -> None:
    """The command: thrusts from the applied reference, torques from the gait's feet."""
    thrusts(p, applied, v)
    track_foot(0, p, p.left, goal, q, v)
    track_foot(1, p, p.right, goal, q, v)


@kernel
def thrusts(p: ControlRecord, applied: Vector, v: Vector) -> None:
    """Thruster feedback, allocation and limit."""
    centre, angles = np.empty(3), np.empty(4)
    c, c_dot, foot = p.measured[:3], p.measured[3:6], p.measured[6:]
    centre_feedback(c - foot, c, c_dot, applied, FULL, p, centre)
    roll_yaw(p.rotation, v[3:6], angles)
    allocate(centre, p.rotation, angles, p.attitude_p, p.attitude_d, p.thrust)
    limit_thrust(p.thrust, p.thrust_limit)


@kernel
def limit_bent(p: ControlRecord, applied: Vector, bend: Vector) -> None:
    """Limit the changed command, and move x_w, by the least norm, to where K_p e + K_d ė grows by
    the change of the total thrust.
    """
    squared = p.k_pt * p.k_pt + p.k_dt * p.k_dt
    change = np.where(squared > 0.0, (bend[:3] + bend[3:6]) / squared, 0.0)
    p.bent[:3] = applied[:3] + p.k_pt * change
    p.bent[3:] = applied[3:] + p.k_dt * change
    p.torque[:] = np.clip(p.torque, -p.torque_limit, p.torque_limit)
    limit_thrust(p.thrust, p.thrust_limit)


@cache
def steps_of(actuate: Kernel[None]) -> dict[str, Kernel[int]]:
    """The kernels of a tick by governor, with a kernel that writes the command of an applied
    reference.
    """

    @kernel
    def plain_step(
        r: ControlRecord,
        target: GaitTargetRecord,
        q: Vector,
        v: Vector,
        foot_position: Vector,
        foot_force: Vector,
    ) -> int:
        """A tick without a governor: thruster law, inverse kinematics, joint PID; returns its
        status.
        """
        if measure(r, target, q, v, foot_position, foot_force) != GOOD:
            return BAD_SAMPLE
        actuate(r, target, r.reference, q, v, foot_force)
        return 0

    @kernel
    def paper_step(
        r: ControlRecord,
        target: GaitTargetRecord,
        q: Vector,
        v: Vector,
        foot_position: Vector,
        foot_force: Vector,
        governor: ErgRecord,
        rows: ForceRowsRecord,
    ) -> int:
        """A tick with the paper's governor of the reference; returns its status."""
        if measure(r, target, q, v, foot_position, foot_force) != GOOD:
            return BAD_SAMPLE
        if r.started == 0:
            governor.applied[:] = r.reference
            governor.repairing = 0.0
            r.started = 1
        verdict = governed_update(r.measured, r.reference, r.period, governor, rows)
        actuate(r, target, governor.applied, q, v, foot_force)
        return VIOLATED if verdict != 0 else 0

    @kernel
    def contact_step(
        r: ControlRecord,
        target: GaitTargetRecord,
        q: Vector,
        v: Vector,
        foot_position: Vector,
        foot_force: Vector,
        dynamics: DynamicsRecord,
        terms: ContactMapRecord,
        governor: ContactForceFilterRecord,
    ) -> int:
        """A tick without that governor, in front of the contact-force filter; returns its
        status.
        """
        if measure(r, target, q, v, foot_position, foot_force) != GOOD:
            return BAD_SAMPLE
        state = update_terms(dynamics, q, v)
        actuate(r, target, r.reference, q, v, foot_force)
        governor.normal[:] = target.normal
        excess = answer_terms(dynamics, terms, governor, state, v, foot_force, r.torque, r.thrust)
        limit_bent(r, r.reference, governor.bend)
        return VIOLATED if excess > 0.0 else 0

    return {"none": plain_step, "paper": paper_step, "filter": contact_step}
