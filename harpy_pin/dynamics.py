"""Rigid-body dynamics through Pinocchio: M a + n = S τ + J_fᵀ f + J_tᵀ u_t.

:class:`Dynamics` evaluates every term that the simulator and the whole-body controller need in one pass, into
arrays that live as long as the object: nothing is allocated per call.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numba import njit

from harpy_pin.robot import Robot
from harpy_pin.state import Vector

__all__ = ["Dynamics"]


class Dynamics:
    """Terms of the equations of motion at one state.

    All arrays are overwritten by :meth:`update`.

    Attributes:
        mass_matrix: (nv, nv) M(q), armature included (CRBA).
        bias: (nv,) n(q, v): Coriolis, centrifugal and gravity terms.
        foot_jacobian: (3 feet, nv) linear Jacobians of the feet, world axes.
        foot_drift: (3 feet,) J̇ v, acceleration of the feet at zero joint acceleration, m/s².
        foot_position: (feet, 3) world, m.
        foot_velocity: (feet, 3) world axes, m/s.
        thruster_jacobian: (3 thrusters, nv) linear Jacobians of the mounts, world axes.
    """

    def __init__(self, robot: Robot, *, gravity: Vector | None = None) -> None:
        self.robot = robot
        self.model = robot.model.copy() if gravity is not None else robot.model
        if gravity is not None:
            self.model.gravity.linear = np.asarray(gravity, dtype=np.float64)
        self.data = self.model.createData()
        nv, feet, thrusters = self.model.nv, len(robot.feet), len(robot.thrusters)
        self._foot_ids = [robot.frame_id(name) for name in robot.feet]
        self._thruster_ids = [robot.frame_id(name) for name in robot.thrusters]
        # Pinocchio writes into these views in place, so they are taken once.
        self.mass_matrix: Vector = self.data.M
        self.bias: Vector = self.data.nle
        self._joint_jacobian: Vector = self.data.J
        self._frames = [self.data.oMf[i].translation for i in (*self._foot_ids, *self._thruster_ids)]
        self._points = np.zeros((feet + thrusters, 3))
        self._support = np.array(
            [self._supported(i) for i in (*self._foot_ids, *self._thruster_ids)], dtype=np.bool_
        ).reshape(feet + thrusters, nv)
        self._jacobian = np.zeros((3 * (feet + thrusters), nv))
        self._velocity = np.zeros(3 * (feet + thrusters))
        self._zero = np.zeros(nv)
        self.foot_jacobian: Vector = self._jacobian[: 3 * feet]
        self.thruster_jacobian: Vector = self._jacobian[3 * feet :]
        self.foot_position: Vector = self._points[:feet]
        self.foot_velocity: Vector = self._velocity[: 3 * feet].reshape(feet, 3)
        self.foot_drift: Vector = np.zeros(3 * feet)

    def _supported(self, frame: int) -> list[bool]:
        """Which columns of the Jacobian move a frame."""
        chain = set(self.model.supports[self.model.frames[frame].parentJoint])
        columns = [False] * self.model.nv
        for j in range(1, self.model.njoints):
            if j in chain:
                joint = self.model.joints[j]
                columns[joint.idx_v : joint.idx_v + joint.nv] = [True] * joint.nv
        return columns

    def update(self, q: Vector, v: Vector) -> None:
        """Evaluate every term.

        Args:
            q: (nq,) configuration.
            v: (nv,) generalised velocity.
        """
        model, data = self.model, self.data
        pin.forwardKinematics(model, data, q, v, self._zero)
        drift = self.foot_drift
        for k, frame in enumerate(self._foot_ids):
            drift[3 * k : 3 * k + 3] = pin.getFrameClassicalAcceleration(
                model, data, frame, pin.LOCAL_WORLD_ALIGNED
            ).linear
        pin.crba(model, data, q, pin.Convention.WORLD)
        pin.nonLinearEffects(model, data, q, v)
        self._update_points(v)

    def update_kinematics(self, q: Vector, v: Vector) -> None:
        """Evaluate positions, velocities and Jacobians of feet and thrusters only."""
        pin.computeJointJacobians(self.model, self.data, q)
        self._update_points(v)

    def _update_points(self, v: Vector) -> None:
        pin.updateFramePlacements(self.model, self.data)
        points = self._points
        for k, translation in enumerate(self._frames):
            points[k] = translation
        _point_jacobians(self._joint_jacobian, self._support, points, v, self._jacobian, self._velocity)

    def acceleration(self, q: Vector, v: Vector, generalised_force: Vector) -> Vector:
        """Forward dynamics (ABA): M a + n = generalised_force.

        Args:
            q: (nq,) configuration.
            v: (nv,) generalised velocity.
            generalised_force: (nv,) τ + J_fᵀ f + J_tᵀ u_t.

        Returns:
            (nv,) generalised acceleration (a copy).
        """
        return np.array(pin.aba(self.model, self.data, q, v, generalised_force))

    def generalised_force(self, torque: Vector, foot_force: Vector, thrust: Vector) -> Vector:
        """S τ + J_fᵀ f + J_tᵀ u_t at the state of the last update.

        Args:
            torque: (joints,) joint torques, N·m.
            foot_force: (feet, 3) forces of the ground on the feet, world axes, N.
            thrust: (thrusters, 3) thruster forces, world axes, N.

        Returns:
            (nv,) generalised force; of a free flyer the first six entries are the wrench on the body, body axes.
        """
        force = np.concatenate((np.ravel(foot_force), np.ravel(thrust))) @ self._jacobian
        force[len(force) - len(torque) :] += torque
        return np.asarray(force)


@njit(cache=True)
def _point_jacobians(joint_jacobian, support, points, v, jacobian, velocity):  # type: ignore[no-untyped-def]
    """Linear Jacobians and velocities of points from the joint columns expressed at the world's origin."""
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        vx, vy, vz = 0.0, 0.0, 0.0
        for i in range(support.shape[1]):
            if support[k, i]:
                a, b, c = joint_jacobian[3, i], joint_jacobian[4, i], joint_jacobian[5, i]
                jx = joint_jacobian[0, i] + b * z - c * y
                jy = joint_jacobian[1, i] + c * x - a * z
                jz = joint_jacobian[2, i] + a * y - b * x
                jacobian[3 * k, i] = jx
                jacobian[3 * k + 1, i] = jy
                jacobian[3 * k + 2, i] = jz
                vx += jx * v[i]
                vy += jy * v[i]
                vz += jz * v[i]
        velocity[3 * k] = vx
        velocity[3 * k + 1] = vy
        velocity[3 * k + 2] = vz
