"""The frame of a contact: the third axis is the normal of the ground, the others are tangents.

A friction cone is about the normal. With a foot's motion and force in its contact frame, "z" is the
normal, and what is written for level ground holds on any. The frame is the smallest rotation that
turns the vertical into the normal: of level ground it is the identity, digit for digit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.model.dynamics import DynamicsRecord

LENGTH = 1e-6
"""Largest error of a normal's squared length."""


@kernel(out=(3, 3))
def contact_frame(x: float, y: float, z: float, out: Vector) -> None:
    """The frame of the normal (x, y, z), upwards and of length one: the rotation from its axes to
    the world's.
    """
    share = 1.0 / (1.0 + z)
    out[0] = 1.0 - share * x * x, -share * x * y, x
    out[1] = -share * x * y, 1.0 - share * y * y, y
    out[2] = -x, -y, z


@kernel(normal=("n", 3), frame=("n", 3, 3))
def contact_frames(normal: Vector, frame: Vector) -> None:
    """The frames of normals (n, 3)."""
    for k in range(normal.shape[0]):
        contact_frame(*normal[k], frame[k])


@kernel
def is_level(normal: Vector) -> bool:
    """Whether all normals (feet, 3) are vertical."""
    return bool(np.all((normal[:, 0] == 0.0) & (normal[:, 1] == 0.0)))


@kernel
def all_upward(normal: Vector) -> bool:
    """Whether all normals (feet, 3) that are not vertical point upwards and have length one."""
    if is_level(normal):
        return True
    x, y, z = normal[:, 0], normal[:, 1], normal[:, 2]
    return bool(
        np.all((x == 0.0) & (y == 0.0) | (z > 0.0) & (abs(x * x + y * y + z * z - 1.0) < LENGTH))
    )


@kernel
def to_contact(frame: Vector, vector: Vector) -> None:
    """A vector (3,) of world axes in those of the contact, in place."""
    vector[:] = frame.T @ vector


@kernel
def to_contacts(frame: Vector, vector: Vector) -> None:
    """Vectors (feet, 3) of world axes in those of their contacts, in place."""
    vector[:] = np.sum(frame * vector[:, :, None], axis=1)


@kernel
def to_worlds(frame: Vector, vector: Vector) -> None:
    """Vectors (feet, 3) of the contacts' axes in those of the world, in place."""
    vector[:] = np.sum(frame * vector[:, None], axis=2)


def in_contact_frames(normal: Vector, vectors: Vector) -> Vector:
    """Vectors (feet, 3) of world axes in the frames of their contacts, by the normals of the ground
    (feet, 3).
    """
    frames = np.zeros((len(normal), 3, 3))
    contact_frames(normal, frames)
    turned: Vector = np.einsum("kij,ki->kj", frames, vectors)
    return turned


@kernel(frame=("n", 3, 3))
def turn_feet(d: DynamicsRecord, frame: Vector) -> None:
    """Feet's positions, velocities, drifts and Jacobians, of world axes, in those of the contacts'
    frames.
    """
    for k in range(frame.shape[0]):
        r = frame[k]
        to_contact(r, d.foot_position[k])
        to_contact(r, d.foot_velocity[k])
        to_contact(r, d.foot_drift[3 * k : 3 * k + 3])
        d.foot_jacobian[3 * k : 3 * k + 3] = r.T @ d.foot_jacobian[3 * k : 3 * k + 3]
