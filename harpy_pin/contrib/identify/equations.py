"""Equations of motion that no unknown force enters, sample by sample.

Of a robot that hangs by its base they are those of the joints. Of one that stands or walks they are

    Nᵀ (M(q) a + h(q, v) − Sᵀ τ) = 0   with   J_c N = 0,

with J_c the Jacobian of the feet in contact: the columns of N are what their forces cannot reach.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.contrib.identify.signals import Half, Piece
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

PAYLOAD = 4
"""Mass, and mass times place, of what is on the base: the first numbers of Pinocchio's regressor of a body."""
REACHED = 1e-6
"""Singular value, as a share of the largest, from which on a force reaches a direction."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Equations of some joints, each as both halves of the log say it.

    Attributes:
        joints: their numbers.
        sample: (rows,) sample of each row, counted over all pieces.
        select: (rows, len(joints)) share of each joint's torque in the row.
        known: (2, rows) what the rigid model needs, N·m or N.
        payload: (2, rows, 4) the same of a payload of 1 kg, and of 1 kg·m; or of no column.
    """

    joints: list[int]
    sample: NDArray[np.int64]
    select: Vector
    known: Vector
    payload: Vector


def rigid(robot: Robot) -> pin.Model:
    """The model with ideal joints: no armature, damping or dry friction."""
    model = robot.model.copy()
    model.armature = model.damping = np.zeros(model.nv)
    model.upperDryFrictionLimit = model.lowerDryFrictionLimit = np.zeros(model.nv)
    return model


def states(model: pin.Model, half: Half) -> Iterator[tuple[Vector, Vector, Vector]]:
    """Configurations, velocities and accelerations of a half's samples."""
    pose = np.tile(pin.neutral(model)[:7], (len(half.q), 1))
    still = np.zeros((len(half.q), 6))
    parts = zip(
        (pose, still, still) if half.base is None else half.base,
        (half.q, half.v, half.a),
        strict=True,
    )
    yield from zip(*(np.concatenate(pair, axis=1) for pair in parts), strict=True)


def hung_rows(robot: Robot, pieces: list[Piece]) -> list[Rows]:
    """The equations of each joint of a robot whose base is held."""
    model = rigid(robot)
    data = model.createData()
    both = [
        np.array(
            [
                pin.rnea(model, data, *state)
                for piece in pieces
                for state in states(model, piece.halves[h])
            ]
        )
        for h in (0, 1)
    ]
    known = np.array(both)[:, :, 6:]
    kept = [
        np.flatnonzero(~np.concatenate([p.cut[:, j] | p.still[:, j] for p in pieces]))
        for j in range(known.shape[2])
    ]
    none = np.zeros((2, known.shape[1], 0))
    return [
        Rows([j], k, np.ones((len(k), 1)), known[:, k, j], none[:, k]) for j, k in enumerate(kept)
    ]


def standing_rows(robot: Robot, pieces: list[Piece]) -> Rows:
    """The equations of all joints of a robot on its feet."""
    model, first = rigid(robot), 0
    data, frames, parts = model.createData(), [robot.frame_id(name) for name in robot.feet], []
    for piece in pieces:
        usable = piece.steady & piece.stance.any(axis=1) & ~piece.cut.any(axis=1)
        for k, *both in zip(
            range(len(piece.t)), *(states(model, half) for half in piece.halves), strict=True
        ):
            if not usable[k]:
                continue
            pin.computeJointJacobians(model, data, both[0][0])
            pin.updateFramePlacements(model, data)
            on = np.flatnonzero(piece.stance[k])
            jacobian = np.concatenate(
                [pin.getFrameJacobian(model, data, frames[i], pin.LOCAL)[:3] for i in on]
            )
            basis = unreached(jacobian).T
            known = np.array([basis @ pin.rnea(model, data, *state) for state in both])
            regressors = [
                pin.computeJointTorqueRegressor(model, data, *state)[:, :PAYLOAD] for state in both
            ]
            parts.append(
                (
                    np.full(len(basis), first + k),
                    basis[:, 6:],
                    known.T,
                    (basis @ regressors).swapaxes(0, 1),
                )
            )
        first += len(piece.t)
    sample, select, right, payload = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Rows(list(range(len(robot.joints))), sample, select, right.T, payload.swapaxes(0, 1))


def unreached(jacobian: Vector) -> Vector:
    """(nv, m) an orthonormal basis of the directions that forces with the Jacobian (forces, nv) do not reach."""
    _, size, directions = np.linalg.svd(jacobian)
    rank = int(np.sum(size > REACHED * size[0]))
    return np.asarray(directions[rank:].T)
