"""The same robot in MuJoCo: the same URDF, armature and joint damping, on a plane that its feet touch."""

from __future__ import annotations

from importlib.metadata import version
from importlib.util import find_spec
from typing import Any

import numpy as np
import pinocchio as pin

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, Vector

__all__ = ["MujocoPeer", "mujoco_version"]

FOOT_RADIUS = 5e-3
"""Of the spheres that stand for the point feet, m; the plane lies as much lower."""


def mujoco_version() -> str | None:
    """Version of MuJoCo; None where it is not installed."""
    return version("mujoco") if find_spec("mujoco") is not None else None


class MujocoPeer:
    """A MuJoCo model of a robot and its state.

    Args:
        robot: whose URDF is read.
        friction: sliding friction coefficient of feet and plane.
        dt: step, s.

    Attributes:
        model: ``mujoco.MjModel``; solver, integrator and contact softness are MuJoCo's defaults.
        data: ``mujoco.MjData``.
    """

    def __init__(self, robot: Robot, *, friction: float, dt: float) -> None:
        import mujoco

        self._mujoco: Any = mujoco
        spec = mujoco.MjSpec.from_file(str(robot.urdf))
        spec.compiler.discardvisual = True
        spec.option.timestep = dt
        base = spec.bodies[1]
        base.add_freejoint()
        sliding = (friction, 0.005, 0.0001)
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1), pos=(0, 0, -FOOT_RADIUS), friction=sliding
        )
        for foot in robot.feet:
            # Massless, and it meets the plane only: MuJoCo's contacts within the robot are not wanted.
            spec.body(foot).add_geom(
                type=mujoco.mjtGeom.mjGEOM_SPHERE,
                size=(FOOT_RADIUS, 0, 0),
                mass=0.0,
                friction=sliding,
                contype=1,
                conaffinity=0,
            )
        self.model: Any = spec.compile()
        self.model.dof_armature[:] = robot.model.armature
        self.model.dof_damping[:] = robot.model.damping
        self.model.jnt_limited[:] = 0
        self.data: Any = mujoco.MjData(self.model)
        frames = [robot.model.frames[robot.frame_id(name)] for name in robot.thrusters]
        self._mounts = [frame.placement.translation.copy() for frame in frames]
        self._base: int = base.id
        self._joints = len(robot.joints)

    def reset(self, q: Vector, v: Vector) -> None:
        """Put the robot in a state; the solver starts cold.

        Args:
            q: (nq,) configuration, Pinocchio's order (quaternion xyzw).
            v: (nv,) generalised velocity, base in body axes.
        """
        self._mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = np.concatenate((q[:3], q[[6, 3, 4, 5]], q[7:]))
        self.data.qvel[:] = v
        self.data.qvel[:3] = pin.Quaternion(q[3:7]).matrix() @ v[:3]  # MuJoCo's is in world axes
        self._mujoco.mj_kinematics(self.model, self.data)
        self._mujoco.mj_comPos(self.model, self.data)

    def apply(self, command: Command) -> None:
        """Torques and thrusts of the coming steps, the thrusts at the mounts' present places.

        Args:
            command: as the simulator takes it; the thrusters are fixed to the body.
        """
        data = self.data
        data.qfrc_applied[:] = 0.0
        data.qfrc_applied[-self._joints :] = command.torque
        position, rotation = data.xpos[self._base], data.xmat[self._base].reshape(3, 3)
        for mount, force in zip(self._mounts, command.thrust, strict=True):
            point = position + rotation @ mount
            self._mujoco.mj_applyFT(self.model, data, force, np.zeros(3), point, self._base, data.qfrc_applied)
