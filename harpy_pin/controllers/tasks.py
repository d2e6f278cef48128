"""References of the built-in tasks, from gait and gains: accelerations of body, feet and joints,
and the stance feet.

``tests/wbc/test_built_in_tasks.py`` has a table of these tasks.

**Ground that is not level.** Every formulation, the condensed program, the cones and the estimate
of the friction say z where they mean the normal. So Jacobian, drift, target and force of every foot
are expressed in its contact frame once, after the tasks are known, and what follows stays as it is.
The forces that are logged are in world axes again.

**Robots that fly on rotors.** A robot with nearly parallel rotors has thrust along one direction of
its body only. It accelerates sideways by tilting its thrust. With a_d the acceleration desired of
its body and g that of gravity, the thrust along the lift axis l (fixed to the body) has to be the
robot's mass times s = a_d − g, so the desired orientation has l along s: upright with the gait's
heading, then turned by the shortest way. Until it is reached, the thrust has only the part of s
along the present direction R l, and the desired acceleration is reduced to that: a = (s · R l) R l
+ g. This is the usual cascade of multirotors (Lee, Leok and McClamroch, "Geometric tracking control
of a quadrotor UAV on SE(3)", 2010), without the feedforward of the desired rotation. The horizontal
part of s is limited to a tilt of ``MAX_LEAN``, and its vertical part to at least half of gravity,
so that the robot never turns over to descend faster. Robots with thrust in all directions have this
limit, too: beyond what their rotors can do sideways they would lose their orientation.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.ground.contact_frame import (
    all_upward,
    contact_frames,
    is_level,
    to_contacts,
    to_worlds,
    turn_feet,
)
from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.entry import BAD, GOOD, MISFIT, all_finite, all_possible, all_possible_rows
from harpy_pin.model.record import RecordOf
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import update_terms
from harpy_pin.model.tree import TreeRecord
from harpy_pin.model.vectors import quaternion_product
from harpy_pin.wbc.targets import TargetsRecord, note_centre_drift

KNOWN_KNEE = 0.3
"""Velocity at which the dry friction of the model's joints is mostly there, rad/s: it is in the
bias forces as c tanh(v / ``KNOWN_KNEE``), along the motion and below c, so that it moves no joint
on its own.
"""
MAX_LEAN = 0.4
"""Largest angle between the thrust that is desired and the vertical, rad."""
BRAKE, MARGIN, NEAR, STIFFER = 150.0, 0.02, 0.7, 100.0
"""A joint on no limb has to come to rest within its range, ``MARGIN`` rad before its end. From a
share ``NEAR`` of the velocity on from which a deceleration of ``BRAKE`` rad/s² would do, its task
brakes, and weighs up to 1 + ``STIFFER`` times as much.
"""
LEAST_ROOM, MOST_FAST = 1e-4, 2.0
_SLOPE = float(np.tan(MAX_LEAN))


class TaskSettingsRecord(RecordOf):
    """Gains, ranges and posture of the tasks.

    Gains and ranges have the names of
    :class:`~harpy_pin.controllers.parameters.WholeBodyParameters`.
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
    # (2, joints) least and largest angle of the joints on no limb; infinite for those of limbs
    ends: Vector
    dry: Vector  # (joints,) dry friction that the model has, N·m; (0,) where it has none
    flat_feet: NDArray[np.int64]  # indices of the feet that are corners of flat ones
    flies: int  # 1 for a robot with rotors and no feet
    leans: int  # 1 where thrust has one direction in the body
    lift: Vector  # (3,) that direction, body axes; zero where there is none


class TasksRecord(RecordOf):
    """Terms, settings and tasks of a whole-body controller."""

    dynamics: DynamicsRecord  # terms of the equations of motion at the last state
    tasks: TaskSettingsRecord  # gains and ranges
    targets: TargetsRecord  # tasks of the last state


