"""Weights, limits and targets of a whole-body problem, and what both WBCs read off them."""

from __future__ import annotations

import numpy as np

from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set import ProgramRecord


class ProblemRecord(RecordOf):
    """Weights and limits of a whole-body problem, for kernels.

    The weights have the names of :class:`~harpy_pin.wbc.weights.WholeBodyWeights`, after ``w_``.
    """

    w_body: float
    w_swing: float
    w_thrust: float
    w_force: float
    w_motion: Vector  # (nv,) weight of each entry of the generalised acceleration
    torque_limit: Vector  # (joints,) N·m
    input_lower: Vector  # (thrust variables + joints,) limits of [u; τ], N and N·m
    input_upper: Vector  # (thrust variables + joints,) limits of [u; τ], N and N·m
    # share of ``w_swing`` that is left where a torque is at its limit; 1 where nothing gives way
    give_way: float
    # (faces, 3) rows p of the friction pyramid, p f ≥ 0; in a tick the last column is that of each
    # foot
    pyramid: Vector
    mu: float  # friction coefficient of the ground
    # share of μ that is used; what is left is for errors of μ, of the model, and for impacts
    friction_share: float
    inscribed: float  # share of the cone's slope that the faces of the pyramid have
    friction: Vector  # (feet,) coefficient of each foot in this tick, after the safety margin


class TargetsRecord(RecordOf):
    """The arrays of :class:`~harpy_pin.wbc.weights.WholeBodyTargets`, and what kernels need
    besides.
    """

    body: Vector = sized(3)
    orientation: Vector = sized(3)
    feet: Vector = sized("feet", 3)
    joints: Vector = sized("joints")
    joint_share: Vector = sized(
        "joints", fill=1.0
    )  # by which the weight of each joint's task is multiplied
    held: Vector = sized("feet", fill=1.0)
    force_range: Vector
    force: Vector = sized("feet", 3)
    friction: Vector = sized("feet", fill=np.inf)
    tilted: int = ZERO
    centred: int = ZERO
    # horizontal acceleration of the centre of mass that velocities alone bring about, world axes,
    # m/s²; used where
    # ``centred``
    centre_drift: Vector = sized(2)
    frame: Vector = sized("feet", 3, 3)
    # measured contact forces in the frames of the contacts, where the ground is not level, N
    measured: Vector = sized("feet", 3)


@kernel
def note_centre_drift(d: DynamicsRecord, t: TargetsRecord) -> None:
    """What the velocities alone give the centre of mass, R n_l / m + g, into ``t.centre_drift``."""
    tree = d.tree
    t.centre_drift[:] = tree.rotation[:2] @ d.bias[:3] / d.mass_matrix[0, 0] + tree.gravity[:2]


@kernel
def root_acceleration(v: Vector, rotation: Vector, t: TargetsRecord, out: Vector) -> None:
    """Acceleration of the root that the targets of body and orientation ask for, into the first six
    entries of ``out``.

    Its first three entries are in body axes: the body's world acceleration is R (a_v + ω × v).
    """
    out[:3] = rotation.T @ t.body - np.cross(v[3:6], v[:3])
    out[3:6] = t.orientation


@kernel
def friction_limits(t: TargetsRecord, p: ProblemRecord) -> None:
    """Coefficient of each foot's cone in this tick, after the safety margin: into
    ``p.friction``.
    """
    p.friction[:] = p.friction_share * np.minimum(p.mu, t.friction)


@kernel
def friction_rows(t: TargetsRecord, p: ProblemRecord, qp: ProgramRecord, force: int) -> None:
    """Fit the pyramids' rows on force variables from index ``force`` to this tick's friction:
    another factor of f_z.
    """
    friction_limits(t, p)
    faces = p.pyramid.shape[0]
    for k in range(p.friction.shape[0]):
        up, first, z = p.friction[k] * p.inscribed, qp.bounded + (faces + 1) * k, force + 3 * k + 2
        qp.inequality[first : first + faces, z] = up


@kernel
def force_bounds(t: TargetsRecord, faces: int, lower: Vector, upper: Vector) -> None:
    """Bounds of each foot's rows on its force itself; never active in swing, where f = 0."""
    feet = t.held.shape[0]
    low = lower[: feet * (faces + 1)].reshape((feet, faces + 1))
    high = upper[: feet * (faces + 1)].reshape((feet, faces + 1))
    low[:, :faces] = np.where(t.held[:, None] != 0.0, 0.0, -1.0)
    low[:, faces] = np.where(t.held != 0.0, t.force_range[:, 0], -1.0)
    high[:, faces] = np.where(t.held != 0.0, t.force_range[:, 1], 1.0)
