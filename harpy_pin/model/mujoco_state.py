"""States between this library's conventions and those of a MuJoCo model of the user's own.

Joints are found by name. A prefix that ends in ``:`` or ``/``, as MuJoCo gives it to attached models, does not count.
The free joint is the model's first one; the frame of its body has to be that of the URDF's root link.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.errors import InputError

if TYPE_CHECKING:
    from harpy_pin.model.robot import Robot
    from harpy_pin.model.state import Vector

__all__ = ["MujocoState"]

FREE = 0
"""``mujoco.mjtJoint.mjJNT_FREE``."""
ROOT = 1
"""Index of the floating base's joint in Pinocchio's model."""


class MujocoState:
    """The part of :class:`~harpy_pin.model.state.State` that knows MuJoCo."""

    __slots__ = ()

    if TYPE_CHECKING:
        t: float
        q: Vector
        v: Vector

        def __init__(
            self, t: float, q: Vector, v: Vector, foot_position: Vector, foot_velocity: Vector, foot_force: Vector
        ) -> None: ...

    def to_mujoco(self, model: Any, data: Any, robot: Robot) -> None:
        """Write configuration, velocity and time into MuJoCo's data; ``mujoco.mj_forward`` is the caller's.

        Args:
            model: ``mujoco.MjModel`` of the same robot; its joints have the names of the URDF.
            data: ``mujoco.MjData``, written in place.
            robot: whose state this is.

        Raises:
            InputError: the model has no free joint, lacks a joint, or the state is of another robot.
        """
        base, joints = _places(model, robot)
        q = checks.vector("q", self.q, robot.model.nq)
        v = checks.vector("v", self.v, robot.model.nv)
        rotation = _rotation(q[3:7])
        place, column = int(base.qposadr[0]), int(base.dofadr[0])
        data.qpos[place : place + 3] = q[:3]
        data.qpos[place + 3 : place + 7] = q[6], *q[3:6]
        data.qvel[column : column + 3] = rotation @ v[:3]
        data.qvel[column + 3 : column + 6] = v[3:6]
        for joint, ours in joints:
            angle = q[ours.idx_q] if ours.nq == 1 else np.arctan2(q[ours.idx_q + 1], q[ours.idx_q])
            data.qpos[int(joint.qposadr[0])] = angle
            data.qvel[int(joint.dofadr[0])] = v[ours.idx_v]
        data.time = self.t

    @classmethod
    def from_mujoco(cls, model: Any, data: Any, robot: Robot) -> Self:
        """The state of MuJoCo's data: the way into a controller of this library from any MuJoCo simulation.

        Feet are placed by the robot's kinematics. A contact on a link counts for that foot of the link which is
        nearest.

        Args:
            model: ``mujoco.MjModel`` of the same robot; its joints have the names of the URDF.
            data: ``mujoco.MjData``, after a step or ``mj_forward``.
            robot: whose state it is.

        Raises:
            InputError: the model has no free joint, or lacks a joint; or MuJoCo is not installed.
        """
        base, joints = _places(model, robot)
        q, v = pin.neutral(robot.model), np.zeros(robot.model.nv)
        place, column = int(base.qposadr[0]), int(base.dofadr[0])
        w, x, y, z = data.qpos[place + 3 : place + 7]
        q[:3], q[3:7] = data.qpos[place : place + 3], (x, y, z, w)
        q[3:7] /= np.linalg.norm(q[3:7])
        v[:3] = _rotation(q[3:7]).T @ data.qvel[column : column + 3]
        v[3:6] = data.qvel[column + 3 : column + 6]
        for joint, ours in joints:
            angle = float(data.qpos[int(joint.qposadr[0])])
            q[ours.idx_q : ours.idx_q + ours.nq] = angle if ours.nq == 1 else (np.cos(angle), np.sin(angle))
            v[ours.idx_v] = data.qvel[int(joint.dofadr[0])]
        position, velocity = _feet(robot, q, v)
        force = _foot_forces(model, data, robot, position)
        return cls(float(data.time), q, v, position, velocity, force)


def _places(model: Any, robot: Robot) -> tuple[Any, list[tuple[Any, Any]]]:
    """The model's free joint; and for each joint of the robot, MuJoCo's and Pinocchio's.

    Raises:
        InputError: one is missing.
    """
    found = [model.joint(number) for number in range(model.njnt)]
    free = [joint for joint in found if int(joint.type[0]) == FREE]
    if not free:
        raise InputError("the MuJoCo model has no free joint: its base is fixed", name="model")
    by_name = {_plain(joint.name): joint for joint in found if int(joint.type[0]) != FREE}
    for name in robot.joints:
        checks.one_of("joint of the MuJoCo model", name, by_name)
    ours = [robot.model.joints[robot.model.getJointId(name)] for name in robot.joints]
    return free[0], list(zip((by_name[name] for name in robot.joints), ours, strict=True))


def _plain(name: str) -> str:
    """A name without the prefix of an attached model."""
    return re.split(r"[:/]", name)[-1]


def _rotation(quaternion: Vector) -> Vector:
    """(3, 3) of a quaternion x, y, z, w."""
    x, y, z, w = (float(value) for value in quaternion)
    return np.asarray(pin.Quaternion(w, x, y, z).toRotationMatrix())


def _feet(robot: Robot, q: Vector, v: Vector) -> tuple[Vector, Vector]:
    """(feet, 3) positions and velocities, world axes."""
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, q, v)
    frames = [robot.frame_id(name) for name in robot.feet]
    position, velocity = np.zeros((len(frames), 3)), np.zeros((len(frames), 3))
    for k, frame in enumerate(frames):
        position[k] = pin.updateFramePlacement(model, data, frame).translation
        velocity[k] = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear
    return position, velocity


def _foot_forces(model: Any, data: Any, robot: Robot, position: Vector) -> Vector:
    """(feet, 3) forces of the contacts on the links of the feet, world axes, N.

    Raises:
        InputError: MuJoCo is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        message = f"MuJoCo cannot be imported ({error}): pip install 'harpy-pin[mujoco]'"
        raise InputError(message, name="mujoco") from error
    force, wrench = np.zeros((len(robot.feet), 3)), np.zeros(6)
    joint_of_foot = np.array([robot.model.frames[robot.frame_id(name)].parentJoint for name in robot.feet])
    for number in range(data.ncon):
        contact = data.contact[number]
        mujoco.mj_contactForce(model, data, number, wrench)
        on_second = np.asarray(contact.frame).reshape(3, 3).T @ wrench[:3]
        for geom, sign in ((contact.geom1, -1.0), (contact.geom2, 1.0)):
            mine = np.flatnonzero(joint_of_foot == _joint_of_geom(model, robot, int(geom)))
            if len(mine):
                nearest = mine[np.argmin(np.linalg.norm(position[mine] - contact.pos, axis=1))]
                force[nearest] += sign * on_second
    return force


def _joint_of_geom(model: Any, robot: Robot, geom: int) -> int:
    """Pinocchio's index of the joint that carries a geom; 0 where it is none of the robot's."""
    body = int(model.geom_bodyid[geom]) if geom >= 0 else 0
    while body > 0:
        for number in range(int(model.body_jntadr[body]), int(model.body_jntadr[body]) + int(model.body_jntnum[body])):
            if int(model.jnt_type[number]) == FREE:
                return ROOT
            name = _plain(model.joint(number).name)
            if robot.model.existJointName(name):
                return int(robot.model.getJointId(name))
        body = int(model.body_parentid[body])
    return 0