@kernel
def measured_terms(
    r: TasksRecord, g: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> int:
    """Terms of the measured q (nq,), v (nv,), with forces on the feet (feet, 3), N.

    Returns what state and targets are, see :mod:`harpy_pin.model.entry`.
    """
    d = r.dynamics
    if foot_force.shape != r.targets.feet.shape:
        return MISFIT
    verdict = update_terms(d, q, v)
    if verdict != GOOD:
        return verdict
    if not all_possible_rows(foot_force):
        return BAD
    known = 6 + r.tasks.dry.shape[0]
    d.bias[6:known] += r.tasks.dry * np.tanh(v[6:known] / KNOWN_KNEE)
    loops = d.tree.loops
    if loops.dry.shape[0] > 0:
        passive = loops.dry * np.tanh(loops.v[v.shape[0] :] / KNOWN_KNEE)
        d.bias[6:] += passive @ loops.spread[v.shape[0] - 6 :]
    if not (all_possible(g.body) and all_possible(g.heading)):
        return BAD if all_finite(g.body) and all_finite(g.heading) else MISFIT
    return GOOD if possible_feet(g) else BAD


@kernel(v="r.dynamics.bias")
def set_tasks(
    r: TasksRecord, g: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """Task accelerations, which feet are held, and the range of their normal forces.

    Where the ground is not level, what concerns feet is left in the frames of their contacts: there
    z is the normal.
    """
    d, p, t = r.dynamics, r.tasks, r.targets
    t.centred = 1 if g.centre_of_mass[0] != 0.0 else 0
    if t.centred:
        note_centre_drift(d, t)
    _body_targets(d.tree, g, p, t, q, v)
    t.joints[:] = p.posture[0] * (p.rest - q[7:]) - p.posture[1] * v[6:]
    _stay_in_range(p, t, q[7:], v[6:])
    t.force[:] = g.force
    level = is_level(g.normal)
    # A foot is held where it should be on the ground and is, or when it meets the ground early.
    push, expected = np.sum(g.normal * foot_force, axis=1), g.stance != 0.0
    below = _height_above(g, d.foot_position) <= 0.0
    touching = (push > p.contact_threshold) | (expected & below)
    t.held[:] = np.where(touching & (expected | (g.phase > 0.5)), 1.0, 0.0)
    hold_flat_feet(p.flat_feet, t.held)
    for k in range(t.held.shape[0]):
        if t.held[k] != 0.0 and g.load[k] != 0.0:
            t.feet[k] = -p.contact_damping * d.foot_velocity[k]
            load = share_of_load(g, k, p.double_support) * g.load[k]
            t.force_range[k] = load * p.min_normal_force, load * p.max_normal_force
        else:
            t.feet[k] = (
                g.body[6:]
                + g.foot_acceleration[k]
                + p.swing[0] * (g.body[:3] + g.foot_position[k] - d.foot_position[k])
                + p.swing[1] * (g.body[3:6] + g.foot_velocity[k] - d.foot_velocity[k])
            )
            t.force_range[k] = 0.0  # where it is held: a sole rolls, and lifts this corner
    t.tilted = 0
    if not level:
        turn_into_contacts(r, g, foot_force)


@kernel
def _stay_in_range(p: TaskSettingsRecord, t: TargetsRecord, angle: Vector, speed: Vector) -> None:
    """Let the tasks of joints brake whose end is near."""
    room = np.where(speed > 0.0, p.ends[1] - angle, angle - p.ends[0]) - MARGIN
    fast = abs(speed) / np.sqrt(2.0 * BRAKE * np.maximum(room, LEAST_ROOM))
    fast = np.minimum(fast, MOST_FAST)
    share = np.minimum(np.maximum(fast - NEAR, 0.0) / (1.0 - NEAR), 1.0)
    t.joints += share * (-np.copysign(BRAKE * fast * fast, speed) - t.joints)
    t.joint_share[:] = 1.0 + STIFFER * share * share


@kernel
def possible_feet(g: GaitTargetRecord) -> bool:
    """Whether the targets of all feet are numbers within ``MAX_SAMPLE``."""
    return (
        all_possible_rows(g.foot_position)
        and all_possible_rows(g.foot_velocity)
        and all_possible_rows(g.foot_acceleration)
        and all_possible_rows(g.tilt_rate)
        and all_possible_rows(g.force)
        and all_upward(g.normal)
        and all_possible(g.ground_height)
        and all_possible(g.up)
        and all_possible(g.load)
        and all_possible(g.centre_of_mass)
        and all_possible(g.world_frame_blend)
        and all_possible(g.stance)
        and all_possible(g.phase)
    )


@kernel
def hold_flat_feet(flat_feet: NDArray[np.int64], held: Vector) -> None:
    """Hold all corners of a flat foot where one is held; ``flat_feet`` is empty where all feet are
    points.
    """
    first = 0
    for n in range(flat_feet.shape[0]):
        corners = held[first : first + flat_feet[n]]
        corners[:] = np.max(corners)
        first += flat_feet[n]


@kernel
def _body_targets(
    tree: TreeRecord,
    g: GaitTargetRecord,
    p: TaskSettingsRecord,
    t: TargetsRecord,
    q: Vector,
    v: Vector,
) -> None:
    """Accelerations of the body's position and orientation."""
    rotation = tree.rotation
    t.body[:] = (
        g.body[6:] + p.body[0] * (g.body[:3] - q[:3]) + p.body[1] * (g.body[3:6] - rotation @ v[:3])
    )
    # The body's quaternion, turned back by what the target has: heading and tilt.
    turned = np.array(q[3:7])
    if p.flies:
        limit_push(tree.gravity, t.body)
    if p.leans:
        lean(rotation, tree.gravity, p.lift, g.heading[0], t.body, turned)
    if g.up[0] != 0.0 or g.up[1] != 0.0:  # the smallest rotation to the target's z axis
        c = np.sqrt(0.5 * (1.0 + g.up[2]))
        turned[:] = quaternion_product(
            np.array([0.5 * g.up[1] / c, -0.5 * g.up[0] / c, 0.0, c]), turned
        )
    if g.heading[0] != 0.0:
        half = 0.5 * g.heading[0]
        turned[:] = quaternion_product(np.array([0.0, 0.0, -np.sin(half), np.cos(half)]), turned)
    norm = np.sqrt(turned[:3] @ turned[:3])
    scale = 2.0 * np.arctan2(norm, abs(turned[3])) / norm if norm > 1e-9 else 2.0
    error = (scale if turned[3] >= 0.0 else -scale) * turned[:3]  # the rotation vector
    vertical = rotation[2]  # in body axes
    spin = v[3:6] - g.heading[1] * vertical - rotation[:2].T @ g.tilt_rate[0]
    t.orientation[:] = g.heading[2] * vertical - p.orientation[0] * error - p.orientation[1] * spin
    t.orientation += rotation[:2].T @ g.tilt_rate[1]


@kernel
def share_of_load(g: GaitTargetRecord, k: int, double_support: float) -> float:
    """Share of the load on a stance foot: it grows over the double support that begins a stance,
    falls at its end.
    """
    if g.stance[k] == 0.0:
        return 0.1
    if double_support <= 0.0:
        return 1.0
    rise = g.phase[k] * (1.0 + double_support) / double_support
    fall = (1.0 - g.phase[k]) * (1.0 + double_support) / double_support
    return float(max(min(rise, fall, 1.0), 0.05))


@kernel
def _height_above(g: GaitTargetRecord, place: Vector) -> Vector:
    """Distance (feet,) of the feet from the ground's tangent planes at their targets, m."""
    off = place - g.body[:3] - g.foot_position
    off[:, 2] = place[:, 2] - g.ground_height
    distance: Vector = np.sum(g.normal * off, axis=1)
    return distance


@kernel
def turn_into_contacts(r: TasksRecord, g: GaitTargetRecord, foot_force: Vector) -> None:
    """Terms, targets, planned and measured forces of the feet, of world axes, in the frames of
    their contacts.
    """
    d, t = r.dynamics, r.targets
    contact_frames(g.normal, t.frame)
    _one_frame_for_a_sole(r)
    turn_feet(d, t.frame)
    t.measured[:] = foot_force
    to_contacts(t.frame, t.measured)
    to_contacts(t.frame, t.feet)
    to_contacts(t.frame, t.force)
    t.tilted = 1


@kernel
def _one_frame_for_a_sole(r: TasksRecord) -> None:
    """All corners of a flat foot have the frame of the first."""
    t, feet = r.targets, r.tasks.flat_feet
    first = 0
    for n in range(feet.shape[0]):
        t.frame[first : first + feet[n]] = t.frame[first] + 0.0
        first += feet[n]


@kernel
def forces_in_world(t: TargetsRecord, force: Vector) -> None:
    """Contact forces (3 feet,) in world axes, in place."""
    if t.tilted:
        to_worlds(t.frame, force.reshape((t.held.shape[0], 3)))


@kernel(gravity=(3,), body=(3,))
def limit_push(gravity: Vector, body: Vector) -> None:
    """Limit the thrust per mass s = a_d − g that ``body``, a_d in and out, needs: world axes, m/s²;
    with gravity.
    """
    weight = np.sqrt(gravity @ gravity)
    if weight == 0.0:
        return
    down = gravity / weight
    along = weight - body @ down
    across = body + (along - weight) * down
    along = max(along, 0.5 * weight)
    share = np.minimum(1.0, _SLOPE * along / np.maximum(np.sqrt(across @ across), 1e-12))
    body[:] = share * across - (along - weight) * down


@kernel(rotation=(3, 3), gravity=(3,), lift=(3,), body=(3,), quaternion=(4,))
def lean(
    rotation: Vector,
    gravity: Vector,
    lift: Vector,
    heading: float,
    body: Vector,
    quaternion: Vector,
) -> None:
    """Take the desired tilt out of the body's orientation, and what is out of reach now out of its
    acceleration.

    ``lift`` is l, ``heading`` the yaw of the upright body, ``body`` (3,) a_d in, after
    :func:`limit_push`, and a out, in world axes. ``quaternion`` is the body's, (x, y, z, w), in,
    and out turned back by the desired tilt: where the body has that tilt, this is the upright one
    with that heading.
    """
    desired = body - gravity
    length = np.sqrt(desired @ desired)
    if length < 1e-9:  # weightless, and no acceleration desired
        return
    present = rotation @ lift
    body[:] = gravity + (desired @ present) * present
    # The shortest turn from the upright body's lift axis a to the desired direction b: quaternion
    # (a × b, 1 + a · b).
    # It is undone by (b × a, 1 + a · b).
    c, s = np.cos(heading), np.sin(heading)
    a, b = (
        np.array([c * lift[0] - s * lift[1], s * lift[0] + c * lift[1], lift[2]]),
        desired / length,
    )
    back = np.array([*np.cross(b, a), 1.0 + a @ b])
    norm = np.sqrt(back @ back)
    if norm >= 1e-9:  # otherwise the lift axis points down: there is no shortest turn
        quaternion[:] = quaternion_product(back / norm, quaternion)
