"""References of the built-in tasks, from gait and gains: accelerations of body, feet and joints, and the stance feet.

What these tasks are is in :mod:`harpy_pin.wbc.tasks.built_in`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.compiled import kernel
from harpy_pin.controllers.contacts import below_ground, load_on, target_tilt, turn_into_contacts
from harpy_pin.controllers.friction_estimator import FrictionRecord, friction_record, update_friction
from harpy_pin.controllers.joint_friction import (
    JointFrictionEstimateRecord,
    add_joint_friction,
    joint_friction_estimate,
)
from harpy_pin.controllers.parameters import WholeBodyParameters
from harpy_pin.controllers.thrust_tilt import lean, limit_push
from harpy_pin.gaits.gait import FullGait, GaitTargetRecord
from harpy_pin.ground.contact_frame import all_upward, is_level
from harpy_pin.model.dynamics import DynamicsRecord, dynamics_record, update_terms
from harpy_pin.model.entry import BAD, GOOD, MISFIT, all_finite, all_possible, all_possible_rows
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.state import Vector
from harpy_pin.wbc.weights import TargetsRecord, note_centre_drift, targets_record

if TYPE_CHECKING:
    from harpy_pin.model.tree import TreeRecord

__all__: list[str] = []


class TaskSettingsRecord(RecordOf):
    """Gains, ranges and posture of the tasks.

    Gains and ranges have the names of :class:`~harpy_pin.controllers.parameters.WholeBodyParameters`.
    """

    body: Vector
    orientation: Vector
    swing: Vector
    posture: Vector
    contact_damping: float
    min_normal_force: float
    max_normal_force: float
    contact_threshold: float
    double_support: float  # share of a step with both feet on the ground
    rest: Vector  # (joints,) posture, rad
    flat_feet: NDArray[np.int64]  # indices of the feet that are corners of flat ones
    flies: int  # 1 for a robot with rotors and no feet
    leans: int  # 1 where thrust has one direction in the body
    lift: Vector  # (3,) that direction, body axes; zero where there is none


class TasksRecord(RecordOf):
    """Terms, settings and tasks of a whole-body controller."""

    dynamics: DynamicsRecord  # terms of the equations of motion at the last state
    tasks: TaskSettingsRecord  # gains and ranges
    targets: TargetsRecord  # tasks of the last state
    friction: FrictionRecord  # the estimate of the friction
    joint_friction: JointFrictionEstimateRecord  # the estimate of the joints' friction


def tasks_record(
    gait: FullGait, parameters: WholeBodyParameters, kind: type[TasksRecord] = TasksRecord, **parts: ArrayLike
) -> Records[TasksRecord]:
    """A new :class:`TasksRecord`.

    Args:
        gait: where body and feet should be.
        parameters: gains and ranges of forces.
        kind: class of the record, with further parts.
        parts: these parts, by name.
    """
    robot, p = gait.robot, checks.instance("parameters", parameters, WholeBodyParameters)
    lift, feet = robot.lift_axis, len(robot.feet)
    tasks = make_record(
        TaskSettingsRecord,
        body=p.body,
        orientation=p.orientation,
        swing=p.swing,
        posture=p.posture,
        contact_damping=p.contact_damping,
        min_normal_force=p.min_normal_force,
        max_normal_force=p.max_normal_force,
        contact_threshold=p.contact_threshold,
        double_support=gait.double_support,
        rest=gait.initial_state()[0][7:],
        flat_feet=np.array(robot.flat_feet, dtype=np.int64),
        flies=np.int64(bool(robot.rotors) and not robot.feet),
        leans=np.int64(lift is not None),
        lift=np.zeros(3) if lift is None else lift,
    )
    return make_record(
        kind,
        robot.sizes,
        dynamics=dynamics_record(robot),
        tasks=tasks,
        targets=targets_record(robot),
        friction=friction_record(assumed=p.limits.mu, feet=feet, period=p.period, on=p.estimate_friction),
        joint_friction=joint_friction_estimate(robot, period=p.period, on=p.estimate_joint_friction),
        **parts,
    )


@kernel
def task_terms(r: TasksRecord, g: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector) -> int:
    """Terms, task accelerations, which feet are held, and the range of their normal forces.

    Where the ground is not level, what concerns feet is left in the frames of their contacts: there z is the normal.

    Args:
        r: element of a :class:`TasksRecord`.
        g: element of the gait's.
        q: (nq,) configuration.
        v: (nv,) generalised velocity.
        foot_force: (feet, 3) as measured, N.

    Returns:
        What the state is, see :mod:`harpy_pin.model.entry`.
    """
    d, p, t = r.dynamics, r.tasks, r.targets
    if foot_force.shape != t.feet.shape:
        return MISFIT
    verdict = update_terms(d, q, v)
    if verdict != GOOD:
        return verdict
    if not all_possible_rows(foot_force):
        return BAD
    if r.joint_friction.on:
        add_joint_friction(r.joint_friction, d, v, foot_force)
    if not (all_possible(g.body) and all_possible(g.heading)):
        return BAD if all_finite(g.body) and all_finite(g.heading) else MISFIT
    if not possible_feet(g):
        return BAD
    t.centred = 1 if g.centre_of_mass[0] != 0.0 else 0
    if t.centred:
        note_centre_drift(d, t)
    _body_targets(d.tree, g, p, t, q, v)
    for j in range(t.joints.shape[0]):
        t.joints[j] = p.posture[0] * (p.rest[j] - q[7 + j]) - p.posture[1] * v[6 + j]
    level = is_level(g.normal)
    for k in range(t.held.shape[0]):
        push = foot_force[k, 2] if level else load_on(g.normal[k], foot_force[k])
        below = d.foot_position[k, 2] <= g.ground_height[k] if level else below_ground(g, k, d.foot_position[k])
        touching = push > p.contact_threshold or (g.stance[k] != 0.0 and below)
        # A foot is held where it should be on the ground and is, or when it meets the ground early.
        t.held[k] = 1.0 if touching and (g.stance[k] != 0.0 or g.phase[k] > 0.5) else 0.0
    hold_flat_feet(p.flat_feet, t.held)
    for k in range(t.held.shape[0]):
        if t.held[k] != 0.0:
            for i in range(3):
                t.feet[k, i] = -p.contact_damping * d.foot_velocity[k, i]
            load = share_of_load(g, k, p.double_support) * g.load[k]
            t.force_range[k, 0] = load * p.min_normal_force
            t.force_range[k, 1] = load * p.max_normal_force
        else:
            for i in range(3):
                t.feet[k, i] = (
                    g.body[6 + i]
                    + g.foot_acceleration[k, i]
                    + p.swing[0] * (g.body[i] + g.foot_position[k, i] - d.foot_position[k, i])
                    + p.swing[1] * (g.body[3 + i] + g.foot_velocity[k, i] - d.foot_velocity[k, i])
                )
    t.tilted = 0
    if not level:
        turn_into_contacts(r, g, foot_force)
    if r.friction.on:
        if level:
            update_friction(r.friction, foot_force, d.foot_velocity, t.held)
        else:
            update_friction(r.friction, t.measured, d.foot_velocity, t.held)
        for k in range(t.held.shape[0]):
            t.friction[k] = r.friction.estimate[k]
    return GOOD


@kernel
def possible_feet(g: GaitTargetRecord) -> bool:
    """Whether the targets of all feet are numbers within ``MAX_SAMPLE``."""
    motion = all_possible_rows(g.foot_position) and all_possible_rows(g.foot_velocity)
    motion = motion and all_possible_rows(g.foot_acceleration)
    motion = motion and all_upward(g.normal) and all_possible(g.ground_height) and all_possible(g.up)
    motion = motion and all_possible(g.load) and all_possible(g.centre_of_mass) and all_possible(g.world_frame_blend)
    return motion and all_possible(g.stance) and all_possible(g.phase)


@kernel
def hold_flat_feet(flat_feet: NDArray[np.int64], held: Vector) -> None:
    """Hold all corners of a flat foot where one is held.

    Args:
        flat_feet: contact points of each foot; empty where all feet are points.
        held: (feet,) in and out.
    """
    first = 0
    for n in range(flat_feet.shape[0]):
        touching = 0.0
        for k in range(first, first + flat_feet[n]):
            touching = max(touching, held[k])
        for k in range(first, first + flat_feet[n]):
            held[k] = touching
        first += flat_feet[n]


@kernel
def _body_targets(
    tree: TreeRecord, g: GaitTargetRecord, p: TaskSettingsRecord, t: TargetsRecord, q: Vector, v: Vector
) -> None:
    """Accelerations of the body's position and orientation."""
    rotation = tree.rotation
    for i in range(3):
        velocity = rotation[i, 0] * v[0] + rotation[i, 1] * v[1] + rotation[i, 2] * v[2]
        t.body[i] = g.body[6 + i] + p.body[0] * (g.body[i] - q[i]) + p.body[1] * (g.body[3 + i] - velocity)
    # Rotation vector from the target body, which is upright and has a heading, to the body: from the quaternion.
    x, y, z, w = q[3], q[4], q[5], q[6]
    if p.flies:
        limit_push(tree.gravity, t.body)
    if p.leans:
        x, y, z, w = lean(rotation, tree.gravity, p.lift, g.heading[0], t.body, q[3:7])
    if g.up[0] != 0.0 or g.up[1] != 0.0:
        x, y, z, w = target_tilt(g.up, x, y, z, w)
    turn, change = g.heading[1], g.heading[2]
    if g.heading[0] != 0.0:
        c, s = np.cos(0.5 * g.heading[0]), np.sin(0.5 * g.heading[0])
        x, y, z, w = c * x + s * y, c * y - s * x, c * z - s * w, c * w + s * z
    sign = 1.0 if w >= 0.0 else -1.0
    norm = np.sqrt(x * x + y * y + z * z)
    scale = 2.0 * sign
    if norm > 1e-9:
        scale = 2.0 * sign * np.arctan2(norm, abs(w)) / norm
    vector = (x, y, z)
    for i in range(3):
        up = rotation[2, i]  # the vertical, in body axes
        error = -p.orientation[0] * scale * vector[i] - p.orientation[1] * (v[3 + i] - up * turn)
        t.orientation[i] = error + up * change


@kernel
def share_of_load(g: GaitTargetRecord, k: int, double_support: float) -> float:
    """Share of the load on a stance foot: it grows over the double support that begins a stance, and falls over the one
    that ends it."""
    if g.stance[k] == 0.0:
        return 0.1
    if double_support <= 0.0:
        return 1.0
    rise = g.phase[k] * (1.0 + double_support) / double_support
    fall = (1.0 - g.phase[k]) * (1.0 + double_support) / double_support
    return float(max(min(rise, fall, 1.0), 0.05))
