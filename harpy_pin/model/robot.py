"""The robot: a Pinocchio model with named feet, thruster mounts, rotors and limits.

:mod:`harpy_pin.model.loading` makes it of a file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.errors import InputError, shown
from harpy_pin.model.loops import Loops, driven_supports
from harpy_pin.model.rotor import Rotor
from harpy_pin.model.state import Vector

SOLE_JOINTS = 5
"""Least number of joints of a leg whose foot is found to be flat: fewer cannot keep it level."""
ANY_DIRECTION = 0.1
"""Rotors push in any direction where the least singular value of their axes is above this share of
the largest.
"""


@dataclass(frozen=True, eq=False, repr=False)
class KnownJoints:
    """Armature, damping and dry friction of joints; NaN where they are not known.

    Attributes:
        names: of the joints.
        armature: (joints,) inertia of the motors' rotors at the joints, kg·m².
        damping: (joints,) viscous friction, N·m·s/rad.
        friction: (joints,) dry friction, N·m. Arrays are read only.
    """

    names: tuple[str, ...]
    armature: Vector
    damping: Vector
    friction: Vector

    def __post_init__(self) -> None:
        for array in vars(self).values():
            if isinstance(array, np.ndarray):
                array.flags.writeable = False


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
    def on_soles(self) -> bool:
        """Whether a foot is wider than a line."""
        return max(self.corners, default=1) > 2

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
        soles = len(self.flat_feet) if len({*self.flat_feet}) == 1 and self.on_soles else 0
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
        from harpy_pin.model import mjcf, mjcf_options  # which most robots do without

        joints = mjcf.find_joints(model, [prefix + name for name in self.joints])
        model = mjcf_options.in_effect(model)
        first = model.jnt_dofadr[mjcf.free_joint(model, joints)]
        known: dict[str, Any] = mjcf.known_joints(model, joints)
        robot, limit = self.with_joints(**known), np.array(self.model.effortLimit)
        armature, columns = np.array(robot.model.armature), self.columns
        armature[:6] = model.dof_armature[first : first + 6]
        limit[columns] = np.minimum(limit[columns], mjcf.peak_torques(model, joints))
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


def feet_moved(model: pin.Model, feet: Sequence[str], loops: Loops | None = None) -> list[int]:
    """How many feet each of the model's joints moves, by Pinocchio's numbers; points on one link
    are one foot.

    A joint that moves one foot is of a leg; one that moves several, such as a waist, of none.

    Args:
        model: any.
        feet: names of frames.
        loops: that close it; their passive joints move none by themselves.
    """
    ends = {model.frames[model.getFrameId(name)].parentJoint for name in feet}
    supports = driven_supports(model, loops)
    above = [j for end in ends for j in supports[end]]
    return [above.count(j) for j in range(model.njoints)]
