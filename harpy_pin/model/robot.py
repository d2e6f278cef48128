"""The robot: a Pinocchio model with named feet, thruster mounts and limits."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError, RobotError
from harpy_pin.model.state import Vector

__all__ = [
    "HARPY_FEET",
    "HARPY_THRUSTERS",
    "HARPY_THRUST_LIMIT",
    "Robot",
    "configuration",
    "harpy_urdf",
    "heavier",
    "load_harpy",
    "load_robot",
]

HARPY_FEET = ("left_foot", "right_foot")
HARPY_THRUSTERS = ("left_thruster", "right_thruster")
HARPY_THRUST_LIMIT = 53.0
"""Hardware limit of one thruster, N (equations.md §3)."""


@dataclass(frozen=True, eq=False)
class Robot:
    """A floating-base robot with point feet and, where it has any, thrusters fixed to its links.

    Attributes:
        model: Pinocchio model, root joint a free flyer, armature set.
        urdf: the file it was read from.
        feet: frame names of the point feet.
        thrusters: frame names of the thruster mounts.
        thrust_limit: largest magnitude of one thruster's force, N.
    """

    model: pin.Model
    urdf: Path
    feet: tuple[str, ...]
    thrusters: tuple[str, ...]
    thrust_limit: float

    @property
    def name(self) -> str:
        """Name of the robot in its URDF."""
        return str(self.model.name)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the actuated joints, in the order of the torques."""
        return tuple(self.model.names)[2:]

    @property
    def mass(self) -> float:
        """Total mass, kg."""
        return float(sum(inertia.mass for inertia in self.model.inertias))

    @property
    def torque_limit(self) -> Vector:
        """(joints,) peak torque of each joint, N·m."""
        return np.array(self.model.effortLimit[self.model.joints[1].nv :])

    @property
    def joint_lower(self) -> Vector:
        """(joints,) lower position limits, rad."""
        return np.array(self.model.lowerPositionLimit[self.model.joints[1].nq :])

    @property
    def joint_upper(self) -> Vector:
        """(joints,) upper position limits, rad."""
        return np.array(self.model.upperPositionLimit[self.model.joints[1].nq :])

    def frame_id(self, name: str) -> int:
        """Pinocchio's index of a frame.

        Raises:
            InputError: there is no such frame; the message lists the frames there are.
        """
        if not self.model.existFrame(name):
            raise InputError.unknown("frame", name, (f.name for f in self.model.frames))
        return int(self.model.getFrameId(name))


def harpy_urdf() -> Path:
    """Path of Harpy's URDF: beside the package once installed, at the top of a checkout otherwise."""
    package = Path(__file__).parent.parent
    for candidate in (package / "urdf" / "harpy.urdf", package.parent / "urdf" / "harpy.urdf"):
        if candidate.is_file():
            return candidate
    raise RobotError("harpy.urdf is missing from this installation of harpy_pin")


def load_harpy(urdf: str | Path | None = None) -> Robot:
    """Harpy, or a variant of it in another file with the same frame names.

    Args:
        urdf: a URDF with Harpy's feet and thruster frames; the packaged one by default.

    Raises:
        RobotError: the file is missing or malformed, or lacks a foot or a thruster.
    """
    return load_robot(
        harpy_urdf() if urdf is None else urdf,
        feet=HARPY_FEET,
        thrusters=HARPY_THRUSTERS,
        thrust_limit=HARPY_THRUST_LIMIT,
    )


