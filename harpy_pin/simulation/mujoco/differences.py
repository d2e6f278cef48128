"""What a MuJoCo model of a robot has otherwise than the robot: numbers at zero angles, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin.errors import InputError
from harpy_pin.model.mjcf import known_joints, peak_torques
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import tree_record

ROOT = 1  # index of the floating base's joint in Pinocchio's model
SHARE = 0.01  # share by which numbers may differ
LENGTH = 1e-3  # distance by which places may differ, m
ANGLE = 1e-2  # angle by which axes may differ, rad
MAX_TURN, MAX_SHIFT = 0.2, 0.05
"""Difference of axes, and distance, m, beyond which a joint has another direction, axis or zero."""
HINGE, SLIDE = 3, 2  # ``mujoco.mjtJoint``
LEAST = 1e-6  # masses, inertias and friction below it are none


class AtZero:
    """Model and robot with the base at the origin and all joints at zero.

    ``link`` is Pinocchio's index of the joint that moves each body, 0 for what is no part; ``foot`` the feet's places.
    """

    def __init__(self, mujoco: Any, model: Any, robot: Robot, joints: NDArray[np.int64], free: int) -> None:
        self.model, self.robot, self.joints = model, robot, joints
        data = mujoco.MjData(model)
        first = int(model.jnt_qposadr[free])
        data.qpos[first : first + 7] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        data.qpos[model.jnt_qposadr[joints]] = 0.0
        mujoco.mj_kinematics(model, data)
        self.data = data
        numbers = {int(model.jnt_bodyid[free]): ROOT}
        numbers |= {int(model.jnt_bodyid[joint]): ROOT + 1 + k for k, joint in enumerate(joints)}
        self.link = np.zeros(model.nbody, np.int64)
        for body in range(1, model.nbody):
            self.link[body] = numbers.get(body, self.link[model.body_parentid[body]])
        self.own = robot.model.createData()
        pin.framesForwardKinematics(robot.model, self.own, pin.neutral(robot.model))
        places = [self.own.oMf[robot.frame_id(name)].translation for name in robot.feet]
        self.foot: Vector = np.array(places).reshape(-1, 3)

    def check_joints(self) -> None:
        """Refuse joints that do not turn or slide about the robot's axes, in its direction and from its zero."""
        robot, model = self.robot, self.model
        for joint, name, own in zip(self.joints, robot.joints, list(robot.model.joints)[ROOT + 1 :], strict=True):
            kind = SLIDE if "JointModelP" in own.shortname() else HINGE
            if model.jnt_type[joint] != kind:
                desired = "turn about one axis" if kind == HINGE else "slide"
                raise InputError(f"joint '{name}' of the MuJoCo model does not {desired}, as the robot's", name="model")
        frames, (_, centre, _) = list(self.own.oMi)[ROOT:], self.links()
        levers = [frame.act(body.lever) for frame, body in zip(frames, list(robot.model.inertias)[ROOT:], strict=True)]
        joints = robot.joints
        for what, names, theirs, ours, most in (
            ("axis or direction of joint", joints, self.data.xaxis[self.joints], self.axes(), MAX_TURN),
            ("place of joint", joints, self.data.xanchor[self.joints], [m.translation for m in frames[1:]], MAX_SHIFT),
            ("place of the link", joints, centre[1:], levers[1:], MAX_SHIFT),
        ):
            if line := _compared(what, "", names, theirs, ours, most):
                raise InputError(f"the MuJoCo model has other joints than the robot: {line}", name="model")

    def axes(self) -> list[Vector]:
        """(3,) axis of each joint of the robot, in the world."""
        frames, axes = list(self.own.oMi)[ROOT:], tree_record(self.robot.model)["axis"][0]
        return [frame.rotation @ axis for frame, axis in zip(frames, axes, strict=True)][1:]

    def links(self) -> tuple[Vector, Vector, Vector]:
        """Mass, kg, centre, m, and inertia about it, kg·m², world axes, of the model's links, in Pinocchio's order."""
        model, data, count = self.model, self.data, self.robot.model.njoints - ROOT
        mass, centre, inertia = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 3, 3))
        for n in range(count):
            bodies = np.flatnonzero(self.link == ROOT + n)
            mass[n] = model.body_mass[bodies].sum()
            if mass[n] > 0.0:
                centre[n] = model.body_mass[bodies] @ data.xipos[bodies] / mass[n]
            for body in bodies:
                axes, arm = data.ximat[body].reshape(3, 3), data.xipos[body] - centre[n]
                inertia[n] += (axes * model.body_inertia[body]) @ axes.T
                inertia[n] += model.body_mass[body] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return mass, centre, inertia


def differences(here: AtZero) -> str:
    """See :attr:`harpy_pin.simulation.mujoco.MujocoBridge.differences`."""
    robot, data, joints = here.robot, here.data, here.joints
    links, hinges, base = ("the base", *robot.joints), robot.joints, robot.model.nv - len(joints)
    frames, bodies = list(here.own.oMi)[ROOT:], list(robot.model.inertias)[ROOT:]
    mass, centre, inertia = here.links()
    own = [frame.act(body) for frame, body in zip(frames, bodies, strict=True)]
    known, damping = known_joints(here.model, joints), robot.model.damping[base:]
    lines = [
        _compared("mass", " kg", links, mass, [body.mass for body in own]),
        _compared("centre of mass", " m", links, centre, [body.lever for body in own], LENGTH),
        _compared("inertia", " kg·m²", links, inertia, [body.inertia for body in own]),
        _compared("place of joint", " m", hinges, data.xanchor[joints], [m.translation for m in frames[1:]], LENGTH),
        _compared("axis of joint", "", hinges, data.xaxis[joints], here.axes(), ANGLE),
        _compared("armature", " kg·m²", hinges, known["armature"], robot.model.armature[base:]),
        _compared("damping", " N·m·s/rad", hinges, known["damping"], damping),
        _compared("dry friction", " N·m", hinges, known["friction"], robot.dry_friction),
        _compared("largest torque", " N·m", hinges, peak_torques(here.model, joints), robot.torque_limit),
    ]
    if any(lines[5:]):
        lines.append("robot.with_mujoco(model) takes what the joints have in the model")
    return "\n".join(line for line in lines if line)


def _compared(
    what: str, unit: str, names: Sequence[str], theirs: ArrayLike, ours: ArrayLike, most: float | None = None
) -> str:
    """A line about the numbers, vectors or matrices that differ by more than ``most``, or by a share of their size."""
    if not names:
        return ""
    a, b = (np.asarray(values, np.float64).reshape(len(names), -1) for values in (theirs, ours))
    with np.errstate(invalid="ignore"):
        apart, size = np.linalg.norm(a - b, axis=1), np.fmax(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1))
        off = (a != b).any(axis=1) & ~(apart <= (SHARE * size + LEAST if most is None else most)) | np.isinf(apart)
    if not off.any():
        return ""
    worst = int(np.argmax(np.where(off, apart, -1.0)))
    pair = [str(x.round(3)) if len(x) == 3 else f"{np.linalg.norm(x):.4g}" for x in (a[worst], b[worst])]
    more = f"; and {int(off.sum()) - 1} more" if off.sum() > 1 else ""
    return f"{what} of {names[worst]}: {pair[0]}{unit} in the model, {pair[1]} in the robot{more}"
