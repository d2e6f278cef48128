"""What a gait asks for, written into the system that is eliminated.

The tasks are those of body, orientation, swing feet and joints
(:mod:`~harpy_pin.controllers.tasks`). A foot on a limb that determines it is eliminated with it
(:mod:`~harpy_pin.wbc.condensed.limbs`). Every other foot has rows: on the ground they are a
contact, in the air a task with the weight of swing feet. A point has three rows. The corners of a
sole have 12, of which a rigid body can follow six: its rows are Qᵀ J with Q (12, 6) an orthonormal
basis of the motions of its corners, so that their errors count as those of all rows do.

**Centre of mass.** Its acceleration follows from the wrench y on the root, m c̈ = R y_f + m g, so
its task is a row of y. Where a gait demands it, the horizontal task of the body's origin keeps the
share ``ORIGIN`` of its weight: K has to be finite.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels import ByPrecision, kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import RecordOf
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.elimination import (
    ROOT,
    SIDES,
    TARGETS,
    EliminationRecord,
    begin_elimination,
    begin_row,
)
from harpy_pin.wbc.condensed.limbs import LimbsRecord
from harpy_pin.wbc.newton import NewtonRecord
from harpy_pin.wbc.targets import ProblemRecord, TargetsRecord, root_acceleration

ORIGIN = ByPrecision(1e-8, single=1e-4)
"""Share of its weight that the task of the body's origin keeps where the centre of mass has one."""
COMPLIANCE = ByPrecision(1e-9, single=1e-4)
"""ρ of contacts: (m/s²) per unit of their multiplier."""


class FeetRecord(RecordOf):
    """Feet on other limbs than those that they determine."""

    body: NDArray[np.int64]  # (others,) that each is fixed to
    foot: NDArray[np.int64]  # (others,) first contact point of each
    points: NDArray[np.int64]  # (others,) number of its contact points
    first_row: NDArray[np.int64]  # (others,) of each in the elimination
    basis: (
        Vector  # (others, 6, 12) Qᵀ, axes of the foot; of a point its first three rows and columns
    )


@kernel
def assemble_gait(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: ProblemRecord,
    e: EliminationRecord,
    n: NewtonRecord,
    v: Vector,
) -> None:
    """The tasks of body, orientation and joints."""
    begin_elimination(d, e, v)
    desired = np.empty((ROOT,))
    root_acceleration(v, d.tree.rotation, t, desired)
    for k in range(ROOT):
        begin_row(d, e, k, p.w_motion[k], desired[k])
    for j in range(e.order.shape[0]):
        k = e.order[j]
        begin_row(d, e, k, p.w_motion[k] * t.joint_share[k - ROOT], t.joints[k - ROOT])
    n.momentum_weight[n.momentum_weight.shape[0] - 2 :] = 0.0
    if t.centred:
        _centre(d, t, p, e, n, desired)


@kernel
def _centre(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: ProblemRecord,
    e: EliminationRecord,
    n: NewtonRecord,
    desired: Vector,
) -> None:
    """The horizontal task of the centre of mass in the place of that of the body's origin."""
    rotation, mass = d.tree.rotation, d.mass_matrix[0, 0]
    up, linear = rotation[2], e.matrix[:3, SIDES : SIDES + 3]
    linear[:] = p.w_body * (ORIGIN * np.eye(3) + (1.0 - ORIGIN) * np.outer(up, up))
    e.matrix[:3, TARGETS] = -(linear @ desired[:3])
    first = n.momentum_weight.shape[0] - 2  # after those of tasks of one's own
    n.momentum_weight[first:] = p.w_body
    n.momentum_map[first:, :3], n.momentum_map[first:, 3:] = rotation[:2] / mass, 0.0
    n.momentum_target[first:] = t.body[:2] - d.tree.gravity[:2]


@kernel
def soften_limbs(t: TargetsRecord, p: ProblemRecord, m: LimbsRecord, share: Vector) -> None:
    """``softness`` of the limbs, with a share (feet,) of the weight of each swing foot."""
    for k in range(m.joint.shape[0]):
        foot = m.foot[k]
        free = t.held[foot] == 0.0 and p.w_swing != 0.0
        m.softness[k] = 1.0 / (share[foot] * p.w_swing) if free else 0.0


@kernel
def add_feet(
    d: DynamicsRecord,
    t: TargetsRecord,
    p: ProblemRecord,
    e: EliminationRecord,
    f: FeetRecord,
    share: Vector,
) -> None:
    """Rows of all feet on other limbs."""
    for k in range(f.foot.shape[0]):
        foot, first = f.foot[k], f.first_row[k]
        free = t.held[foot] == 0.0 and p.w_swing != 0.0
        turn = d.tree.rotation @ d.tree.axes[f.body[k]]
        if t.tilted:
            turn[:] = t.frame[foot].T @ d.tree.rotation @ d.tree.axes[f.body[k]]
        count = 3 if f.points[k] == 1 else 6
        e.compliance[first : first + count] = (
            1.0 / (share[foot] * p.w_swing) if free else COMPLIANCE
        )
        for r in range(count):
            row, end = e.rows[first + r], e.row_end[first + r]
            row[:] = 0.0
            for i in range(f.points[k]):
                direction, at = turn @ f.basis[k, r, 3 * i : 3 * i + 3], 3 * (foot + i)
                own = d.foot_jacobian[at : at + 3]
                row[TARGETS] -= direction @ (t.feet[foot + i] - d.foot_drift[at : at + 3])
                for j in range(e.depth[end] + 1):
                    row[SIDES + j] += direction @ own[:, e.path[end, j]]
