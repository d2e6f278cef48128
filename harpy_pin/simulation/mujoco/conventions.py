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

import re
from functools import cached_property
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.compiled import kernel
from harpy_pin.errors import InputError
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.record import RecordOf, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State, Vector
from harpy_pin.model.terms import body_rotation

__all__ = ["Conventions", "import_mujoco", "installed_version"]

FREE = 0
"""``mujoco.mjtJoint.mjJNT_FREE``."""
ROOT = 1
"""Index of the floating base's joint in Pinocchio's model."""


def installed_version() -> str | None:
    """Version of MuJoCo; None where it is not installed."""
    return version("mujoco") if find_spec("mujoco") is not None else None


def import_mujoco() -> Any:
    """The module ``mujoco``.

    Raises:
        InputError: it is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        message = f"MuJoCo cannot be imported ({error}): pip install 'harpy-pin[mujoco]'"
        raise InputError(message, name="plant", value="mujoco") from error
    return mujoco


class ConventionsRecord(RecordOf):
    """Places of the base and of the joints in Pinocchio's arrays and in MuJoCo's."""

    base_position: int  # of the free joint in MuJoCo's ``qpos``
    base_velocity: int  # of the free joint in MuJoCo's ``qvel``
    place: NDArray[np.int64]  # (joints,) in q
    column: NDArray[np.int64]  # (joints,) in v
    unbounded: NDArray[np.int64]  # (joints,) 1 for a joint without limits, whose q is a cosine and a sine
    position: NDArray[np.int64]  # (joints,) in MuJoCo's ``qpos``
    velocity: NDArray[np.int64]  # (joints,) in MuJoCo's ``qvel``


class Conventions:
    """Turns states and forces of one robot from one convention into the other, in any MuJoCo model of it.

    Joints are found by name. A prefix that ends in ``:`` or ``/``, as MuJoCo gives it to attached models, does not
    count. The free joint is the model's first one; the frame of its body has to be that of the URDF's root link.

    Args:
        model: ``mujoco.MjModel`` of the robot; its joints have the names of the URDF.
        robot: whose states these are.

    Attributes:
        record: where base and joints are, for :func:`to_mujoco` and :func:`from_mujoco`.
        velocity: (joints,) places of the robot's joints in MuJoCo's ``qvel``.

    Raises:
        InputError: the model has no free joint, or lacks a joint.
    """

    def __init__(self, model: Any, robot: Robot) -> None:
        self._model, self._robot = model, robot
        found = [model.joint(number) for number in range(model.njnt)]
        free = [joint for joint in found if int(joint.type[0]) == FREE]
        if not free:
            raise InputError("the MuJoCo model has no free joint: its base is fixed", name="model")
        hinges = [joint for joint in found if int(joint.type[0]) != FREE]
        by_name = {_plain(joint.name): joint for joint in hinges}
        by_name |= {joint.name.removeprefix("joint:"): joint for joint in hinges}
        for name in robot.joints:
            checks.one_of("joint of the MuJoCo model", name, by_name)
        joints = [by_name[name] for name in robot.joints]
        ours = list(robot.model.joints)[ROOT + 1 :]
        self.velocity = np.array([int(joint.dofadr[0]) for joint in joints], dtype=np.int64)
        self.record = make_record(
            ConventionsRecord,
            base_position=np.int64(free[0].qposadr[0]),
            base_velocity=np.int64(free[0].dofadr[0]),
            place=np.array([joint.idx_q for joint in ours], dtype=np.int64),
            column=np.array([joint.idx_v for joint in ours], dtype=np.int64),
            unbounded=np.array([joint.nq > 1 for joint in ours], dtype=np.int64),
            position=np.array([int(joint.qposadr[0]) for joint in joints], dtype=np.int64),
            velocity=self.velocity,
        )
        q, v = np.zeros(robot.model.nq), np.zeros(robot.model.nv)
        to_mujoco.prepare(self.record, q, v, q, v)
        from_mujoco.prepare(self.record, q, v, q, v)

    def write(self, state: State, data: Any) -> None:
        """Write configuration, velocity and time into MuJoCo's data; ``mujoco.mj_forward`` is the caller's.

        Args:
            state: of the robot.
            data: ``mujoco.MjData``, written in place.

        Raises:
            InputError: the state is of another robot.
        """
        q = checks.vector("q", state.q, self._robot.model.nq)
        v = checks.vector("v", state.v, self._robot.model.nv)
        to_mujoco(self.record, q, v, data.qpos, data.qvel)
        data.time = state.t

    def read(self, data: Any) -> State:
        """The state of MuJoCo's data: the way into a controller of this library from any MuJoCo simulation.

        Feet are placed by the robot's kinematics. A contact on a link counts for that foot of the link which is
        nearest.

        Args:
            data: ``mujoco.MjData``, after a step or ``mj_forward``.

        Raises:
            InputError: MuJoCo is not installed.
        """
        q, v, qpos = pin.neutral(self._robot.model), np.zeros(self._robot.model.nv), np.array(data.qpos)
        begin = int(self.record["base_position"][0]) + 3
        qpos[begin : begin + 4] /= np.linalg.norm(qpos[begin : begin + 4])
        from_mujoco(self.record, qpos, data.qvel, q, v)
        self._dynamics.update(q, v)
        position, velocity = self._dynamics.foot_position.copy(), self._dynamics.foot_velocity.copy()
        return State(float(data.time), q, v, position, velocity, self._foot_forces(data, position))

    @cached_property
    def _dynamics(self) -> Dynamics:
        return Dynamics(self._robot)

    def _foot_forces(self, data: Any, position: Vector) -> Vector:
        """(feet, 3) forces of the contacts on the links of the feet, world axes, N."""
        mujoco, robot = import_mujoco(), self._robot
        force, wrench = np.zeros((len(robot.feet), 3)), np.zeros(6)
        joint_of_foot = np.array([robot.model.frames[robot.frame_id(name)].parentJoint for name in robot.feet])
        for number in range(data.ncon):
            contact = data.contact[number]
            mujoco.mj_contactForce(self._model, data, number, wrench)
            on_second = np.asarray(contact.frame).reshape(3, 3).T @ wrench[:3]
            for geom, sign in ((contact.geom1, -1.0), (contact.geom2, 1.0)):
                mine = np.flatnonzero(joint_of_foot == self._joint_of_geom(int(geom)))
                if len(mine):
                    nearest = mine[np.argmin(np.linalg.norm(position[mine] - contact.pos, axis=1))]
                    force[nearest] += sign * on_second
        return force

    def _joint_of_geom(self, geom: int) -> int:
        """Pinocchio's index of the joint that carries a geom; 0 where it is none of the robot's."""
        model, ours = self._model, self._robot.model
        body = int(model.geom_bodyid[geom]) if geom >= 0 else 0
        while body > 0:
            first = int(model.body_jntadr[body])
            for number in range(first, first + int(model.body_jntnum[body])):
                if int(model.jnt_type[number]) == FREE:
                    return ROOT
                name = _plain(model.joint(number).name)
                if ours.existJointName(name):
                    return int(ours.getJointId(name))
            body = int(model.body_parentid[body])
        return 0


def _plain(name: str) -> str:
    """A name without the prefix of an attached model."""
    return re.split(r"[:/]", name)[-1]


@kernel
def _turn(q: Vector, given: Vector, out: Vector, back: bool) -> None:
    """R times a given vector (3,), or Rᵀ times it where it is turned back, with R of the quaternion in q."""
    r = np.empty((3, 3))
    body_rotation(q, r)
    for i in range(3):
        out[i] = 0.0
        for j in range(3):
            out[i] += (r[j, i] if back else r[i, j]) * given[j]


@kernel
def to_mujoco(c: ConventionsRecord, q: Vector, v: Vector, qpos: Vector, qvel: Vector) -> None:
    """Write a state q (nq,), v (nv,) into MuJoCo's arrays."""
    base, moving = qpos[c.base_position : c.base_position + 7], qvel[c.base_velocity : c.base_velocity + 6]
    base[:3] = q[:3]
    base[3] = q[6]
    base[4:7] = q[3:6]
    _turn(q, v, moving, False)
    moving[3:6] = v[3:6]
    for k in range(c.place.shape[0]):
        i = c.place[k]
        qpos[c.position[k]] = np.arctan2(q[i + 1], q[i]) if c.unbounded[k] else q[i]
        qvel[c.velocity[k]] = v[c.column[k]]


@kernel
def from_mujoco(c: ConventionsRecord, qpos: Vector, qvel: Vector, q: Vector, v: Vector) -> None:
    """Read a state q (nq,), v (nv,) from MuJoCo's arrays."""
    base, moving = qpos[c.base_position : c.base_position + 7], qvel[c.base_velocity : c.base_velocity + 6]
    q[:3] = base[:3]
    q[6] = base[3]
    q[3:6] = base[4:7]
    _turn(q, moving, v, True)
    v[3:6] = moving[3:6]
    for k in range(c.place.shape[0]):
        i = c.place[k]
        angle = qpos[c.position[k]]
        if c.unbounded[k]:
            q[i], q[i + 1] = np.cos(angle), np.sin(angle)
        else:
            q[i] = angle
        v[c.column[k]] = qvel[c.velocity[k]]
