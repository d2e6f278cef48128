"""What tasks and contacts ask for, written into the system that is eliminated.

A task of a frame or of joints asks for accelerations J a ≈ b with

    b = acceleration + k_p (reference − measured) + k_d (velocity − measured) − J̇ v

and adds Jᵀ W J to H and Jᵀ W b to g, on the path from the root to its body alone. One of the pose
of a frame relative to another has rows on two paths. They are eliminated last, as a limit is: each
is an unknown more in the search, x a = b + ν / w. The centre of
mass and the angular momentum about it follow from the wrench y on the root, m c̈ = R y_f + m g and
L̇ = R (y_m − c × y_f), so that their tasks are rows X of y. A contact asks for the acceleration
that brings its foot to rest, of a point or of a whole sole.

Motions are those of :mod:`harpy_pin.model.terms`: in the axes of the base and at its origin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.ground.contact_frame import to_contacts, turn_feet
from harpy_pin.kernels import diagonal, kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import unit_motion
from harpy_pin.model.tree import TreeRecord
from harpy_pin.model.vectors import log, skew
from harpy_pin.wbc.condensed.elimination import (
    ROOT,
    SIDES,
    TARGETS,
    EliminationRecord,
    eliminate_last,
    last_equation,
)
from harpy_pin.wbc.newton import NewtonRecord

MOMENTA = 6
"""Rows of the tasks of the centre of mass and of the angular momentum, which come first."""


class FrameTasksRecord(RecordOf):
    """Tasks of frames: rows of position, then orientation."""

    body: NDArray[np.int64]  # (frames,) that each is fixed to
    offset: Vector  # (frames, 3) its origin there, m
    turn: Vector  # (frames, 3, 3) its axes there
    local: NDArray[np.int64]  # (frames,) 1 where rows are in the frame's axes, 0 in the root's
    root: NDArray[np.int64]  # (frames,) body that each is relative to; −1 for the world
    root_offset: Vector  # (frames, 3) origin of the root there, m
    root_turn: Vector  # (frames, 3, 3) its axes there
    relative_task: NDArray[np.int64]  # (relative,) of each row of a relative task
    relative_row: NDArray[np.int64]  # (relative,) among the six of that task
    weight: Vector = sized("frames", 6)
    position: Vector = sized("frames", 3)  # m
    rotation: Vector = sized("frames", 3, 3)
    velocity: Vector = sized("frames", 6)
    acceleration: Vector = sized("frames", 6)
    stiffness: Vector = sized("frames", 6)  # k_p, 1/s²
    damping: Vector = sized("frames", 6)  # k_d, 1/s
    jacobian: Vector = sized(6, "width")  # of one frame, packed along its path
    other: Vector = sized(6, "width")  # of the body that it is relative to
    row: Vector = sized("nv")  # of a relative task
    velocity_now: Vector = sized(6)  # of one frame
    drift: Vector = sized(6)  # J̇ v of one frame
    wanted: Vector = sized(6)  # b of one frame


class JointTasksRecord(RecordOf):
    """Tasks of joints, one row for each."""

    column: NDArray[np.int64]  # (joint_rows,) of each joint in v
    place: NDArray[np.int64]  # (joint_rows,) of its angle in q
    unbounded: NDArray[np.int64]  # (joint_rows,) 1 where a cosine and a sine are there
    weight: Vector = sized("joint_rows")
    position: Vector = sized("joint_rows")  # rad
    velocity: Vector = sized("joint_rows")
    acceleration: Vector = sized("joint_rows")
    stiffness: Vector = sized("joint_rows")
    damping: Vector = sized("joint_rows")


class MomentumTasksRecord(RecordOf):
    """Tasks of the centre of mass and of the angular momentum about it, world axes."""

    position: Vector = sized(3)  # of the centre of mass, m
    velocity: Vector = sized(3)
    acceleration: Vector = sized(3)
    stiffness: Vector = sized(3)
    damping: Vector = sized(3)
    momentum: Vector = sized(3)  # angular, kg m²/s
    rate: Vector = sized(3)  # N m
    gain: Vector = sized(3)  # 1/s


class ContactsRecord(RecordOf):
    """Feet that may be held: points, or soles of several."""

    body: NDArray[np.int64]  # (contacts,) that each is fixed to
    offset: Vector  # (contacts, 3) the point, or the middle of the sole, there, m
    first_row: NDArray[np.int64]  # (contacts,) of each in the elimination
    row_count: NDArray[np.int64]  # (contacts,) three of a point, six of a sole
    first_point: NDArray[np.int64]  # (contacts + 1,) of each among the contact points
    held: Vector = sized("contacts", fill=1.0)  # 1 where the foot is on the ground
    acceleration: Vector = sized("contacts", 6)  # wanted besides, world axes
    damping: float  # of the foot's velocity, 1/s
    compliance: float  # ρ
    frame: Vector = sized(
        "feet", 3, 3
    )  # axes of each point's contact in the world; the third is the normal


@kernel
def frame_terms(
    t: TreeRecord, e: EliminationRecord, f: FrameTasksRecord, i: int, p: Vector, axes: Vector
) -> None:
    """Jacobian, velocity and drift of a frame at p of body i, base axes, in ``axes`` (3, 3) given
    there.
    """
    end, twist, drift = t.end[i], t.twist[i], t.drift[i]
    velocity = twist[:3] + np.cross(twist[3:], p)
    f.velocity_now[:3], f.velocity_now[3:] = axes.T @ velocity, axes.T @ twist[3:]
    lifted = drift[:3] + t.rotation.T @ t.gravity
    f.drift[:3] = axes.T @ (lifted + np.cross(drift[3:], p) + np.cross(twist[3:], velocity))
    f.drift[3:] = axes.T @ drift[3:]
    f.jacobian[:3, :3], f.jacobian[:3, 3:6] = axes.T, axes.T @ skew(p).T
    f.jacobian[3:, :3], f.jacobian[3:, 3:6] = 0.0, axes.T
    for n in range(ROOT, e.depth[end] + 1):
        s = unit_motion(t, i, e.path[end, n])
        f.jacobian[:3, n] = axes.T @ (s[:3] + np.cross(s[3:], p))
        f.jacobian[3:, n] = axes.T @ s[3:]


@kernel
def frame_rows(
    d: DynamicsRecord, e: EliminationRecord, f: FrameTasksRecord, n: int, q: Vector
) -> None:
    """Rows of task n of the frames, and b.

    Relative to a frame, they are the rows of the one body less those of the other at the same
    point.
    """
    t, i, root = d.tree, f.body[n], f.root[n]
    p, turn = t.position[i] + t.axes[i] @ f.offset[n], t.axes[i] @ f.turn[n]
    origin, own, axes = np.empty((3,)), np.empty((3, 3)), np.empty((3, 3))
    error, velocity, drift = np.empty((6,)), np.empty((6,)), np.empty((6,))
    if root < 0:
        origin[:], own[:] = -(t.rotation.T @ q[:3]), t.rotation.T
    else:
        origin[:] = t.position[root] + t.axes[root] @ f.root_offset[n]
        own[:] = t.axes[root] @ f.root_turn[n]
    axes[:] = turn if f.local[n] else own
    if root >= 0:
        frame_terms(t, e, f, root, p, axes)
        f.other[:], velocity[:], drift[:] = f.jacobian, f.velocity_now, f.drift
    frame_terms(t, e, f, i, p, axes)
    if root >= 0:
        f.velocity_now -= velocity
        f.drift[:3] -= drift[:3] + 2.0 * np.cross(velocity[3:], f.velocity_now[:3])
        f.drift[3:] -= drift[3:] + np.cross(velocity[3:], f.velocity_now[3:])
    error[:3] = axes.T @ (origin + own @ f.position[n] - p)
    error[3:] = axes.T @ own @ log(f.rotation[n] @ turn.T @ own)
    f.wanted[:] = f.acceleration[n] + f.damping[n] * (f.velocity[n] - f.velocity_now) - f.drift
    f.wanted += f.stiffness[n] * error


@kernel
def add_frame(
    d: DynamicsRecord, e: EliminationRecord, f: FrameTasksRecord, n: int, q: Vector
) -> None:
    """Task n of the frames, unless it is relative to a frame."""
    if f.root[n] < 0:
        frame_rows(d, e, f, n, q)
        for r in range(6):
            if f.weight[n, r] != 0.0:
                add_row(e, f.jacobian[r], d.tree.end[f.body[n]], f.weight[n, r], f.wanted[r])


@kernel
def add_relative(
    d: DynamicsRecord, e: EliminationRecord, f: FrameTasksRecord, n: NewtonRecord, q: Vector
) -> None:
    """All rows of relative tasks, x a = b + ν / weight, after :func:`root_equations`."""
    t = d.tree
    for k in range(f.relative_task.shape[0]):
        i, r, at = f.relative_task[k], f.relative_row[k], ROOT + k
        if k == 0 or f.relative_task[k - 1] != i:
            frame_rows(d, e, f, i, q)
        end, other = t.end[f.body[i]], t.end[f.root[i]]
        f.row[:] = 0.0
        for j in range(e.depth[end] + 1):
            f.row[e.path[end, j]] += f.jacobian[r, j]
        for j in range(e.depth[other] + 1):
            f.row[e.path[other, j]] -= f.other[r, j]
        eliminate_last(e, k, f.row)
        last_equation(e, k, n.compliance, n.demand)
        n.demand[at] -= f.wanted[r]
        n.compliance[at, at] += 1.0 / max(f.weight[i, r], 1e-30)


@kernel
def add_row(e: EliminationRecord, row: Vector, end: int, weight: float, wanted: float) -> None:
    """A row, packed along the path to degree of freedom ``end``, with a weight: to H and g."""
    for n in range(e.depth[end] + 1):
        k, share = e.path[end, n], weight * row[n]
        e.matrix[k, SIDES : SIDES + n + 1] += share * row[: n + 1]
        e.matrix[k, TARGETS] -= share * wanted


@kernel
def add_joints(e: EliminationRecord, j: JointTasksRecord, q: Vector, v: Vector) -> None:
    """All tasks of joints."""
    for n in range(j.column.shape[0]):
        k, place = j.column[n], j.place[n]
        error = j.position[n] - q[place]
        if j.unbounded[n]:
            cosine, sine = np.cos(j.position[n]), np.sin(j.position[n])
            error = np.arctan2(
                sine * q[place] - cosine * q[place + 1], cosine * q[place] + sine * q[place + 1]
            )
        wanted = j.acceleration[n] + j.stiffness[n] * error + j.damping[n] * (j.velocity[n] - v[k])
        e.matrix[k, SIDES + e.depth[k]] += j.weight[n]
        e.matrix[k, TARGETS] -= j.weight[n] * wanted


@kernel
def momentum_rows(
    d: DynamicsRecord, m: MomentumTasksRecord, n: NewtonRecord, q: Vector, v: Vector
) -> None:
    """X and h of the tasks of momentum."""
    t, mass = d.tree, d.tree.moment[0, 0]
    r, centre, momentum = t.rotation, t.moment[0, 1:] / mass, d.mass_matrix[:6] @ v
    n.momentum_map[:3, :3], n.momentum_map[:3, 3:] = r / mass, 0.0
    n.momentum_map[3:MOMENTA, :3], n.momentum_map[3:MOMENTA, 3:] = -(r @ skew(centre)), r
    n.momentum_target[:3] = (
        m.acceleration - t.gravity + m.damping * (m.velocity - r @ momentum[:3] / mass)
    )
    n.momentum_target[:3] += m.stiffness * (m.position - q[:3] - r @ centre)
    n.momentum_target[3:MOMENTA] = m.rate + m.gain * (
        m.momentum - r @ (momentum[3:] - np.cross(centre, momentum[:3]))
    )


@kernel
def add_contact(
    d: DynamicsRecord, e: EliminationRecord, f: FrameTasksRecord, c: ContactsRecord, k: int
) -> None:
    """Rows of foot k; zero where it is not held. ``f`` is work space."""
    t, i, first, last = d.tree, c.body[k], c.first_row[k], c.first_row[k] + c.row_count[k]
    e.rows[first:last] = 0.0
    if c.held[k] == 0.0:
        return
    frame_terms(t, e, f, i, t.position[i] + t.axes[i] @ c.offset[k], t.rotation.T)
    f.wanted[:] = c.acceleration[k] - c.damping * f.velocity_now - f.drift
    width = e.depth[t.end[i]] + 1
    for r in range(last - first):
        e.rows[first + r, SIDES : SIDES + width] = f.jacobian[r, :width]
        e.rows[first + r, TARGETS] = -f.wanted[r]


@kernel
def contact_forces_map(
    d: DynamicsRecord, c: ContactsRecord, n: NewtonRecord, planned: Vector
) -> None:
    """Gᵀ of contact forces and their plan, in the axes of their contacts, and Gᵀ of thrusts."""
    for k in range(c.held.shape[0]):
        n.held[c.first_point[k] : c.first_point[k + 1]] = c.held[k]
    n.planned[:] = planned
    if not upright(c.frame):
        turn_feet(d, c.frame)
        to_contacts(c.frame, n.planned.reshape((n.held.shape[0], 3)))
    n.force_map[:, :6] = d.foot_jacobian[:, :6]
    n.thrust_map[:, :6] = d.thruster_jacobian[:, :6]


@kernel
def upright(frame: Vector) -> bool:
    """Whether contacts (feet, 3, 3) have the axes of the world."""
    level = True
    for k in range(frame.shape[0]):
        level = level and bool(np.all(diagonal(frame[k]) == 1.0))
    return level
