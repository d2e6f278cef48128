"""The robot in the sagittal plane: every term of its equations of motion in one compiled pass.

The numbers are those of the Pinocchio model of :func:`planar_robot`.
Coordinates (x, z, pitch, left hip, left knee, right hip, right knee); velocities are their
derivatives. Vectors in the plane are (x, z); a positive pitch turns z towards x.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, RobotError
from harpy_pin.kernels import kernel
from harpy_pin.model.dynamics import EquationsRecord
from harpy_pin.model.record import Records, field, fields, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

NV = 7
"""Degrees of freedom."""
LOCKED = ("left_hip_frontal", "right_hip_frontal")
"""Joints held at zero."""
JOINT_TYPES = ["JointModelComposite", *["JointModelRY"] * 4]


def planar_robot(robot: Robot) -> Robot:
    """A robot restricted to the plane y = 0.

    The base's coordinates are (x, z, pitch), its velocities their derivatives, so q and v have the
    same length.

    Args:
        robot: a robot on a free flyer.

    Raises:
        InputError: a joint to lock does not exist.
    """
    for name in LOCKED:
        if not robot.model.existJointName(name):
            raise InputError.unknown("joint", name, robot.joints)
    base = pin.JointModelComposite(3)
    base.addJoint(pin.JointModelPX())
    base.addJoint(pin.JointModelPZ())
    base.addJoint(pin.JointModelRY())
    full = pin.buildModelFromUrdf(str(robot.urdf), base)
    for name in robot.joints:
        column = full.joints[full.getJointId(name)].idx_v
        full.armature[column] = robot.model.armature[
            robot.model.joints[robot.model.getJointId(name)].idx_v
        ]
    model = pin.buildReducedModel(
        full, [full.getJointId(name) for name in LOCKED], np.zeros(full.nq)
    )
    model.gravity = robot.model.gravity
    return replace(robot, model=model)


class PlanarModelRecord(EquationsRecord):
    """A biped in the plane, and the terms of its equations of motion; links: the base, thigh and
    shin of each leg.
    """

    link_mass: Vector  # (5,) kg
    centre: Vector  # (5, 2) centre of mass (x, z) of each link in its frame, m
    inertia: Vector  # (5,) about the centre of mass, kg·m²
    origin: Vector  # (5, 2) of each link's frame in that before it, m
    foot: Vector  # (2, 2) in the shin's frame, m
    mount: Vector  # (2,) of the thrusters, body axes, m
    armature: Vector  # (7,) of the joints, kg·m²
    gravity: float  # m/s²


@dataclass(frozen=True, eq=False)
class PlanarModel:
    """Numbers of the planar robot."""

    robot: Robot  # the robot on a free flyer that it was made from
    planar: Robot  # the same robot in the plane, as :func:`planar_robot` gives it
    # the model and the terms of its equations of motion, for kernels; who evaluates terms takes a
    # copy. Links are base,
    # left thigh, left shank, right thigh, right shank. The terms have the names and axes of
    # :class:`~harpy_pin.model.dynamics.Dynamics`, with nothing along y: mass_matrix (7, 7), bias
    # (7,), foot_jacobian
    # (6, 7), foot_drift (6,), foot_position (2, 3), and thruster_jacobian (3, 7) of the mounts,
    # which lie on one line
    # across the plane.
    record: Records[PlanarModelRecord]

    @classmethod
    @checked
    def from_robot(cls, robot: Robot) -> PlanarModel:
        """Read the numbers of a biped with Harpy's kind of legs.

        Args:
            robot: a biped with thrusters, its hips and knees turning about y.

        Raises:
            RobotError: its planar model is not a base with two legs of hip and knee, or the
                thrusters do not lie on one line across the plane.
        """
        planar = planar_robot(robot)
        model = planar.model
        names = [model.joints[j].shortname() for j in range(1, model.njoints)]
        if names != JOINT_TYPES or len(planar.feet) != 2:
            raise RobotError(
                f"'{robot.name}' is no biped with hip and knee in the plane: joints {names}"
            )
        inertias = [model.inertias[k + 1] for k in range(5)]
        feet = [
            model.frames[planar.frame_id(name)].placement.translation[[0, 2]]
            for name in planar.feet
        ]
        mounts = [
            model.frames[planar.frame_id(name)].placement.translation[[0, 2]]
            for name in planar.thrusters
        ]
        if any(np.any(np.abs(mount - mounts[0]) > 1e-12) for mount in mounts):
            raise RobotError(
                f"the thrusters of '{robot.name}' do not lie on one line across the plane"
            )
        record = make_record(
            PlanarModelRecord,
            {"nv": NV, "feet": 2, "thrusts": 3},
            link_mass=np.array([inertia.mass for inertia in inertias]),
            centre=np.array([inertia.lever[[0, 2]] for inertia in inertias]),
            inertia=np.array([inertia.inertia[1, 1] for inertia in inertias]),
            origin=np.array([model.jointPlacements[k + 1].translation[[0, 2]] for k in range(5)]),
            foot=np.array(feet),
            mount=mounts[0] if mounts else np.zeros(2),
            armature=model.armature,
            damping=model.damping,
            gravity=-float(model.gravity.linear[2]),
        )
        return cls(robot, planar, record)

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return float(field(self.record, "link_mass").sum())

    @checked
    def terms(self, q: Vector, v: Vector) -> dict[str, Vector]:
        """Every term of the equations of motion at a state, by the names of the fields of
        :attr:`record`.

        Args:
            q: (7,) configuration in the plane: x and z of the base (m), its pitch, then hip and
                knee of each leg (rad).
            v: (7,) its rate, m/s and rad/s.
        """
        record = self.record.copy()
        planar_terms(q, v, record)
        return fields(record)


@kernel(q=(7,), v=(7,))
def planar_terms(q: Vector, v: Vector, d: PlanarModelRecord) -> None:
    """Terms of M a + n = S τ + J_fᵀ f + J_tᵀ u_t in the plane.

    Args:
        q: (7,) configuration.
        v: (7,) velocity.
        d: element of a copy of :attr:`PlanarModel.record`.
    """
    d.mass_matrix[:] = 0.0
    d.bias[:] = 0.0
    jacobian = np.zeros((3, NV))
    origin = np.zeros((5, 2))
    drift = np.zeros((5, 2))  # acceleration of the origins at zero generalised acceleration
    angle = np.zeros(5)
    rate = np.zeros(5)
    for k in range(5):
        parent = 0 if k in (1, 3) else k - 1
        if k == 0:
            angle[0], rate[0] = q[2], v[2]
            origin[0] = q[:2] + d.origin[0]
        else:
            arm = _turned(angle[parent], d.origin[k])
            origin[k] = origin[parent] + arm
            drift[k] = drift[parent] - rate[parent] * rate[parent] * arm
            angle[k], rate[k] = angle[parent] + q[2 + k], rate[parent] + v[2 + k]
        squared = rate[k] * rate[k]
        arm = _turned(angle[k], d.centre[k])
        _point_jacobian(k, origin[k] + arm, origin, jacobian)
        _add_link(k, drift[k] - squared * arm, jacobian, d)
        if k == 0:
            place = origin[0] + _turned(angle[0], d.mount)
            _point_jacobian(0, place, origin, d.thruster_jacobian)
        elif k in (2, 4):
            foot = k // 2 - 1
            arm = _turned(angle[k], d.foot[foot])
            place, left = origin[k] + arm, drift[k] - squared * arm
            d.foot_position[foot] = place[0], 0.0, place[1]
            d.foot_drift[3 * foot : 3 * foot + 3] = left[0], 0.0, left[1]
            _point_jacobian(k, place, origin, d.foot_jacobian[3 * foot : 3 * foot + 3])
    for i in range(NV):
        d.mass_matrix[i, i] += d.armature[i]
        for j in range(i):
            d.mass_matrix[j, i] = d.mass_matrix[i, j]


@kernel
def _turned(angle: float, point: Vector) -> Vector:
    """A point (x, z) of a link in world axes."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * point[0] + s * point[1], -s * point[0] + c * point[1]])


