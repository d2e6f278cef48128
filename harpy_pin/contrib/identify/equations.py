"""Equations of motion that no unknown force enters, sample by sample.

A joint that carries no foot on the ground has an equation of its own: of a robot that hangs by its
base each, of one that walks those of a leg in the air. Of a robot on its feet there are also

    Nᵀ (M(q) a + h(q, v) − Sᵀ τ) = 0   with   J_c N = 0,

with J_c the Jacobian of the feet that may be on the ground: the columns of N are what their forces
cannot reach.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from harpy_pin.contrib.identify.signals import SPACING, WINDOW, Samples
from harpy_pin.errors import InputError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

PAYLOAD = 4
"""Mass, and mass times place, of what is on the base: the first numbers of Pinocchio's regressor of
a body.
"""
REACHED = 1e-6
"""Singular value, as a share of the largest, from which on a force reaches a direction."""
LIFTED, FAST = 0.01, 0.25
"""A foot is in the air that is so much higher than the lowest, m, and so fast, m/s."""
AROUND = 2 * round(2.0 * WINDOW / SPACING) + 1
"""Samples in a row in which it is: so far the window reaches."""


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


def in_the_air(robot: Robot, samples: Samples) -> NDArray[np.bool_]:
    """(n, feet) whether no force is at a foot, by how it moves."""
    model, half = robot.model, samples.halves[0]
    data, frames = model.createData(), [robot.frame_id(name) for name in robot.feet]
    height, speed = np.empty((2, len(samples.t), len(frames)))
    for k, (q, v) in enumerate(zip(half.q, half.v, strict=True)):
        pin.forwardKinematics(model, data, q, v)
        for i, frame in enumerate(frames):
            height[k, i] = pin.updateFramePlacement(model, data, frame).translation[2]
            speed[k, i] = np.linalg.norm(pin.getFrameVelocity(model, data, frame).linear)
    lifted = height - height.min(axis=1, keepdims=True) > LIFTED
    return np.asarray(minimum_filter1d(lifted & (speed > FAST), AROUND, axis=0))


def joint_rows(robot: Robot, samples: Samples, air: NDArray[np.bool_]) -> list[Rows]:
    """The equations of each joint where it carries no foot on the ground."""
    model = rigid(robot)
    data, n = model.createData(), len(samples.t)
    known = np.array(
        [
            [
                pin.rnea(model, data, *state)[6:]
                for state in zip(half.q, half.v, half.a, strict=True)
            ]
            for half in samples.halves
        ]
    )
    kept = ~(samples.cut | samples.still)
    if not samples.held:
        ends = [model.frames[robot.frame_id(name)].parentJoint for name in robot.feet]
        carries = np.array(
            [[j in model.supports[end] for end in ends] for j in range(2, model.njoints)]
        )
        kept = ~samples.cut & ~(~air @ carries.T)
    none = np.zeros((2, n, 0))
    rows = [np.flatnonzero(one) for one in kept.T]
    return [
        Rows([j], k, np.ones((len(k), 1)), known[:, k, j], none[:, k]) for j, k in enumerate(rows)
    ]


def standing_rows(
    robot: Robot, samples: Samples, air: NDArray[np.bool_], alone: list[Rows]
) -> Rows:
    """The equations that all joints of a robot on its feet share, beside those of joints alone.

    Raises:
        InputError: it may push itself by thrusters.
    """
    if robot.thrusters or robot.rotors:
        raise InputError("thrust is in no equation: hang the robot up", name="robot", value=robot)
    model = rigid(robot)
    data, frames = model.createData(), np.array([robot.frame_id(name) for name in robot.feet])
    unit, parts, gone = np.eye(model.nv)[6:], [], samples.cut.copy()
    for rows in alone:
        gone[rows.sample, rows.joints] = True
    for k in range(len(samples.t)):
        both = [(half.q[k], half.v[k], half.a[k]) for half in samples.halves]
        pin.computeJointJacobians(model, data, both[0][0])
        pin.updateFramePlacements(model, data)
        forces = [
            pin.getFrameJacobian(model, data, i, pin.LOCAL)[:3] for i in frames[~air[k]].tolist()
        ]
        basis = unreached(np.concatenate((*forces, unit[gone[k]]))).T
        known = [basis @ pin.rnea(model, data, *state) for state in both]
        payload = [
            basis @ pin.computeJointTorqueRegressor(model, data, *state)[:, :PAYLOAD]
            for state in both
        ]
        parts.append((np.full(len(basis), k), basis[:, 6:], np.transpose(known), payload))
    sample, select, right = (
        np.concatenate(column) for column in list(zip(*parts, strict=True))[:3]
    )
    payload = np.concatenate([part[3] for part in parts], axis=1)
    return Rows(list(range(len(unit))), sample, select, right.T, payload)


def unreached(jacobian: Vector) -> Vector:
    """(nv, m) an orthonormal basis of the directions that forces with the Jacobian (forces, nv) do
    not reach.
    """
    _, size, directions = np.linalg.svd(jacobian)
    rank = int(np.sum(size > REACHED * size.max(initial=0.0)))
    return np.asarray(directions[rank:].T)
