"""Rigid-body dynamics through Pinocchio: M a + n = S τ + J_fᵀ f + J_tᵀ u_t.

:class:`Dynamics` evaluates every term that the simulator and the whole-body controller need in one pass, into
arrays that live as long as the object: nothing is allocated per call. Frames, order and signs are those of
:class:`harpy_pin.model.state.State`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np
import pinocchio as pin
from numba import njit

from harpy_pin import checks
from harpy_pin.errors import RobotError
from harpy_pin.model.entry import all_finite
from harpy_pin.model.record import field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["Dynamics"]

_WORLD = pin.Convention.WORLD


class Dynamics:
    """Terms of the equations of motion at one state.

    All arrays are overwritten by :meth:`update`.

    Attributes:
        finite: whether the last state held numbers only, and so do the terms.
        record: all terms, for kernels; the attributes below are views of its fields, which have their names. Further
            fields: ``damping`` (nv,) of the joints, N·m·s/rad.
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
        self.finite = False
        self.model = robot.model.copy() if gravity is not None else robot.model
        if gravity is not None:
            self.model.gravity.linear = checks.vector("gravity", gravity, 3)
        self.data = self.model.createData()
        nv, feet, thrusters = self.model.nv, len(robot.feet), len(robot.thrusters)
        frames = [self.model.frames[robot.frame_id(name)] for name in (*robot.feet, *robot.thrusters)]
        self.record = make_record(
            mass_matrix=np.zeros((nv, nv)),
            bias=np.zeros(nv),
            damping=self.model.damping,
            foot_jacobian=np.zeros((3 * feet, nv)),
            foot_drift=np.zeros(3 * feet),
            foot_position=np.zeros((feet, 3)),
            foot_velocity=np.zeros((feet, 3)),
            thruster_jacobian=np.zeros((3 * thrusters, nv)),
            gravity=np.array(self.model.gravity.linear),
            # Of each foot, then of each thruster: its joint, its place there (m), and the columns that move it.
            parent=np.array([frame.parentJoint for frame in frames], dtype=np.int64),
            offset=np.array([frame.placement.translation for frame in frames]).reshape(-1, 3),
            support=np.array([self._supported(frame.parentJoint) for frame in frames], dtype=np.bool_).reshape(-1, nv),
        )
        self.mass_matrix: Vector = field(self.record, "mass_matrix")
        self.bias: Vector = field(self.record, "bias")
        self.foot_jacobian: Vector = field(self.record, "foot_jacobian")
        self.foot_drift: Vector = field(self.record, "foot_drift")
        self.foot_position: Vector = field(self.record, "foot_position")
        self.foot_velocity: Vector = field(self.record, "foot_velocity")
        self.thruster_jacobian: Vector = field(self.record, "thruster_jacobian")
        # Pinocchio writes into these in place, so they are taken once. Of each joint: placement [R column by column, p]
        # in the world; velocity and acceleration (less gravity) [linear, angular] in its own axes.
        data = self.data
        self._pinocchio: Any = (
            data.M,
            data.nle,
            data.J,
            _rows([x.rotation.T[0] for x in data.oMi], 12),
            _rows([x.linear for x in data.v], 6),
            _rows([x.linear for x in data.a_gf], 6),
        )

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
        """Evaluate every term; :attr:`finite` says whether they are numbers.

        Args:
            q: (nq,) configuration.
            v: (nv,) generalised velocity.

        Raises:
            InputError: wrong shapes, or entries that are no numbers at all.
        """
        # CRBA leaves placements and Jacobian columns in world axes, the bias terms the velocity of each joint
        # and its acceleration at zero joint acceleration: everything else follows from them.
        try:
            pin.crba(self.model, self.data, q, _WORLD)
            pin.nonLinearEffects(self.model, self.data, q, v)
        except (TypeError, ValueError):  # Pinocchio knows the sizes
            q, v = checks.array("q", q, self.model.nq), checks.array("v", v, self.model.nv)
            pin.crba(self.model, self.data, q, _WORLD)
            pin.nonLinearEffects(self.model, self.data, q, v)
        mass_matrix, bias, jacobian, placement, motion, acceleration = self._pinocchio
        self.finite = _collect(mass_matrix, bias, jacobian, placement, motion, acceleration, self.record)

    def acceleration(self, q: Vector, v: Vector, generalised_force: Vector) -> Vector:
        """Forward dynamics (ABA): M a + n = generalised_force.

        Args:
            q: (nq,) configuration.
            v: (nv,) generalised velocity.
            generalised_force: (nv,) τ + J_fᵀ f + J_tᵀ u_t.

        Returns:
            (nv,) generalised acceleration (a copy).
        """
        nv = self.model.nv
        q, v = checks.array("q", q, self.model.nq), checks.array("v", v, nv)
        return np.array(pin.aba(self.model, self.data, q, v, checks.array("generalised_force", generalised_force, nv)))

    def generalised_force(self, torque: Vector, foot_force: Vector, thrust: Vector) -> Vector:
        """S τ + J_fᵀ f + J_tᵀ u_t at the state of the last update.

        Args:
            torque: (joints,) joint torques, N·m.
            foot_force: (feet, 3) forces of the ground on the feet, world axes, N.
            thrust: (thrusters, 3) thruster forces, world axes, N.

        Returns:
            (nv,) generalised force; of a free flyer the first six entries are the wrench on the body, body axes.
        """
        feet, thrusters, joints = len(self.robot.feet), len(self.robot.thrusters), len(self.robot.joints)
        force: Vector = checks.array("foot_force", foot_force, (feet, 3)).ravel() @ self.foot_jacobian
        force += checks.array("thrust", thrust, (thrusters, 3)).ravel() @ self.thruster_jacobian
        force[len(force) - joints :] += checks.array("torque", torque, joints)
        return force


