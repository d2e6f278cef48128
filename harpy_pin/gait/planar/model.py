"""The robot in the sagittal plane: every term of its equations of motion in one compiled pass.

The numbers are those of the Pinocchio model of :func:`planar_robot`.
Coordinates (x, z, pitch, left hip, left knee, right hip, right knee); velocities are their derivatives. Vectors in
the plane are (x, z); a positive pitch turns z towards x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin
from numba import njit

from harpy_pin.errors import InputError, RobotError
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

__all__ = ["NV", "PlanarModel", "planar_robot", "planar_terms"]

NV = 7
"""Degrees of freedom."""
JOINT_TYPES = ["JointModelComposite", *["JointModelRY"] * 4]


def planar_robot(robot: Robot, *, locked: Sequence[str] = ("left_hip_frontal", "right_hip_frontal")) -> Robot:
    """A robot restricted to the plane y = 0.

    The base's coordinates are (x, z, pitch), its velocities their derivatives, so q and v have the same length.

    Args:
        robot: a robot on a free flyer.
        locked: joints held at zero.

    Raises:
        InputError: a joint to lock does not exist.
    """
    for name in locked:
        if not robot.model.existJointName(name):
            raise InputError.unknown("joint", name, robot.joints)
    base = pin.JointModelComposite(3)
    base.addJoint(pin.JointModelPX())
    base.addJoint(pin.JointModelPZ())
    base.addJoint(pin.JointModelRY())
    full = pin.buildModelFromUrdf(str(robot.urdf), base)
    for name in robot.joints:
        column = full.joints[full.getJointId(name)].idx_v
        full.armature[column] = robot.model.armature[robot.model.joints[robot.model.getJointId(name)].idx_v]
    model = pin.buildReducedModel(full, [full.getJointId(name) for name in locked], np.zeros(full.nq))
    model.gravity = robot.model.gravity
    return replace(robot, model=model)


@dataclass(frozen=True, eq=False)
class PlanarModel:
    """Numbers of the planar robot.

    Attributes:
        robot: the robot on a free flyer that it was made from.
        planar: the same robot in the plane, as :func:`planar_robot` gives it.
        links: (5, 6) per link (base, left thigh, left shank, right thigh, right shank): mass (kg), centre of mass x
            and z in the link (m), inertia about it (kg·m²), origin x and z in the parent (m).
        points: (3, 2) left foot and right foot in their shanks, thruster mounts in the base, m.
        joint: (2, 7) armature (kg·m²) and damping (N·m·s/rad).
    """

    robot: Robot
    planar: Robot
    links: Vector
    points: Vector
    joint: Vector

    @classmethod
    def from_robot(cls, robot: Robot) -> PlanarModel:
        """Read the numbers of a biped with Harpy's kind of legs.

        Raises:
            RobotError: its planar model is not a base with two legs of hip and knee, or the thrusters do not lie on
                one line across the plane.
        """
        planar = planar_robot(robot)
        model = planar.model
        names = [model.joints[j].shortname() for j in range(1, model.njoints)]
        if names != JOINT_TYPES or len(planar.feet) != 2:
            raise RobotError(f"'{robot.name}' is no biped with hip and knee in the plane: joints {names}")
        links = np.zeros((5, 6))
        for k in range(5):
            inertia, origin = model.inertias[k + 1], model.jointPlacements[k + 1].translation
            links[k] = inertia.mass, *inertia.lever[[0, 2]], inertia.inertia[1, 1], *origin[[0, 2]]
        feet = [model.frames[planar.frame_id(name)].placement.translation[[0, 2]] for name in planar.feet]
        mounts = [model.frames[planar.frame_id(name)].placement.translation[[0, 2]] for name in planar.thrusters]
        if any(np.any(np.abs(mount - mounts[0]) > 1e-12) for mount in mounts):
            raise RobotError(f"the thrusters of '{robot.name}' do not lie on one line across the plane")
        points = np.array([*feet, mounts[0] if mounts else np.zeros(2)])
        return cls(robot, planar, links, points, np.array([model.armature, model.damping]))

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return float(self.links[:, 0].sum())

    def terms(self, q: Vector, v: Vector, gravity: float = 9.81) -> dict[str, Vector]:
        """Every term of the equations of motion at a state, by name (see :func:`planar_terms`)."""
        terms = {
            "mass_matrix": np.zeros((NV, NV)),
            "bias": np.zeros(NV),
            "foot_jacobian": np.zeros((4, NV)),
            "foot_drift": np.zeros(4),
            "foot_position": np.zeros((2, 2)),
            "mount_jacobian": np.zeros((2, NV)),
        }
        planar_terms(q, v, self.links, self.points, self.joint, gravity, *terms.values())
        return terms

    def neutral(self) -> Vector:
        """(7,) configuration with all coordinates at zero."""
        return np.array(pin.neutral(self.planar.model))


@njit(cache=True)
def planar_terms(
    q: Vector,
    v: Vector,
    links: Vector,
    points: Vector,
    joint: Vector,
    gravity: float,
    mass_matrix: Vector,
    bias: Vector,
    foot_jacobian: Vector,
    foot_drift: Vector,
    foot_position: Vector,
    mount_jacobian: Vector,
) -> None:
    """Terms of M a + n = S τ + J_fᵀ f + J_tᵀ u_t in the plane.

    Args:
        q: (7,) configuration.
        v: (7,) velocity.
        links: see :class:`PlanarModel`.
        points: likewise.
        joint: likewise.
        gravity: magnitude, m/s².
        mass_matrix: (7, 7) out, M, armature included.
        bias: (7,) out, n: Coriolis, centrifugal and gravity terms.
        foot_jacobian: (4, 7) out, rows left x, left z, right x, right z.
        foot_drift: (4,) out, J̇ v, m/s².
        foot_position: (2, 2) out, m.
        mount_jacobian: (2, 7) out, of the thruster mounts.
    """
    mass_matrix[:] = 0.0
    bias[:] = 0.0
    foot_jacobian[:] = 0.0
    mount_jacobian[:] = 0.0
    jacobian = np.zeros((2, NV))
    origin = np.zeros((5, 2))
    drift = np.zeros((5, 2))  # acceleration of the origins at zero generalised acceleration
    angle = np.zeros(5)
    rate = np.zeros(5)
    for k in range(5):
        parent = 0 if k in (1, 3) else k - 1
        if k == 0:
            angle[0], rate[0] = q[2], v[2]
            origin[0, 0], origin[0, 1] = q[0] + links[0, 4], q[1] + links[0, 5]
        else:
            c, s = np.cos(angle[parent]), np.sin(angle[parent])
            rx, rz = c * links[k, 4] + s * links[k, 5], -s * links[k, 4] + c * links[k, 5]
            squared = rate[parent] * rate[parent]
            origin[k, 0], origin[k, 1] = origin[parent, 0] + rx, origin[parent, 1] + rz
            drift[k, 0], drift[k, 1] = drift[parent, 0] - squared * rx, drift[parent, 1] - squared * rz
            angle[k], rate[k] = angle[parent] + q[2 + k], rate[parent] + v[2 + k]
        c, s = np.cos(angle[k]), np.sin(angle[k])
        squared = rate[k] * rate[k]
        # Centre of mass of the link.
        rx, rz = c * links[k, 1] + s * links[k, 2], -s * links[k, 1] + c * links[k, 2]
        _point_jacobian(k, origin[k, 0] + rx, origin[k, 1] + rz, origin, jacobian)
        mass, inertia = links[k, 0], links[k, 3]
        ax, az = drift[k, 0] - squared * rx, drift[k, 1] - squared * rz + gravity
        for i in range(NV):
            bias[i] += mass * (jacobian[0, i] * ax + jacobian[1, i] * az)
            for j in range(i + 1):
                turning = 1.0 if _turns(k, i) and _turns(k, j) else 0.0
                mass_matrix[i, j] += (
                    mass * (jacobian[0, i] * jacobian[0, j] + jacobian[1, i] * jacobian[1, j]) + inertia * turning
                )
        if k == 0:
            rx, rz = c * points[2, 0] + s * points[2, 1], -s * points[2, 0] + c * points[2, 1]
            _point_jacobian(0, origin[0, 0] + rx, origin[0, 1] + rz, origin, mount_jacobian)
        elif k in (2, 4):
            foot = k // 2 - 1
            rx, rz = c * points[foot, 0] + s * points[foot, 1], -s * points[foot, 0] + c * points[foot, 1]
            foot_position[foot, 0], foot_position[foot, 1] = origin[k, 0] + rx, origin[k, 1] + rz
            foot_drift[2 * foot], foot_drift[2 * foot + 1] = drift[k, 0] - squared * rx, drift[k, 1] - squared * rz
            rows = foot_jacobian[2 * foot : 2 * foot + 2]
            _point_jacobian(k, foot_position[foot, 0], foot_position[foot, 1], origin, rows)
    for i in range(NV):
        mass_matrix[i, i] += joint[0, i]
        for j in range(i):
            mass_matrix[j, i] = mass_matrix[i, j]


@njit(cache=True)
def _turns(link: int, column: int) -> bool:
    """Whether a coordinate turns a link: the pitch all, a hip its leg, a knee its shank."""
    if column < 3:
        return column == 2
    joint = column - 2  # link that the joint drives
    return joint == link or (joint == link - 1 and link in (2, 4))


@njit(cache=True)
def _point_jacobian(link, x, z, origin, out):  # type: ignore[no-untyped-def]
    """Jacobian of a point of a link; a turn by dθ about a pivot moves the point by (r_z, −r_x) dθ."""
    out[:] = 0.0
    out[0, 0] = 1.0
    out[1, 1] = 1.0
    for i in range(2, NV):
        if _turns(link, i):
            out[0, i] = z - origin[i - 2, 1]
            out[1, i] = origin[i - 2, 0] - x
