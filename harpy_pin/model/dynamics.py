"""Rigid-body dynamics through Pinocchio: M a + n = S τ + J_fᵀ f + J_tᵀ u_t.

:class:`Dynamics` evaluates every term that the simulator and the whole-body controller need in one pass, into
arrays that live as long as the object: nothing is allocated per call. Frames, order and signs are those of
:class:`harpy_pin.model.state.State`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn

import numpy as np
import pinocchio as pin
from numba import njit

from harpy_pin.errors import RobotError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["Dynamics"]

_WORLD = pin.Convention.WORLD


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
        frames = [self.model.frames[robot.frame_id(name)] for name in (*robot.feet, *robot.thrusters)]
        self._parents = np.array([frame.parentJoint for frame in frames], dtype=np.int64)
        self._offsets = np.array([frame.placement.translation for frame in frames]).reshape(-1, 3)
        # Pinocchio writes into these views in place, so they are taken once.
        self.mass_matrix: Vector = self.data.M
        self.bias: Vector = self.data.nle
        self._joint_jacobian: Vector = self.data.J
        self._placement = _rows([x.rotation.T[0] for x in self.data.oMi], 12)
        self._motion = _rows([x.linear for x in self.data.v], 6)
        self._acceleration = _rows([x.linear for x in self.data.a_gf], 6)
        self._gravity = np.array(self.model.gravity.linear)
        self._support = np.array([self._supported(frame.parentJoint) for frame in frames], dtype=np.bool_).reshape(
            -1, nv
        )
        points = feet + thrusters
        self._points = np.zeros((points, 3))
        self._velocity = np.zeros((points, 3))
        self._drift = np.zeros((points, 3))
        self._jacobian = np.zeros((3 * points, nv))
        self.foot_jacobian: Vector = self._jacobian[: 3 * feet]
        self.thruster_jacobian: Vector = self._jacobian[3 * feet :]
        self.foot_position: Vector = self._points[:feet]
        self.foot_velocity: Vector = self._velocity[:feet]
        self.foot_drift: Vector = self._drift[:feet].reshape(-1)

    def __reduce__(self) -> NoReturn:
        """Refuse copies: they would keep arrays that no update reaches."""
        raise TypeError("Dynamics holds views of Pinocchio's data and cannot be copied or pickled; make a new one")

    def _supported(self, joint: int) -> list[bool]:
        """Which columns of the Jacobian move what is fixed to a joint."""
        chain = set(self.model.supports[joint])
        columns = [False] * self.model.nv
        for j in range(1, self.model.njoints):
            if j in chain:
                part = self.model.joints[j]
                columns[part.idx_v : part.idx_v + part.nv] = [True] * part.nv
        return columns

    def update(self, q: Vector, v: Vector) -> None:
        """Evaluate every term.

        Args:
            q: (nq,) configuration.
            v: (nv,) generalised velocity.
        """
        # CRBA leaves placements and Jacobian columns in world axes, the bias terms the velocity of each joint
        # and its acceleration at zero joint acceleration: everything else follows from them.
        pin.crba(self.model, self.data, q, _WORLD)
        pin.nonLinearEffects(self.model, self.data, q, v)
        _points(
            self._placement,
            self._motion,
            self._acceleration,
            self._gravity,
            self._joint_jacobian,
            self._parents,
            self._offsets,
            self._support,
            self._points,
            self._velocity,
            self._drift,
            self._jacobian,
        )

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


def _rows(parts: Sequence[Vector], width: int) -> Vector:
    """(len(parts), width) view of the memory of equally spaced parts, whose first entries are given."""
    addresses = np.array([part.ctypes.data for part in parts])
    stride = 8 * width
    if not (np.diff(addresses) == stride).all():  # another layout of Pinocchio's data than the one known here
        raise RobotError(f"Pinocchio {pin.__version__} keeps its data in a layout this library does not know")
    return np.lib.stride_tricks.as_strided(parts[0], (len(parts), width), (stride, 8))


@njit(cache=True)
def _points(  # type: ignore[no-untyped-def]
    placement,
    motion,
    acceleration,
    gravity,
    joint_jacobian,
    parents,
    offsets,
    support,
    points,
    velocity,
    drift,
    jacobian,
):
    """Positions, velocities, classical accelerations at zero joint acceleration and linear Jacobians of points.

    Of each joint: placement [R column by column, p] in the world; velocity and acceleration (less gravity) [linear,
    angular] in its own axes.
    """
    for k in range(points.shape[0]):
        j = parents[k]
        r, u, a, o = placement[j], motion[j], acceleration[j], offsets[k]
        vx = u[0] + u[4] * o[2] - u[5] * o[1]
        vy = u[1] + u[5] * o[0] - u[3] * o[2]
        vz = u[2] + u[3] * o[1] - u[4] * o[0]
        ax = a[0] + a[4] * o[2] - a[5] * o[1] + u[4] * vz - u[5] * vy
        ay = a[1] + a[5] * o[0] - a[3] * o[2] + u[5] * vx - u[3] * vz
        az = a[2] + a[3] * o[1] - a[4] * o[0] + u[3] * vy - u[4] * vx
        for i in range(3):
            points[k, i] = r[9 + i] + r[i] * o[0] + r[3 + i] * o[1] + r[6 + i] * o[2]
            velocity[k, i] = r[i] * vx + r[3 + i] * vy + r[6 + i] * vz
            drift[k, i] = r[i] * ax + r[3 + i] * ay + r[6 + i] * az + gravity[i]
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        for i in range(support.shape[1]):
            if support[k, i]:
                e, f, g = joint_jacobian[3, i], joint_jacobian[4, i], joint_jacobian[5, i]
                jacobian[3 * k, i] = joint_jacobian[0, i] + f * z - g * y
                jacobian[3 * k + 1, i] = joint_jacobian[1, i] + g * x - e * z
                jacobian[3 * k + 2, i] = joint_jacobian[2, i] + e * y - f * x
