"""The one place where states and forces change from this library's conventions to MuJoCo's and back.

| | here (:class:`harpy_pin.model.state.State`) | MuJoCo |
|---|---|---|
| quaternion | x, y, z, w | w, x, y, z |
| linear velocity of the body, and force on it | body axes | world axes |
| angular velocity of the body, and moment | body axes | body axes |
| joint that turns without end | cosine and sine | angle |
| order of the joints | of Pinocchio's model | depth first |
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled import kernel
from harpy_pin.model.kinematics import body_rotation
from harpy_pin.model.record import RecordOf, make_record
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import UNBOUNDED

__all__ = ["Conventions"]


class ConventionsRecord(RecordOf):
    """Places of the joints in Pinocchio's arrays and in MuJoCo's.

    Attributes:
        place: (joints,) in q.
        column: (joints,) in v.
        unbounded: (joints,) 1 for a joint without limits, whose q is a cosine and a sine.
        position: (joints,) in MuJoCo's ``qpos``.
        velocity: (joints,) in MuJoCo's ``qvel``.
    """

    place: NDArray[np.int64]
    column: NDArray[np.int64]
    unbounded: NDArray[np.int64]
    position: NDArray[np.int64]
    velocity: NDArray[np.int64]


class Conventions:
    """Turns states and forces of one robot from one convention into the other.

    Args:
        tree: record of :func:`harpy_pin.model.tree.tree_record`.
        position: (joints,) places of the joints in MuJoCo's ``qpos``, in Pinocchio's order.
        velocity: (joints,) places of the joints in MuJoCo's ``qvel``, likewise.
    """

    def __init__(self, tree: Any, position: list[int], velocity: list[int]) -> None:
        self._velocity = np.array(velocity, dtype=np.int64)
        self._record = make_record(
            ConventionsRecord,
            place=np.array(tree["place"][0][1:], dtype=np.int64),
            column=np.array(tree["column"][0][1:], dtype=np.int64),
            unbounded=np.array(tree["kind"][0][1:] == UNBOUNDED),
            position=np.array(position, dtype=np.int64),
            velocity=self._velocity,
        )
        q, v = np.zeros(len(position) + 7), np.zeros(len(velocity) + 6)
        _to_mujoco.prepare(self._record, q, v, q, v)
        _from_mujoco.prepare(self._record, q, v, q, v)

    def to_mujoco(self, q: Vector, v: Vector, qpos: Vector, qvel: Vector) -> None:
        """Write a state into MuJoCo's arrays.

        Args:
            q: (nq,) configuration.
            v: (nv,) generalised velocity.
            qpos: (nq,) out, MuJoCo's positions, the quaternion in the order w, x, y, z.
            qvel: (nv,) out, MuJoCo's velocities, the linear one of the base in world axes.
        """
        _to_mujoco(self._record, q, v, qpos, qvel)

    def from_mujoco(self, qpos: Vector, qvel: Vector, q: Vector, v: Vector) -> None:
        """Read a state from MuJoCo's arrays into q (nq,) and v (nv,).

        Args:
            qpos: (nq,) MuJoCo's positions.
            qvel: (nv,) MuJoCo's velocities.
            q: (nq,) out, this library's configuration.
            v: (nv,) out, its generalised velocity.
        """
        _from_mujoco(self._record, qpos, qvel, q, v)

    def joint_forces(self, torque: Vector, out: Vector) -> None:
        """Write joint torques (joints,) into MuJoCo's generalised forces; its other entries become zero.

        Args:
            torque: (joints,) in the order of the robot's joints, N·m.
            out: (nv,) MuJoCo's ``qfrc_applied``, written in place.
        """
        out[:] = 0.0
        out[self._velocity] = torque


@kernel
def _turn(q: Vector, body: Vector, world: Vector, into_world: bool) -> None:
    """R body → world, or Rᵀ world → body, for the quaternion in q."""
    r = np.empty((3, 3))
    body_rotation(q, r)
    for i in range(3):
        total = 0.0
        for j in range(3):
            total += r[i, j] * body[j] if into_world else r[j, i] * world[j]
        if into_world:
            world[i] = total
        else:
            body[i] = total


@kernel
def _to_mujoco(c: ConventionsRecord, q: Vector, v: Vector, qpos: Vector, qvel: Vector) -> None:
    qpos[:3] = q[:3]
    qpos[3] = q[6]
    qpos[4:7] = q[3:6]
    _turn(q, v, qvel, True)
    qvel[3:6] = v[3:6]
    for k in range(c.place.shape[0]):
        i = c.place[k]
        qpos[c.position[k]] = np.arctan2(q[i + 1], q[i]) if c.unbounded[k] else q[i]
        qvel[c.velocity[k]] = v[c.column[k]]


@kernel
def _from_mujoco(c: ConventionsRecord, qpos: Vector, qvel: Vector, q: Vector, v: Vector) -> None:
    q[:3] = qpos[:3]
    q[6] = qpos[3]
    q[3:6] = qpos[4:7]
    _turn(q, v, qvel, False)
    v[3:6] = qvel[3:6]
    for k in range(c.place.shape[0]):
        i = c.place[k]
        angle = qpos[c.position[k]]
        if c.unbounded[k]:
            q[i], q[i + 1] = np.cos(angle), np.sin(angle)
        else:
            q[i] = angle
        v[c.column[k]] = qvel[c.velocity[k]]
