"""A robot as a MuJoCo model: the bodies, joints, inertias, armatures and dampings of its Pinocchio
model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, RobotError
from harpy_pin.model.entry import as_array
from harpy_pin.model.loops import Coupling
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.posed import Posed
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import SLIDING, UNBOUNDED, tree_record
from harpy_pin.simulation.mujoco.conventions import Conventions, import_mujoco

NO_MOMENT = np.zeros(3)
TIED, RIGID = (2e-3, 1.0), (0.9999, 0.9999, 1e-3, 0.5, 2.0)
"""``solref`` and ``solimp`` of closed loops and of the dry friction of their joints: s and damping
ratio; constant impedance.
"""
MIN_MASS, MIN_INERTIA = 1e-12, 1e-12
"""Least mass and inertia of a body that moves, kg and kg·m²: MuJoCo takes no smaller ones, whatever
the joint's armature.
"""


class MujocoModel(KeepsViews):
    """A robot above the plane z = 0, which only its feet touch, and its state in MuJoCo. It has no
    other geometry.

    A foot is a massless sphere about the foot's point, and the plane lies lower by its radius: they
    touch where the point is at z = 0. On request every foot has a plane of its own, which may be
    moved. Joints end where the robot's do; solver, integrator and contact are MuJoCo's defaults,
    with dense Jacobians.

    Args:
        robot: any that :func:`harpy_pin.model.loading.load_robot` takes.
        friction: sliding friction coefficient.
        dt: step, s.
        gravity: (3,) m/s².
        foot_radius: of the spheres, m.
        own_planes: whether every foot has a plane of its own.

    Attributes:
        mujoco: the module.
        model: ``mujoco.MjModel``; its contact pairs are those of the feet, in the order of
            ``robot.feet``.
        data: ``mujoco.MjData``.
        feet: the feet's geoms, in that order.
        planes: the geoms of their own planes, if there are any, in that order.
        joint_places: of the robot's joints among MuJoCo's velocities.
        conventions: how states are written and read.
        qpos: of the data.
        qvel: of the data.

    Raises:
        InputError: MuJoCo is not installed.
        RobotError: MuJoCo refuses the robot.
    """

    _rebuilt = ("mujoco", "qpos", "qvel", "_applied", "_body_position", "_mounts")

    @checked
    def __init__(
        self,
        robot: Robot,
        *,
        friction: float,
        dt: float,
        gravity: Vector,
        foot_radius: float,
        own_planes: bool = False,
    ) -> None:
        mujoco, self._robot = import_mujoco(), robot
        tree = tree_record(robot.model, robot.loops)
        planes = [f"ground:{foot}" for foot in robot.feet] if own_planes else ["ground"]
        spec = _describe(
            mujoco, robot, tree, friction=friction, foot_radius=foot_radius, planes=planes
        )
        spec.option.timestep = dt
        # Newton's solver is wrong with sparse ones in 4.0.0
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        spec.option.gravity = checks.vector("gravity", gravity, 3)
        try:
            self.model: Any = spec.compile()
        except ValueError as error:
            reason = " ".join(str(error).split())
            raise RobotError(f"MuJoCo refuses '{robot.name}': {reason}", path=robot.urdf) from error
        self.conventions = Conventions(self.model, robot)
        self.joint_places = self.conventions.velocity.tolist()
        self.model.dof_damping[self.joint_places] = robot.damping
        passive = self.conventions.passive
        self.model.dof_damping[passive] = tree["loops"]["damping"][0]
        self.model.dof_frictionloss[passive] = tree["loops"]["dry"][0]
        self.model.dof_solref[passive], self.model.dof_solimp[passive] = TIED, RIGID
        self.data: Any = mujoco.MjData(self.model)
        self.feet = [int(self.model.geom(f"foot:{foot}").id) for foot in robot.feet]
        self.planes = [int(self.model.geom(name).id) for name in planes if own_planes]
        self._sizes = (robot.nq, robot.nv)
        self._base = int(
            self.model.jnt_bodyid[self.model.joint(f"joint:{robot.model.names[1]}").id]
        )
        self._rebuild()

    def _rebuild(self) -> None:
        """Views of MuJoCo's data, which stay where they are; asking for them anew costs as much as
        half a step.
        """
        data, robot, self.mujoco = self.data, self._robot, import_mujoco()
        self.qpos, self.qvel, self._applied = data.qpos, data.qvel, data.qfrc_applied
        self._body_position = data.xpos[self._base]
        sites = [self.model.site(f"thruster:{name}") for name in robot.thrusters]
        drags = [0.0] * (len(sites) - len(robot.rotors)) + [rotor.drag for rotor in robot.rotors]
        self._mounts = [
            (int(site.bodyid[0]), data.site_xpos[int(site.id)], drag)
            for site, drag in zip(sites, drags, strict=True)
        ]

    @checked
    def reset(self, q: Vector, v: Vector) -> None:
        """Put the robot in a state; the solver starts cold.

        Args:
            q: (nq,) configuration.
            v: (nv,) generalised velocity.
        """
        self.mujoco.mj_resetData(self.model, self.data)
        q, v = as_array("q", q, self._sizes[:1]), as_array("v", v, self._sizes[1:])
        self.conventions.assemble(q, v, self.qpos, self.qvel)
        self.mujoco.mj_fwdPosition(self.model, self.data)

    def apply(self, torque: Vector, thrust: Vector, push: Vector | None = None) -> None:
        """Forces of the coming steps, in the places where bodies and mounts are now.

        Args:
            torque: (joints,) N·m.
            thrust: (thrusters, 3) world axes, N.
            push: (3,) on the origin of the robot's body, world axes, N.

        Raises:
            InputError: an array of another shape, or of no numbers.
        """
        model, data, apply, out = self.model, self.data, self.mujoco.mj_applyFT, self._applied
        try:
            out[:] = 0.0
            out[self.joint_places] = torque
            for (body, place, drag), force in zip(self._mounts, thrust, strict=True):
                apply(model, data, force, drag * force if drag else NO_MOMENT, place, body, out)
            if push is not None:
                apply(model, data, push, NO_MOMENT, self._body_position, self._base, out)
        except (TypeError, ValueError, OverflowError):
            checks.array("torque", torque, self._sizes[1] - 6)
            checks.array("thrust", thrust, (len(self._mounts), 3))
            raise InputError(
                "push must be three numbers in float64", name="push", value=push
            ) from None


def _describe(
    mujoco: Any,
    robot: Robot,
    tree: Any,
    *,
    friction: float,
    foot_radius: float,
    planes: Sequence[str],
) -> Any:
    """``mujoco.MjSpec`` of a robot and the plane of that name, or one for each foot."""
    model, t = robot.model, tree[0]
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    sphere, plane = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_PLANE
    for name in planes:
        spec.worldbody.add_geom(
            name=name,
            type=plane,
            size=(0, 0, 1),
            pos=(0, 0, -foot_radius),
            contype=0,
            conaffinity=0,
        )
    bodies: list[Any] = []
    for i, name in enumerate(list(model.names)[1:]):
        parent = bodies[t["parent"][i]] if i else spec.worldbody
        quaternion = pin.Quaternion(np.array(t["placement"][i]))
        body = parent.add_body(
            name=f"body:{name}",
            pos=t["origin"][i],
            quat=(quaternion.w, quaternion.x, quaternion.y, quaternion.z),
            mass=max(t["mass"][i], MIN_MASS),
            ipos=t["centre"][i],
            fullinertia=_body_inertia(t["inertia"][i]),
            explicitinertial=True,
        )
        if i:
            kind = (
                mujoco.mjtJoint.mjJNT_SLIDE
                if t["kind"][i] == SLIDING
                else mujoco.mjtJoint.mjJNT_HINGE
            )
            joint = body.add_joint(name=f"joint:{name}", type=kind, axis=t["axis"][i])
            joint.armature = float(t["armature"][t["column"][i]])
            own = model.joints[i + 1].idx_q
            ends = model.lowerPositionLimit[own], model.upperPositionLimit[own]
            if t["kind"][i] != UNBOUNDED and np.isfinite(ends).all() and ends[0] < ends[1]:
                joint.limited, joint.range = 1, ends
        else:
            body.add_freejoint(name=f"joint:{name}")
        bodies.append(body)
    for k, foot in enumerate(robot.feet):
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
        pair = spec.add_pair(geomname1=planes[k % len(planes)], geomname2=f"foot:{foot}")
        pair.condim = 3
        pair.friction = (friction, friction, 0.005, 0.0001, 0.0001)
    for thruster in robot.thrusters:
        frame = model.frames[robot.frame_id(thruster)]
        bodies[frame.parentJoint - 1].add_site(
            name=f"thruster:{thruster}", pos=frame.placement.translation
        )
    _tie(mujoco, spec, robot, bodies)
    return spec


def _tie(mujoco: Any, spec: Any, robot: Robot, bodies: Sequence[Any]) -> None:
    """The robot's loops and couplings as equality constraints, as stiff as steps allow."""
    kinds, model = mujoco.mjtEq, robot.model
    for number, tie in enumerate(robot.loops.ties if robot.loops is not None else ()):
        equality = spec.add_equality(name=f"loop:{number}", solref=TIED, solimp=RIGID)
        if isinstance(tie, Coupling):
            equality.type, equality.objtype = kinds.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
            equality.name1, equality.name2 = f"joint:{tie.joint}", f"joint:{tie.leader}"
            equality.data[:5] = tie.offset, tie.ratio, 0.0, 0.0, 0.0
            continue
        names = [f"loop:{number}:{end}" for end in ("a", "b")]
        for name, frame in zip(names, (tie.first, tie.second), strict=True):
            at = model.frames[robot.frame_id(frame)]
            bodies[at.parentJoint - 1].add_site(name=name, pos=at.placement.translation)
        if tie.kind == "length":
            tendon = spec.add_tendon(name=f"loop:{number}")
            for name in names:
                tendon.wrap_site(name)
            equality.type, equality.objtype = kinds.mjEQ_TENDON, mujoco.mjtObj.mjOBJ_TENDON
            equality.name1 = f"loop:{number}"
            at_zero = Posed(replace(robot, loops=None), np.array(pin.neutral(model)))
            ends = [at_zero.frame(name).translation for name in (tie.first, tie.second)]
            equality.data[0] = tie.length - np.linalg.norm(ends[0] - ends[1])
        else:
            equality.type, equality.objtype = kinds.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_SITE
            equality.name1, equality.name2 = names


def _body_inertia(inertia: Vector) -> list[float]:
    """The inertia (3, 3) as MuJoCo reads it: xx, yy, zz, xy, xz, yz.

    Where rounding in a file made it that of no body, by at most what
    :func:`harpy_pin.model.urdf.read_urdf` lets pass, the same moment is added about every axis.
    """
    smallest, middle, largest = np.linalg.eigvalsh(inertia)
    missing = max(MIN_INERTIA - smallest, largest - smallest - middle)
    if missing > 0.0:
        inertia = inertia + 1.001 * missing * np.eye(3)
    return [float(inertia[a, b]) for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
