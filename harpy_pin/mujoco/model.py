"""A robot as a MuJoCo model: the bodies, joints, inertias, armatures and dampings of its Pinocchio model."""

from __future__ import annotations

from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

import numpy as np
import pinocchio as pin

from harpy_pin.errors import InputError, RobotError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import SLIDING, tree_record
from harpy_pin.mujoco.conventions import Conventions

__all__ = ["build_mujoco", "import_mujoco", "installed_version"]


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


def build_mujoco(
    robot: Robot, *, friction: float, dt: float, gravity: Vector, foot_radius: float
) -> tuple[Any, Conventions]:
    """The model of a robot above the plane z = 0, which only its feet touch.

    A foot is a massless sphere about the foot's point, and the plane lies lower by its radius: they touch where the
    point is at z = 0. Joints have no limits; solver, integrator and contact are MuJoCo's defaults.

    Args:
        robot: any that :func:`harpy_pin.model.robot.load_robot` takes.
        friction: sliding friction coefficient.
        dt: step, s.
        gravity: (3,) m/s².
        foot_radius: of the spheres, m.

    Returns:
        ``mujoco.MjModel``, and how its state is read and written. The feet's contacts are the model's contact pairs,
        in the order of ``robot.feet``.

    Raises:
        InputError: MuJoCo is not installed.
        RobotError: MuJoCo refuses the robot.
    """
    mujoco = import_mujoco()
    model = robot.model
    tree = tree_record(model)
    t = tree[0]
    spec = mujoco.MjSpec()
    spec.option.timestep = dt
    spec.option.gravity = gravity
    sphere, plane = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(
        name="ground", type=plane, size=(0, 0, 1), pos=(0, 0, -foot_radius), contype=0, conaffinity=0
    )
    bodies: list[Any] = []
    for i, name in enumerate(list(model.names)[1:]):
        parent = bodies[t["parent"][i]] if i else spec.worldbody
        quaternion = pin.Quaternion(np.array(t["placement"][i]))
        body = parent.add_body(
            name=f"body:{name}",
            pos=t["origin"][i],
            quat=(quaternion.w, quaternion.x, quaternion.y, quaternion.z),
            mass=t["mass"][i],
            ipos=t["centre"][i],
            fullinertia=[t["inertia"][i][a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))],
            explicitinertial=True,
        )
        if i:
            kind = mujoco.mjtJoint.mjJNT_SLIDE if t["kind"][i] == SLIDING else mujoco.mjtJoint.mjJNT_HINGE
            joint = body.add_joint(name=f"joint:{name}", type=kind, axis=t["axis"][i])
            joint.armature = float(model.armature[t["column"][i]])
        else:
            body.add_freejoint(name=f"joint:{name}")
        bodies.append(body)
    for foot in robot.feet:
        frame = model.frames[robot.frame_id(foot)]
        bodies[frame.parentJoint - 1].add_geom(
            name=f"foot:{foot}",
            type=sphere,
            size=(foot_radius, 0, 0),
            pos=frame.placement.translation,
            mass=0.0,
            contype=0,
            conaffinity=0,
        )
        pair = spec.add_pair(geomname1="ground", geomname2=f"foot:{foot}")
        pair.condim = 3
        pair.friction = (friction, friction, 0.005, 0.0001, 0.0001)
    try:
        compiled = spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise RobotError(f"MuJoCo refuses '{robot.name}': {reason}", path=robot.urdf) from error
    joints = [compiled.joint(f"joint:{name}") for name in robot.joints]
    places = [int(joint.dofadr[0]) for joint in joints]
    compiled.dof_damping[places] = model.damping[6:]
    return compiled, Conventions(tree, [int(joint.qposadr[0]) for joint in joints], places)
