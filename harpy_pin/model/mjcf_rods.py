"""Rods on ball joints, and joints that stiff springs hold, in MuJoCo's models.

A rod with a ball joint at one end and a ``<connect>`` at the other may spin without moving anything
else. It has two hinges across it here, the joint's name and that with ``_2`` behind. A joint
without a motor, whose spring the robot's weight hardly bends, is held where the spring is at rest.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.errors import InputError
from harpy_pin.model.mjcf_loops import connected, driven_joints, import_mujoco, joint_name
from harpy_pin.model.mjcf_options import enabled_actuators
from harpy_pin.model.state import GRAVITY, Vector

FREE, BALL, SLIDE, HINGE = range(4)  # ``mujoco.mjtJoint``
SECOND = "_2"
"""Behind the name of a rod's second hinge."""
SOFT = 0.25
"""A spring is held that the robot's weight, at the farthest of what it carries, bends by less, rad.
"""
THIN = 0.01
"""Largest inertia of a rod about itself, in that across it, and distance of its mass from its line,
in its length.
"""
SHORT = 1e-3
"""Least length of a rod, m."""


def held_springs(model: Any, joints: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of some joints that turn, have a stiff spring and no motor, and follow no other joint;
    none where no joint has a motor.

    Args:
        model: ``mujoco.MjModel``.
        joints: of one robot.
    """
    mujoco, acting = import_mujoco(), driven_joints(model)[enabled_actuators(model)]
    coupled = (model.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)) & (model.eq_active0 != 0)
    moved = np.concatenate((acting, model.eq_obj1id[coupled], model.eq_obj2id[coupled]))
    sprung = joints[(model.jnt_stiffness[joints] > 0.0) & (model.jnt_type[joints] == HINGE)]
    sprung = sprung[~np.isin(sprung, moved)]
    if not len(sprung) or not (acting >= 0).any():
        return np.zeros(0, np.int64)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for joint in sprung.tolist():
        body = int(model.jnt_bodyid[joint])
        carried = [body]
        for other in range(body + 1, model.nbody):
            if model.body_parentid[other] in carried:
                carried.append(other)
        places = np.vstack((data.xpos[carried], data.xipos[carried]))
        reach = float(np.linalg.norm(places - data.xanchor[joint], axis=1).max())
        load = GRAVITY * float(model.body_subtreemass[model.body_rootid[body]])
        if load * reach < SOFT * model.jnt_stiffness[joint]:
            found.append(joint)
    return np.array(found, np.int64)


def at_rest(model: Any, joint: int) -> pin.SE3:
    """What a held spring moves its body, in the body's frame."""
    place, axis, arm = model.jnt_qposadr[joint], model.jnt_axis[joint], model.jnt_pos[joint]
    bent = float(model.qpos_spring[place] - model.qpos0[place])
    turn = pin.exp3(bent * axis)
    return pin.SE3(turn, arm - turn @ arm)


def across(model: Any, joint: int) -> Vector:
    """(3, 3) axes of the two hinges across a rod on a ball joint, and of the rod, in its body's
    frame, as columns.

    Raises:
        InputError: the body is no rod.
    """
    name, body = joint_name(model, joint), int(model.jnt_bodyid[joint])
    connects = model.eq_type == int(import_mujoco().mjtEq.mjEQ_CONNECT)
    numbers = np.flatnonzero(connects & (model.eq_active0 != 0)).tolist()
    ends = [end for number in numbers for end in connected(model, number) if end[0] == body]
    alone = int(model.body_jntnum[body]) == 1 and body not in model.body_parentid
    if not alone or len(ends) != 1 or joint in driven_joints(model)[enabled_actuators(model)]:
        raise InputError(
            f"joint '{name}' is a ball joint, which is supported only for a rod without a motor, "
            "that one <connect> closes"
        )
    pivot, end = np.array(model.jnt_pos[joint]), ends[0][1]
    length = float(np.linalg.norm(end - pivot))
    if length < SHORT:
        raise InputError(
            f"the rod on the ball joint '{name}' has no length: its <connect> is at the joint"
        )
    line = (end - pivot) / length
    turn = pin.Quaternion(*model.body_iquat[body].tolist()).toRotationMatrix()
    inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
    centre = model.body_ipos[body] - pivot
    about = float(line @ inertia @ line)
    whole = float(np.trace(inertia)) / 2.0 + model.body_mass[body] * float(centre @ centre)
    aside = float(np.linalg.norm(np.cross(line, centre)))
    if aside > THIN * length or about > THIN * whole:
        raise InputError(
            f"joint '{name}' is a ball joint of what is no thin rod, which is not supported: it "
            f"has {about:.2g} kg·m² about the line to its <connect>, and its mass is {aside:.2g} m "
            "beside it"
        )
    first = np.cross(line, np.eye(3)[np.argmin(np.abs(line))])
    first /= np.linalg.norm(first)
    return np.column_stack((first, np.cross(line, first), line))


def hinged(model: Any, joints: NDArray[np.int64]) -> NDArray[np.int64]:
    """Joints with each ball joint twice: one number for each hinge."""
    return np.repeat(joints, 1 + (model.jnt_type[joints] == BALL))


def hinge_names(model: Any, hinges: NDArray[np.int64]) -> list[str]:
    """Names of hinges, of which those of a ball joint are one behind the other.

    Args:
        model: ``mujoco.MjModel``.
        hinges: of :func:`hinged`, in any order of its joints.
    """
    seen, names = set[int](), []
    for joint in hinges.tolist():
        name = joint_name(model, joint)
        names.append(name + SECOND if joint in seen else name)
        seen.add(joint)
    return names


def hinge_angles(model: Any, hinges: NDArray[np.int64], qpos: Vector) -> Vector:
    """(hinges,) angles at a configuration of MuJoCo's; a rod's spin is lost."""
    angles = np.array(qpos[model.jnt_qposadr[hinges]], np.float64)
    for k in np.flatnonzero(model.jnt_type[hinges] == BALL)[::2].tolist():
        axes, place = across(model, int(hinges[k])), model.jnt_qposadr[hinges[k]]
        turn = pin.Quaternion(*qpos[place : place + 4].tolist()).normalized().toRotationMatrix()
        x, y, z = axes.T @ turn @ axes[:, 2]
        angles[k : k + 2] = np.arctan2(-y, z), np.arcsin(np.clip(x, -1.0, 1.0))
    return angles


def set_hinges(
    model: Any,
    hinges: NDArray[np.int64],
    angles: Vector,
    speeds: Vector,
    qpos: Vector,
    qvel: Vector,
) -> None:
    """Write angles and velocities (hinges,) into MuJoCo's arrays; rods do not spin."""
    balls = model.jnt_type[hinges] == BALL
    qpos[model.jnt_qposadr[hinges[~balls]]] = angles[~balls]
    qvel[model.jnt_dofadr[hinges[~balls]]] = speeds[~balls]
    for k in np.flatnonzero(balls)[::2].tolist():
        axes, joint = across(model, int(hinges[k])), hinges[k]
        second = pin.exp3(angles[k + 1] * axes[:, 1])
        turn = pin.Quaternion(pin.exp3(angles[k] * axes[:, 0]) @ second)
        place, column = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        qpos[place : place + 4] = turn.w, turn.x, turn.y, turn.z
        turning = speeds[k] * second.T @ axes[:, 0] + speeds[k + 1] * axes[:, 1]
        qvel[column : column + 3] = turning
