"""Equations of motion that no unknown force enters, sample by sample.

Of a robot that hangs by its base they are those of the joints. Of one that stands or walks they are

    Nᵀ (M(q) a + h(q, v) − Sᵀ τ) = 0   with   J_c N = 0,

with J_c the Jacobian of the feet in contact: the columns of N are what their forces cannot reach.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.contrib.identify.signals import Samples
from harpy_pin.errors import InputError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

PAYLOAD = 4
"""Mass, and mass times place, of what is on the base: the first numbers of Pinocchio's regressor of
a body.
"""
REACHED = 1e-6
"""Singular value, as a share of the largest, from which on a force reaches a direction."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Equations of some joints, each as both halves of the log say it.

    Attributes:
        joints: their numbers.
        sample: (rows,) sample of each row, from the first one on.
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
    """The model with ideal joints: no armature, damping or dry friction.

    Raises:
        InputError: its joints have not one angle each.
    """
    model = robot.model.copy()
    if model.nq != len(robot.joints) + 7:
        message = "only joints with one angle each can be identified, none that turns without end"
        raise InputError(message, name="robot", value=robot)
    model.armature = model.damping = np.zeros(model.nv)
    model.upperDryFrictionLimit = model.lowerDryFrictionLimit = np.zeros(model.nv)
    return model


def hung_rows(robot: Robot, samples: Samples) -> list[Rows]:
    """The equations of each joint of a robot whose base is held."""
    model = rigid(robot)
    data, n = model.createData(), len(samples.t)
    known = np.array(
        [[pin.rnea(model, data, *half.state(k))[6:] for k in range(n)] for half in samples.halves]
    )
    none = np.zeros((2, n, 0))
    kept = [np.flatnonzero(one) for one in ~(samples.cut | samples.still).T]
    return [
        Rows([j], k, np.ones((len(k), 1)), known[:, k, j], none[:, k]) for j, k in enumerate(kept)
    ]


def standing_rows(robot: Robot, samples: Samples) -> Rows:
    """The equations of all joints of a robot on its feet.

    Raises:
        InputError: it never stands long enough, or may push itself by thrusters.
    """
    if robot.thrusters or robot.rotors:
        raise InputError("thrust is in no equation: hang the robot up", name="robot", value=robot)
    model = rigid(robot)
    data, frames = model.createData(), [robot.frame_id(name) for name in robot.feet]
    usable = samples.steady & samples.stance.any(axis=1)
    unit, parts = np.eye(model.nv)[6:], []
    for k in np.flatnonzero(usable):
        both = [half.state(int(k)) for half in samples.halves]
        pin.computeJointJacobians(model, data, both[0][0])
        pin.updateFramePlacements(model, data)
        stance = [frames[i] for i in np.flatnonzero(samples.stance[k])]
        jacobians = [pin.getFrameJacobian(model, data, i, pin.LOCAL)[:3] for i in stance]
        basis = unreached(np.concatenate((*jacobians, unit[samples.cut[k]]))).T
        known = np.array([basis @ pin.rnea(model, data, *state) for state in both])
        regressors = np.array(
            [pin.computeJointTorqueRegressor(model, data, *state)[:, :PAYLOAD] for state in both]
        )
        payload = (basis @ regressors).swapaxes(0, 1)
        parts.append((np.full(len(basis), k), basis[:, 6:], known.T, payload))
    if not parts:
        raise InputError("no foot ever stands", name="stance")
    sample, select, right, payload = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Rows(list(range(len(robot.joints))), sample, select, right.T, payload.swapaxes(0, 1))


def unreached(jacobian: Vector) -> Vector:
    """(nv, m) an orthonormal basis of the directions that forces with the Jacobian (forces, nv) do
    not reach.
    """
    _, size, directions = np.linalg.svd(jacobian)
    rank = int(np.sum(size > REACHED * size[0]))
    return np.asarray(directions[rank:].T)