def _rows(parts: Sequence[Vector], width: int) -> Vector:
    """(len(parts), width) view of the memory of equally spaced parts, whose first entries are given."""
    addresses = np.array([part.ctypes.data for part in parts])
    stride = 8 * width
    if not (np.diff(addresses) == stride).all():  # another layout of Pinocchio's data than the one known here
        raise RobotError(f"Pinocchio {pin.__version__} keeps its data in a layout this library does not know")
    return np.lib.stride_tricks.as_strided(parts[0], (len(parts), width), (stride, 8))


@njit(cache=True)
def _collect(mass_matrix, bias, joint_jacobian, placement, motion, acceleration, record):  # type: ignore[no-untyped-def]
    """Copy what Pinocchio computed, and derive from it the motion and the Jacobians of feet and thrusters.

    Returns:
        Whether all terms are numbers: joints, velocities and orientation enter the bias, and the base has a place.
    """
    d = record[0]
    d.mass_matrix[:] = mass_matrix
    d.bias[:] = bias
    feet = d.foot_position.shape[0]
    for k in range(d.parent.shape[0]):
        j = d.parent[k]
        r, o = placement[j], d.offset[k]
        x = r[9] + r[0] * o[0] + r[3] * o[1] + r[6] * o[2]
        y = r[10] + r[1] * o[0] + r[4] * o[1] + r[7] * o[2]
        z = r[11] + r[2] * o[0] + r[5] * o[1] + r[8] * o[2]
        if k >= feet:
            _point_jacobian(joint_jacobian, d.support[k], x, y, z, d.thruster_jacobian[3 * (k - feet) :])
        else:
            _point_jacobian(joint_jacobian, d.support[k], x, y, z, d.foot_jacobian[3 * k :])
            # Velocity, and classical acceleration at zero joint acceleration.
            u, a = motion[j], acceleration[j]
            vx = u[0] + u[4] * o[2] - u[5] * o[1]
            vy = u[1] + u[5] * o[0] - u[3] * o[2]
            vz = u[2] + u[3] * o[1] - u[4] * o[0]
            ax = a[0] + a[4] * o[2] - a[5] * o[1] + u[4] * vz - u[5] * vy
            ay = a[1] + a[5] * o[0] - a[3] * o[2] + u[5] * vx - u[3] * vz
            az = a[2] + a[3] * o[1] - a[4] * o[0] + u[3] * vy - u[4] * vx
            d.foot_position[k, 0], d.foot_position[k, 1], d.foot_position[k, 2] = x, y, z
            for i in range(3):
                d.foot_velocity[k, i] = r[i] * vx + r[3 + i] * vy + r[6 + i] * vz
                d.foot_drift[3 * k + i] = r[i] * ax + r[3 + i] * ay + r[6 + i] * az + d.gravity[i]
    return all_finite(bias) and all_finite(placement[1, 9:])


@njit(cache=True)
def _point_jacobian(joint_jacobian, support, x, y, z, out):  # type: ignore[no-untyped-def]
    """Linear Jacobian of a point in the world, into the first three rows of ``out``."""
    for i in range(support.shape[0]):
        if support[i]:
            e, f, g = joint_jacobian[3, i], joint_jacobian[4, i], joint_jacobian[5, i]
            out[0, i] = joint_jacobian[0, i] + f * z - g * y
            out[1, i] = joint_jacobian[1, i] + g * x - e * z
            out[2, i] = joint_jacobian[2, i] + e * y - f * x