def load_robot(
    urdf: str | Path, *, feet: Sequence[str], thrusters: Sequence[str] = (), thrust_limit: float = np.inf
) -> Robot:
    """Any floating-base robot with point feet.

    Args:
        urdf: path of the URDF.
        feet: frame names of the point feet.
        thrusters: frame names of the thruster mounts.
        thrust_limit: largest magnitude of one thruster's force, N.

    Raises:
        RobotError: the file is missing or malformed, a joint is not a one-parameter joint, a frame is absent, or
            the robot has no mass.
        InputError: the thrust limit is not positive.
    """
    path = Path(urdf)
    if not path.is_file():
        raise RobotError(f"no URDF at '{path}'", path=path)
    if thrust_limit != np.inf:
        thrust_limit = checks.number("thrust_limit", thrust_limit, low=0.0, strict=True)
    for kind, names in (("foot", feet), ("thruster", thrusters)):
        if len(set(names)) != len(names):
            raise InputError(f"a {kind} is named twice: {', '.join(names)}", name=kind)
    armatures = _check_numbers(_parse(path), path)
    try:
        model = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    except (RuntimeError, ValueError) as error:
        raise RobotError(f"'{path}' is not a URDF that Pinocchio can read: {error}", path=path) from error
    if model.nq != model.nv + 1:
        raise RobotError(f"'{path}': only joints with one coordinate each are supported", path=path)
    frames = [f.name for f in model.frames if f.type == pin.FrameType.BODY]
    for kind, names in (("foot", feet), ("thruster", thrusters)):
        for name in names:
            if not model.existFrame(name):
                links = ", ".join(frames)
                raise RobotError(f"'{path}' has no {kind} frame '{name}'; its links: {links}", path=path)
    for name, armature in armatures.items():
        if model.existJointName(name):
            model.armature[model.joints[model.getJointId(name)].idx_v] = armature
    robot = Robot(model, path, tuple(feet), tuple(thrusters), float(thrust_limit))
    if robot.mass <= 0.0:
        raise RobotError(f"'{path}': total mass is {robot.mass} kg", path=path)
    return robot


def heavier(robot: Robot, error: float) -> Robot:
    """A robot with 1 + error times the mass and inertia of its body, the legs as they are.

    Args:
        robot: stays as it is.
        error: relative, above −1.

    Raises:
        InputError: the error is out of that range.
    """
    error = checks.number("mass error", error, low=-1.0, strict=True)
    model = robot.model.copy()
    body = model.inertias[1]
    model.inertias[1] = pin.Inertia(body.mass * (1.0 + error), body.lever, body.inertia * (1.0 + error))
    return replace(robot, model=model)


def configuration(model: pin.Model, q: ArrayLike) -> Vector:
    """A checked configuration: the right length, finite, the quaternion of a free flyer normalised.

    Raises:
        InputError: it is none.
    """
    result = checks.vector("q", q, model.nq)
    if model.joints[1].nq == 7 and np.linalg.norm(result[3:7]) < 1e-6:
        raise InputError("q has no orientation: its quaternion (entries 3 to 6) is zero", name="q", value=q)
    return np.asarray(pin.normalize(model, result))


def _check_numbers(tree: ElementTree.Element, path: Path) -> dict[str, float]:
    """Refuse numbers that the URDF reader would drop with a word on the terminal; return the joints' armatures."""
    try:
        for link in tree.iter("link"):
            kind = f"link '{link.get('name')}'"
            for mass in link.iter("mass"):
                checks.number(f"mass of {kind}", mass.get("value"), low=0.0)
            for inertia in link.iter("inertia"):
                for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
                    checks.number(f"{name} of {kind}", inertia.get(name))
        for origin in tree.iter("origin"):
            for name in ("xyz", "rpy"):
                checks.vector(f"origin {name}", origin.get(name, "0 0 0").split(), 3)
        armatures = {}
        for joint in tree.findall("joint"):
            name = joint.get("name", "")
            for axis in joint.iter("axis"):
                if not np.any(checks.vector(f"axis of joint '{name}'", axis.get("xyz", "1 0 0").split(), 3)):
                    raise InputError(f"axis of joint '{name}' is zero", name="axis")
            if joint.find("mimic") is not None:
                raise InputError(f"joint '{name}' mimics another: only joints that move on their own are supported")
            for limit in joint.iter("limit"):
                low = checks.number(f"lower limit of joint '{name}'", limit.get("lower", "0"))
                checks.number(f"upper limit of joint '{name}'", limit.get("upper", "0"), low=low)
            for dynamics in joint.iter("dynamics"):
                checks.number(f"damping of joint '{name}'", dynamics.get("damping", "0"), low=0.0)
                value = checks.number(f"armature of joint '{name}'", dynamics.get("armature", "0"), low=0.0)
                armatures[name] = value
        return armatures
    except InputError as error:
        raise RobotError(f"'{path}': {error}", path=path) from error


def _parse(path: Path) -> ElementTree.Element:
    """Root of the XML; checked here because Pinocchio reports a malformed file on the terminal only."""
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError, ValueError, LookupError) as error:
        raise RobotError(f"'{path}' is not well-formed XML: {error}", path=path) from error
    if root.tag != "robot" or root.find("link") is None:
        raise RobotError(f"'{path}' is not a URDF: it has no <robot> with links", path=path)
    return root
