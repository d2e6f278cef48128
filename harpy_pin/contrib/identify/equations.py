"""Equations of motion that no unknown force enters, sample by sample.

A joint that carries no foot on the ground has an equation of its own: of a robot that hangs by its
base each, of one that walks those of a leg in the air. What is on the base stands in

    Nᵀ (M(q) a + h(q, v) − Sᵀ τ) = 0   with   J_c N = 0,

with J_c the Jacobian of the feet that may be on the ground: the columns of N are what their forces
cannot reach.
"""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from harpy_pin.contrib.identify.signals import BRIEF, SPACING, Samples
from harpy_pin.errors import InputError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

PAYLOAD = 4
"""Mass, and mass times place, of what is on the base: the first numbers of Pinocchio's regressor of
a body.
"""
REACHED = 1e-6
"""Singular value, as a share of the largest, from which on a force reaches a direction."""
LIFTED, FAST = 0.03, 0.25
"""A foot is in the air that is so much higher than the lowest, as a share of the base's height
above it, and so fast, m/s.
"""
SELDOM, BLOCK = 5, 20
"""One sample of so many tells of the payload, and so many are a block that has noise of its own."""
SLOW = 0.5
"""Velocity of a joint in the air, rad/s, below which dry friction may be anything."""
AROUND = 2 * round(2.5 * BRIEF / SPACING) + 1
"""Samples in a row in which it is: so far the window reaches."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Equations of a joint, each as both halves of the log say it.

    Attributes:
        joint: its number.
        sample: (rows,) sample of each row, from the first one on.
        known: (2, rows) what the rigid model needs, N·m.
    """

    joint: int
    sample: NDArray[np.int64]
    known: Vector


def rigid(robot: Robot) -> pin.Model:
    """The model with ideal joints: no armature, damping or dry friction.

    Raises:
        InputError: its joints have not one angle each, or it has closed loops.
    """
    model = robot.model.copy()
    if robot.loops is not None:
        message = f"'{robot.name}' has closed loops, whose joints cannot be identified"
        raise InputError(message, name="robot", value=robot)
    if model.nq != len(robot.joints) + 7:
        raise InputError(
            "only joints with one angle each can be identified, none that turns without end",
            name="robot",
            value=robot,
        )
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
    lowest = height.min(axis=1, keepdims=True)
    lifted = height - lowest > LIFTED * (half.q[:, 2:3] - lowest)
    return np.asarray(minimum_filter1d(lifted & (speed > FAST), AROUND, axis=0))


def joint_rows(robot: Robot, samples: Samples, air: NDArray[np.bool_]) -> list[Rows]:
    """The equations of each joint where it carries no foot on the ground."""
    model = rigid(robot)
    data = model.createData()
    known = np.array(
        [
            [
                pin.rnea(model, data, *state)[6:]
                for state in zip(half.q, half.v, half.a, strict=True)
            ]
            for half in samples.halves
        ]
    )
    ends = [model.frames[robot.frame_id(name)].parentJoint for name in robot.feet]
    carries = np.array(
        [[end in model.subtrees[j] for j in range(2, model.njoints)] for end in ends]
    )
    slow = np.abs(samples.halves[0].v[:, 6:]) < SLOW
    loaded = samples.still if samples.held else slow | (~air @ carries)
    kept = [np.flatnonzero(one) for one in ~(samples.cut | loaded).T]
    return [Rows(j, k, known[:, k, j]) for j, k in enumerate(kept)]


def payload(
    robot: Robot, samples: Samples, air: NDArray[np.bool_], torque: Vector, error: float
) -> tuple[Vector, Vector]:
    """(4,) mass on the base, and mass times place, and their standard errors.

    Args:
        robot: whose base it is.
        samples: of the log.
        air: (n, feet) which feet are in the air.
        torque: (n, joints) at the joints, N·m.
        error: standard error of each joint's torques, as a share of them.
    """
    model, half, parts = rigid(robot), samples.halves[0], []
    data, frames = model.createData(), np.array([robot.frame_id(name) for name in robot.feet])
    unit = np.eye(model.nv)[6:]
    for k in range(0, len(samples.t), SELDOM):
        state = half.q[k], half.v[k], half.a[k]
        pin.computeJointJacobians(model, data, state[0])
        pin.updateFramePlacements(model, data)
        on = frames[~air[k]].tolist()
        forces = [pin.getFrameJacobian(model, data, i, pin.LOCAL)[:3] for i in on]
        basis = unreached(np.concatenate((*forces, unit[samples.cut[k]]))).T
        regressor = pin.computeJointTorqueRegressor(model, data, *state)[:, :PAYLOAD]
        shares = basis @ (unit.T * torque[k])
        lacks = shares.sum(axis=1) - basis @ pin.rnea(model, data, *state)
        parts.append(np.column_stack((lacks, basis @ regressor, shares)))
    lacks, matrix, shares = np.split(np.concatenate(parts), [1, 1 + PAYLOAD], axis=1)
    inverse = np.linalg.pinv(matrix)
    found = inverse @ lacks[:, 0]
    ends = np.cumsum([0, *map(len, parts)])[:-1:BLOCK]
    scores = np.add.reduceat(inverse * (lacks[:, 0] - matrix @ found), ends, axis=1)
    variance = np.sum(scores**2, axis=1) + np.sum((error * inverse @ shares) ** 2, axis=1)
    return found, np.sqrt(variance)


def unreached(jacobian: Vector) -> Vector:
    """(nv, m) an orthonormal basis of the directions that forces with the Jacobian (forces, nv) do
    not reach.
    """
    _, size, directions = np.linalg.svd(jacobian)
    rank = int(np.sum(size > REACHED * size.max(initial=0.0)))
    return np.asarray(directions[rank:].T)
