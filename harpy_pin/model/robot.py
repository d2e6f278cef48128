"""The robot: a Pinocchio model with named feet, thruster mounts, rotors and limits."""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, RobotError, shown
from harpy_pin.model.catalogue import (
    CATALOGUE,
    CatalogueRobot,
    catalogue_robot,
    installed_data,
    known_name,
    own_urdf,
)
from harpy_pin.model.flat_foot import FlatFoot, add_flat_feet
from harpy_pin.model.known_joints import KnownJoints, read_joints
from harpy_pin.model.loops import Loops, driven_supports, find_loops, read_loops, start_angles
from harpy_pin.model.mjcf import (
    Description,
    compile_mjcf,
    find_joints,
    free_joint,
    is_model,
    known_joints,
    named,
    peak_torques,
    read_mujoco,
)
from harpy_pin.model.mjcf_options import in_effect
from harpy_pin.model.rotor import Rotor
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import feet_moved
from harpy_pin.model.urdf import build_model, find_soles, read_xml, robot_errors

HARPY_FEET = ("left_foot", "right_foot")
HARPY_THRUSTERS = ("left_thruster", "right_thruster")
HARPY_THRUST_LIMIT = 53.0  # hardware limit of one thruster, N (equations.md §3)
SOLE_JOINTS = 5
"""Least number of joints of a leg whose foot is found to be flat: fewer cannot keep it level."""
ANY_DIRECTION = 0.1
"""Rotors push in any direction where the least singular value of their axes is above this share of
the largest.
"""


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """A floating-base robot with feet and, where it has any, thrusters and rotors fixed to its
    links.

    Attributes:
        model: Pinocchio model of the tree, root joint a free flyer, armature set. Of a robot with
            loops its configurations have the passive joints, too: :meth:`closed` gives them.
        urdf: the file it was read from; None for one that was read from a ``mujoco.MjModel``.
        feet: frame names of the contact points: point feet, and the corners of flat ones.
        thrusters: frame names of the mounts of all thrusters: the free ones, then the rotors.
        thrust_limit: largest magnitude of one free thruster's force, N.
        posture: (joints,) angles in which it stands on its feet, rad; None where none is known.
        flat_feet: how many contact points each foot has, in their order, where there are flat feet
            (:mod:`harpy_pin.model.flat_foot`); empty where all are points.
        rotors: thrusters with a fixed axis, the last of ``thrusters``.
        facing: yaw of the direction in which it faces, about the axes of its base, rad: gaits stand
            it facing x.
        foot_radius: (feet,) of the spheres around the feet's points in an MJCF file, m; 0 where
            there is none, and in other files.
        loops: what ties its joints to each other; None where they are a tree.
        label: its name in the catalogue; empty for a robot that was read from a file.
        source: its ``file``, what else :func:`load_robot` was told, and arrays (nv,) of the model
            that were changed since: what :func:`~harpy_pin.model.source.read_robot` makes it from
            again.
    """

    model: pin.Model
    urdf: Path | None
    feet: tuple[str, ...]
    thrusters: tuple[str, ...]
    thrust_limit: float
    posture: Vector | None = None
    flat_feet: tuple[int, ...] = ()
    rotors: tuple[Rotor, ...] = ()
    facing: float = 0.0
    label: str = ""
    source: Mapping[str, Any] = field(default_factory=dict)
    foot_radius: tuple[float, ...] = ()
    loops: Loops | None = None

    def __repr__(self) -> str:
        parts = [f"{self.mass:.3g} kg", f"{len(self.joints)} joints", f"{len(self.corners)} feet"]
        if self.thrusters:
            parts.append(f"{len(self.thrusters)} {'rotors' if self.rotors else 'thrusters'}")
        return f"Robot('{self.name}', {', '.join(parts)})"

    @property
    def corners(self) -> tuple[int, ...]:
        """How many contact points each foot has, in the order of :attr:`feet`: 1 for a point
        foot.
        """
        return self.flat_feet if self.flat_feet else (1,) * len(self.feet)

    @property
    def name(self) -> str:
        """Name of the robot in the catalogue, or else in its URDF."""
        return self.label or str(self.model.name)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the actuated joints, in the order of the torques."""
        return tuple(str(self.model.names[j]) for j in self.driven)

    @property
    def driven(self) -> tuple[int, ...]:
        """Pinocchio's numbers of the actuated joints."""
        passive = () if self.loops is None else self.loops.passive
        return tuple(j for j in range(2, self.model.njoints) if j not in passive)

    @property
    def nv(self) -> int:
        """Length of a velocity: base and actuated joints."""
        return 6 + len(self.driven)

    @property
    def nq(self) -> int:
        """Length of a configuration: base and actuated joints."""
        return self.model.nq if self.loops is None else 7 + len(self.driven)

    @property
    def columns(self) -> NDArray[np.int64]:
        """(joints,) of each actuated joint in a velocity of :attr:`model`."""
        return np.array([self.model.joints[j].idx_v for j in self.driven], dtype=np.int64)

    @property
    def layout(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(joints,) where the angle of each actuated joint is in a configuration, and (joints,) 1
        for one that turns without bounds, which has a cosine and a sine there.
        """
        count = np.array([self.model.joints[j].nq for j in self.driven], dtype=np.int64)
        return 7 + np.cumsum(count) - count, count - 1

    @property
    def places(self) -> NDArray[np.int64]:
        """(joints,) of each actuated joint in a configuration of :attr:`model`."""
        return np.array([self.model.joints[j].idx_q for j in self.driven], dtype=np.int64)

    @property
    def neutral(self) -> Vector:
        """(nq,) configuration with all joints at zero."""
        return np.array(pin.neutral(self.model)[: self.nq])

    @property
    def reference(self) -> Vector:
        """(nq,) configuration with all joints at zero; of a robot with loops one at which they are
        known to be closed.
        """
        q = self.neutral
        if self.loops is not None:
            q[7:] = self.loops.angles[np.array(self.driven) - 2]
        return q

    def closed(self, q: Vector) -> Vector:
        """Configuration of :attr:`model`, with loops closed; q itself where there are none.

        Args:
            q: (nq,) configuration.

        Raises:
            InputError: the loops cannot be closed there, or q has another shape.
        """
        return q if self.loops is None else self._close(q)[0]

    def velocity_map(self, q: Vector) -> Vector:
        """T (model.nv, nv): velocities of :attr:`model` are T v.

        Args:
            q: (nq,) configuration.

        Raises:
            InputError: as of :meth:`closed`.
        """
        return np.eye(self.nv) if self.loops is None else self._close(q)[1]

    def _close(self, q: Vector) -> tuple[Vector, Vector]:
        """Configuration of the tree, and T, of a robot with loops."""
        from harpy_pin.model.closure import closed_tree  # kernels, which no other robot needs here

        assert self.loops is not None
        return closed_tree(self.model, self.loops, checks.array("q", q, self.nq))

    def carriers(self, frame: str) -> tuple[int, ...]:
        """Pinocchio's numbers of the actuated joints that may move a frame, from the base on.

        Args:
            frame: its name.
        """
        body = self.model.frames[self.frame_id(frame)].parentJoint
        above: tuple[int, ...] = driven_supports(self.model, self.loops)[body]
        return above

    def integrate(self, q: Vector, displacement: Vector) -> Vector:
        """(nq,) configuration after a displacement (nv,), the base along a screw.

        Args:
            q: (nq,) configuration.
            displacement: velocity times time.
        """
        if self.loops is None:
            return np.asarray(pin.integrate(self.model, q, displacement))
        return np.asarray(self._space.integrate(q, displacement))

    def difference(self, q: Vector, other: Vector) -> Vector:
        """(nv,) displacement from a configuration to another one.

        Args:
            q: (nq,) where it begins.
            other: (nq,) where it ends.
        """
        if self.loops is None:
            return np.asarray(pin.difference(self.model, q, other))
        return np.asarray(self._space.difference(q, other))

    @property
    def _space(self) -> Any:
        """The space of configurations of base and actuated joints."""
        return pin.liegroups.SE3() * pin.liegroups.Rn(len(self.driven))

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return float(sum(inertia.mass for inertia in self.model.inertias))

    @property
    def torque_limit(self) -> Vector:
        """(joints,) peak torque of each joint, N·m."""
        return np.array(self.model.effortLimit[self.columns])

    @property
    def velocity_limit(self) -> Vector:
        """(joints,) largest speed of each joint, rad/s."""
        return np.array(self.model.velocityLimit[self.columns])

    @property
    def armature(self) -> Vector:
        """(joints,) inertia of the rotor of each joint's motor, at the joint, kg·m²."""
        return np.array(self.model.armature[self.columns])

    @property
    def damping(self) -> Vector:
        """(joints,) viscous friction of each joint, N·m·s/rad."""
        return np.array(self.model.damping[self.columns])

    @property
    def dry_friction(self) -> Vector:
        """(joints,) dry friction of each joint, N·m."""
        return np.array(self.model.upperDryFrictionLimit[self.columns])

    @property
    def n_thrust(self) -> int:
        """Number of thrust variables: three for each free thruster, one for each rotor."""
        return 3 * (len(self.thrusters) - len(self.rotors)) + len(self.rotors)

    @property
    def sizes(self) -> dict[str, int]:
        """Numbers of velocities, joints, contact points, thrusters and their variables, by the
        names in records.

        Soles are counted where all feet are flat.
        """
        soles = len(self.flat_feet) if len({*self.flat_feet}) == 1 else 0
        counts = {"nv": self.nv, "joints": len(self.joints), "feet": len(self.feet), "soles": soles}
        return counts | {"thrusters": len(self.thrusters), "thrusts": self.n_thrust}

    @property
    def lift_axis(self) -> Vector | None:
        """(3,) the one direction, in the body's axes, in which a robot without feet can push; None
        for other robots.

        It is the mean of its rotors' axes (with the joints as in :attr:`posture`), where these do
        not span the space: the robot has to lean to push elsewhere.
        """
        if self.feet or not self.rotors or len(self.rotors) < len(self.thrusters):
            return None
        q = self.neutral
        if self.posture is not None:
            q[7:] = self.posture
        data = self.model.createData()
        pin.framesForwardKinematics(self.model, data, self.closed(q))
        axes = [
            data.oMf[self.frame_id(rotor.frame)].rotation @ np.array(rotor.axis)
            for rotor in self.rotors
        ]
        mean = np.sum(axes, axis=0)
        length = np.linalg.norm(mean)
        spread = np.linalg.matrix_rank(np.array(axes), rtol=ANY_DIRECTION)
        return np.asarray(mean / length) if length > 1e-9 and spread < 3 else None

    @property
    def joint_lower(self) -> Vector:
        """(joints,) lower position limits, rad."""
        return self._ends(self.model.lowerPositionLimit)

    @property
    def joint_upper(self) -> Vector:
        """(joints,) upper position limits, rad."""
        return self._ends(self.model.upperPositionLimit)

    def _ends(self, limit: Vector) -> Vector:
        """What belongs to the configuration's joints of an array (model.nq,) of the model."""
        return np.array(limit[7:] if self.loops is None else limit[self.places])

    @checked
    def with_joints(
        self,
        found: KnownJoints | None = None,
        *,
        armature: ArrayLike | None = None,
        damping: ArrayLike | None = None,
        friction: ArrayLike | None = None,
    ) -> Robot:
        """The robot with what is known of its joints; each a number, or one for each joint. None:
        as in the model.

        Plants have these joints, and the whole-body controllers take them into account.

        Args:
            found: what :func:`harpy_pin.contrib.identify.identify` has found; where it is NaN, the
                model stays. What is given by name goes first.
            armature: inertia of the motors' rotors at the joints, kg·m².
            damping: viscous friction, N·m·s/rad.
            friction: dry friction, N·m.

        Raises:
            InputError: joints of another robot, another length, or numbers that are not finite or
                negative.
        """
        changed = {}
        if found is not None and tuple(found.names) != self.joints:
            message = f"these are joints of another robot: {shown(', '.join(found.names), 300)}"
            raise InputError(f"{message}; expected {', '.join(self.joints)}", name="found")
        for name, given in {"armature": armature, "damping": damping, "friction": friction}.items():
            array = "upperDryFrictionLimit" if name == "friction" else name
            before = getattr(self.model, array)
            if given is None and found is not None:
                known = getattr(found, name)
                given = np.where(np.isnan(known), before[self.columns], known)
            if given is not None:
                changed[array] = np.array(before)
                changed[array][self.columns] = checks.gains(name, given, len(self.joints))
        return self.with_arrays(changed)

    def with_mujoco(self, model: Any, *, prefix: str = "") -> Robot:
        """The robot with armature, damping and dry friction of a MuJoCo model's joints, see
        :meth:`with_joints`.

        The armature of the free joint is taken, too, and largest torques where they are smaller
        than here or there are none here. Joints are found by name; a prefix that ends in ``:`` or
        ``/`` does not count, unless it is given.

        Args:
            model: ``mujoco.MjModel`` of the robot.
            prefix: of the robot's joints in the model, where there are several robots, such as
                ``"a/"``.

        Raises:
            InputError: the model has no free joint, lacks a joint, or has two of its name.
        """
        joints = find_joints(model, [prefix + name for name in self.joints])
        model = in_effect(model)
        first = model.jnt_dofadr[free_joint(model, joints)]
        known: dict[str, Any] = known_joints(model, joints)
        robot, limit = self.with_joints(**known), np.array(self.model.effortLimit)
        armature, columns = np.array(robot.model.armature), self.columns
        armature[:6] = model.dof_armature[first : first + 6]
        limit[columns] = np.minimum(limit[columns], peak_torques(model, joints))
        return robot.with_arrays({"armature": armature, "effortLimit": limit})

    def with_arrays(self, arrays: Mapping[str, Vector]) -> Robot:
        """The robot with other arrays of its model, which :attr:`source` remembers.

        Args:
            arrays: (nv,) by Pinocchio's names.
        """
        model = self.model.copy()
        for name, values in arrays.items():
            setattr(model, name, values)
        model.lowerDryFrictionLimit = -model.upperDryFrictionLimit
        return replace(
            self,
            model=model,
            source={**self.source, "model": {**self.source.get("model", {}), **arrays}},
        )

    def frame_id(self, name: str) -> int:
        """Pinocchio's index of a frame.

        Args:
            name: of the frame in the URDF: a link, a joint, or a sole of the catalogue.

        Raises:
            InputError: there is no such frame; the message lists the frames there are.
        """
        if not isinstance(name, str) or not name.isprintable() or not self.model.existFrame(name):
            raise InputError.unknown("frame", name, (f.name for f in self.model.frames))
        return int(self.model.getFrameId(name))


def harpy_urdf() -> Path:
    """Path of Harpy's URDF: beside the package once installed, at the top of a checkout
    otherwise.
    """
    return own_urdf("harpy.urdf")


def load_harpy(urdf: str | Path | None = None) -> Robot:
    """Harpy, or a variant of it in another file with the same frame names.

    Args:
        urdf: a URDF with Harpy's feet and thruster frames; the packaged one by default.

    Raises:
        RobotError: the file is missing or malformed, or lacks a foot or a thruster.
    """
    return load_robot(
        harpy_urdf() if urdf is None else checks.path("urdf", urdf),
        feet=HARPY_FEET,
        thrusters=HARPY_THRUSTERS,
        thrust_limit=HARPY_THRUST_LIMIT,
    )


def load_robot(
    urdf: str | Path | Any,
    *,
    feet: Sequence[str] | None = None,
    flat_feet: Mapping[str, FlatFoot] | None = None,
    thrusters: Sequence[str] = (),
    thrust_limit: float = np.inf,
    rotors: Sequence[Rotor] | None = None,
    posture: ArrayLike | None = None,
    joints: str | Path | None = None,
    loops: Sequence[tuple[str, str, str]] = (),
) -> Robot:
    """Any floating-base robot, with point feet, flat ones or none, and with thrusters or rotors.

    Args:
        urdf: path of the URDF, or of an MJCF file, which MuJoCo compiles
            (:mod:`harpy_pin.model.mjcf`), and whose keyframe ``home`` is the standing posture; or a
            ``mujoco.MjModel``; or the name of a robot of
            :data:`~harpy_pin.model.catalogue.CATALOGUE`, such as ``"solo12"``, whose files are the
            extra ``robots``. Its feet, its standing posture and its rotors are known.
        feet: frame names of the feet, in an MJCF file bodies, sites or geoms; () for none.
        flat_feet: the feet of these frames are flat; the others are points. Their corners take the
            place of the frame in :attr:`Robot.feet`. A robot known by name has its own, unless
            ``feet`` or ``flat_feet`` are given. Of legs of five joints or more soles are found,
            unless they are given: in an MJCF file of the lowest boxes, capsules and spheres that
            collide, in a URDF of boxes (:func:`harpy_pin.model.flat_foot.find_sole`); {} for none.
        thrusters: frame names of the mounts of free thrusters, which push in any direction.
        thrust_limit: largest magnitude of one free thruster's force, N.
        rotors: thrusters with a fixed axis.
        posture: (joints,) angles in which it stands, rad; those of the file or the catalogue by
            default. Where there are none, gaits find one (:func:`harpy_pin.model.ik.find_posture`).
        joints: file of ``harpy identify`` with their armature, damping and dry friction, see
            :meth:`Robot.with_joints`.
        loops: (frame, frame, kind) of each closed loop of a URDF; the origins of the two frames are
            one ``"point"``, or as far apart as at zero angles, ``"length"``, as the ends of a rod.
            Joints of effort 0 on the way round follow the others. Loops of an MJCF file are those
            that it has.

    A joint whose effort is zero in the file has no known one: it is warned of, and has no limit.

    Raises:
        RobotError: a frame is absent, the robots of the catalogue are not installed, loops do not
            close where the robot stands, or as :func:`harpy_pin.model.urdf.build_model`.
        InputError: the name is unknown, a file comes without feet, a flat foot is no foot, or the
            thrust limit is not positive.
    """
    if not isinstance(thrust_limit, float) or thrust_limit != np.inf:
        thrust_limit = checks.number("thrust_limit", thrust_limit, low=0.0, strict=True)
    if isinstance(loops, str) or not isinstance(loops, Sequence):
        message = f"loops must be a tuple of (frame, frame, kind), got {shown(loops)}"
        raise InputError(message, name="loops", value=loops)
    listed = None if is_model(urdf) else catalogue_robot(urdf)
    known = listed or CatalogueRobot("", (), {})
    path = None if is_model(urdf) else known.path() if listed else checks.path("urdf", urdf)
    told: dict[str, Any] = {
        "feet": feet,
        "flat_feet": flat_feet,
        "rotors": rotors,
        "posture": posture,
        "loops": loops or None,
    }
    told["thrusters"] = checks.names("thrusters", thrusters) or None
    told["thrust_limit"] = thrust_limit if thrust_limit < np.inf else None
    if path is not None:
        told["file"] = str(known_name(urdf)) if listed else os.path.abspath(path)
    if feet is None:
        if not listed:
            message = "a robot read from a file needs feet: names of frames, or () for none"
            raise InputError(f"{message}; {_links(_read(urdf, path, ()).model)}", name="feet")
        flat_feet = known.flat_feet if flat_feet is None else flat_feet
    feet = checks.names("feet", known.feet if feet is None else feet)
    rotors = known.rotors if rotors is None else rotors
    if not isinstance(rotors, Sequence):
        raise InputError(
            f"rotors must be a tuple of rotors, got {shown(rotors)}", name="rotors", value=rotors
        )
    rotor_frames = (checks.instance("a rotor", rotor, Rotor).frame for rotor in rotors)
    mounts = (
        *checks.names("thrusters", thrusters),
        *checks.names("frames of rotors", tuple(rotor_frames)),
    )
    read = _read(urdf, path, (*feet, *mounts))
    model, angles, closing = read.model, read.posture, None
    if listed:
        known.add_frames(model)
        model.upperDryFrictionLimit = model.lowerDryFrictionLimit = np.zeros(model.nv)
        angles = known.posture(model)
    ties = (*read.ties, *read_loops(loops or known.loops, model))
    if ties:
        closing = find_loops(model, ties, read.undriven, start_angles(model, angles, read.start))
        angles = None if angles is None else np.delete(angles, np.array(closing.passive) - 2)
    for kind, names in (("foot", feet), ("thruster", mounts)):
        if len(set(names)) != len(names):
            raise InputError(f"a {kind} is named twice: {shown(', '.join(names), 300)}", name=kind)
        for name in names:
            if not model.existFrame(name):
                where = "the MuJoCo model" if path is None else shown(str(path), 300)
                raise RobotError(
                    f"{where} has no {kind} frame {shown(name)}; {_links(model)}", path=path
                )
    if flat_feet is None:
        moved, above = feet_moved(model, feet, closing), driven_supports(model, closing)
        legs = {name: above[model.frames[model.getFrameId(name)].parentJoint] for name in feet}
        long = [name for name in feet if sum(moved[j] == 1 for j in legs[name]) >= SOLE_JOINTS]
        flat_feet = {name: read.soles[name] for name in long if name in read.soles}
    points, corners = add_flat_feet(model, feet, flat_feet)
    if posture is not None:
        passive = 0 if closing is None else len(closing.passive)
        angles = checks.vector("posture", posture, model.nq - 7 - passive)
    limits = np.array(model.effortLimit)
    parts = list(zip(model.names, model.joints, model.inertias, strict=True))[1:]
    followers = () if closing is None else closing.passive
    unknown = [
        name
        for name, joint, _ in parts[1:]
        if limits[joint.idx_v] == 0.0 and joint.id not in followers
    ]
    no_loop = "as no closed loop (loops=, --loops) moves them"
    _warn(path, f"of effort 0, taken as motors without a limit, {no_loop}", unknown)
    if not listed:
        no_inertia = [name for name, _, body in parts if body.mass > 0.0 and not body.inertia.any()]
        _warn(path, "whose body has a mass, no inertia", no_inertia)
    limits[6:][limits[6:] == 0.0] = np.inf
    model.effortLimit = limits
    robot = Robot(
        model,
        path,
        points,
        mounts,
        float(thrust_limit),
        angles,
        flat_feet=corners if max(corners, default=1) > 1 else (),
        rotors=tuple(rotors),
        facing=known.facing,
        label=str(known_name(urdf)) if listed else "",
        source=deepcopy({name: value for name, value in told.items() if value is not None}),
        foot_radius=tuple(read.radii.get(name, 0.0) for name in points),
        loops=closing,
    )
    return robot if joints is None else robot.with_joints(read_joints(joints))


def _warn(path: Path | None, what: str, joints: Sequence[str]) -> None:
    """Warn of joints of a file, if there are any."""
    if line := named(f"{shown(str(path), 300)}: joints {what}:", joints, np.ones(len(joints))):
        warnings.warn(line, stacklevel=3)


def _read(urdf: Any, path: Path | None, frames: Sequence[str]) -> Description:
    """What a file, or a ``mujoco.MjModel``, says of a robot with these frames."""
    if path is None:
        try:
            return read_mujoco(urdf, frames, "the MuJoCo model")
        except InputError as error:
            raise InputError(f"the MuJoCo model: {error}", name="urdf") from error
    with robot_errors(path, "an MJCF file"):
        if read_xml(path).tag != "mujoco":
            model, ties = build_model(path)
            undriven = [j.id for j in list(model.joints)[2:] if model.effortLimit[j.idx_v] == 0.0]
            soles = find_soles(path, model, frames)
            return Description(model, soles=soles, ties=ties, undriven=undriven)
        return read_mujoco(compile_mjcf(path), frames, str(path))


def _links(model: pin.Model) -> str:
    """Names of a robot's links, for messages."""
    inner = {frame.parentFrame for frame in model.frames}
    bodies = [k for k, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
    names = [model.frames[k].name for k in sorted(bodies, key=lambda k: k in inner)]
    more = f" and {len(names) - 20} more" if len(names) > 20 else ""
    return f"its links, ends of limbs first: {', '.join(names[:20])}{more}"


def heavier(robot: Robot, error: float) -> Robot:
    """A robot with 1 + error times the mass and inertia of its body, the legs as they are; the
    error is above −1.
    """
    error = checks.number("mass error", error, low=-1.0, strict=True)
    model = robot.model.copy()
    body = model.inertias[1]
    model.inertias[1] = pin.Inertia(
        body.mass * (1.0 + error), body.lever, body.inertia * (1.0 + error)
    )
    return replace(robot, model=model)


def configuration(robot: Robot, q: ArrayLike) -> Vector:
    """A checked configuration: the right length, finite, the quaternion of a free flyer
    normalised.
    """
    result = checks.vector("q", q, robot.nq)
    if np.linalg.norm(result[3:7]) < 1e-6:
        raise InputError(
            "q has no orientation: its quaternion (entries 3 to 6) is zero", name="q", value=q
        )
    if robot.loops is not None:
        result[3:7] /= np.linalg.norm(result[3:7])
        return result
    return np.asarray(pin.normalize(robot.model, result))


@dataclass(frozen=True)
class KnownRobot:
    """What is known of a robot.

    Attributes:
        name: for :func:`load_robot` and :class:`harpy_pin.scenario.Scenario`.
        feet: names of its feet; none for robots that fly.
        flat: whether these are flat.
        rotors: how many it has.
        mass: kg; None where the extra ``robots`` is not installed.
        joints: how many are actuated; None where the extra is not installed.
        licence: of its files; None where they do not say, or are not installed.
    """

    name: str
    feet: tuple[str, ...]
    flat: bool
    rotors: int
    mass: float | None
    joints: int | None
    licence: str | None


def robots() -> dict[str, KnownRobot]:
    """All robots that are known by name, such as ``"go2"``; ``list(robots())`` are the names.

    Files of robots other than Harpy are in example-robot-data, the extra ``robots``.
    """
    harpy, installed = load_harpy(), installed_data() is not None
    known = {
        "harpy": KnownRobot(
            "harpy", HARPY_FEET, False, 0, harpy.mass, len(harpy.joints), "BSD-2-Clause"
        )
    }
    for name, entry in CATALOGUE.items():
        robot = load_robot(name) if installed or entry.own else None
        found = (
            (None, None, None)
            if robot is None
            else (robot.mass, len(robot.joints), _licence(entry))
        )
        known[name] = KnownRobot(name, entry.feet, bool(entry.flat_feet), len(entry.rotors), *found)
    return known


def _licence(entry: CatalogueRobot) -> str | None:
    """What the page beside a robot's files says; this library's for its own."""
    if entry.own:
        return "BSD-2-Clause"
    page = entry.path().parents[1] / "README.md"
    text = page.read_text(errors="replace") if page.is_file() else ""
    found = re.search(r"^licen[cs]e: *(.+?) *$", text, re.MULTILINE | re.IGNORECASE)
    return found and found.group(1)