@kernel
def _add_link(k: int, a: Vector, jacobian: Vector, d: PlanarModelRecord) -> None:
    """Mass and bias of link k, from the Jacobian of its centre of mass and its acceleration."""
    mass = d.link_mass[k]
    d.bias += mass * (jacobian[0] * a[0] + jacobian[2] * (a[1] + d.gravity))
    for i in range(NV):
        for j in range(i + 1):
            turning = 1.0 if _turns(k, i) and _turns(k, j) else 0.0
            moving = jacobian[0, i] * jacobian[0, j] + jacobian[2, i] * jacobian[2, j]
            d.mass_matrix[i, j] += mass * moving + d.inertia[k] * turning


@kernel
def _turns(link: int, column: int) -> bool:
    """Whether a coordinate turns a link: the pitch all, a hip its leg, a knee its shank."""
    if column < 3:
        return column == 2
    joint = column - 2  # link that the joint drives
    return joint == link or (joint == link - 1 and link in (2, 4))


@kernel
def _point_jacobian(link: int, point: Vector, origin: Vector, out: Vector) -> None:
    """(3, 7) Jacobian of a point of a link; a turn by dθ about a pivot moves the point by (r_z,
    −r_x) dθ.
    """
    out[:] = 0.0
    out[0, 0] = 1.0
    out[2, 1] = 1.0
    for i in range(2, NV):
        if _turns(link, i):
            out[0, i] = point[1] - origin[i - 2, 1]
            out[2, i] = origin[i - 2, 0] - point[0]
