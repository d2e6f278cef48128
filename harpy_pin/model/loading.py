"""Robots are loaded: from a URDF, from MuJoCo's format, or by name."""

from __future__ import annotations

import json
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError, RobotError, first_of, reason, shown
from harpy_pin.model.catalogue import (
    CATALOGUE,
    HARPY_FEET,
    HARPY_THRUST_LIMIT,
    HARPY_THRUSTERS,
    CatalogueRobot,
    catalogue_robot,
    installed_data,
    known_name,
    own_urdf,
)
from harpy_pin.model.flat_foot import FlatFoot, add_flat_feet
from harpy_pin.model.loops import Loops, driven_supports, find_loops, read_loops, start_angles
from harpy_pin.model.robot import SOLE_JOINTS, KnownJoints, Robot, feet_moved
from harpy_pin.model.rotor import Rotor
from harpy_pin.model.urdf import Description, read_urdf, read_xml, robot_errors


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
            default. Where there are none, gaits find one
            (:func:`harpy_pin.model.posture.find_posture`).
        joints: file of ``harpy identify`` with their armature, damping and dry friction, see
            :meth:`Robot.with_joints`.
        loops: (frame, frame, kind) of each closed loop of a URDF; the origins of the two frames are
            one ``"point"``, or as far apart as at zero angles, ``"length"``, as the ends of a rod.
            Joints of effort 0 on the way round follow the others. Loops of an MJCF file are those
            that it has.

    A joint whose effort is zero in the file has no known one: it is warned of, and has no limit.

    Raises:
        RobotError: a frame is absent, the robots of the catalogue are not installed, loops do not
            close where the robot stands, or as :func:`harpy_pin.model.urdf.read_urdf`.
        InputError: the name is unknown, a file comes without feet, a flat foot is no foot, or the
            thrust limit is not positive.
    """
    if not isinstance(thrust_limit, float) or thrust_limit != np.inf:
        thrust_limit = checks.number("thrust_limit", thrust_limit, low=0.0, strict=True)
    if isinstance(loops, str) or not isinstance(loops, Sequence):
        message = f"loops must be a tuple of (frame, frame, kind), got {shown(loops)}"
        raise InputError(message, name="loops", value=loops)
    thrusters = checks.names("thrusters", thrusters)
    compiled = hasattr(urdf, "jnt_type")  # a ``mujoco.MjModel``
    listed = None if compiled else catalogue_robot(urdf)
    known = listed or CatalogueRobot("", (), {})
    path = None if compiled else known.path() if listed else checks.path("urdf", urdf)
    where = "the MuJoCo model" if path is None else shown(str(path), 300)
    label = str(known_name(urdf)) if listed else ""
    told: dict[str, Any] = {
        "feet": feet,
        "flat_feet": flat_feet,
        "rotors": rotors,
        "posture": posture,
        "loops": loops or None,
        "thrusters": thrusters or None,
        "thrust_limit": thrust_limit if thrust_limit < np.inf else None,
        "file": None if path is None else label or os.path.abspath(path),
    }
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
    axes = [checks.instance("a rotor", rotor, Rotor).frame for rotor in rotors]
    mounts = (*thrusters, *checks.names("frames of rotors", axes))
    read = _read(urdf, path, (*feet, *mounts))
    if path is not None and not listed:
        told["sha256"] = sha256(path.read_bytes()).hexdigest()
    model, angles, closing = read.model, read.posture, None
    if listed:
        known.add_frames(model)
        model.upperDryFrictionLimit = model.lowerDryFrictionLimit = np.zeros(model.nv)
        angles = known.posture(model)
    ties = (*read.ties, *read_loops(loops or known.loops, model))
    if ties:
        closing = find_loops(model, ties, read.undriven, start_angles(model, angles, read.start))
        angles = None if angles is None else np.delete(angles, np.array(closing.passive) - 2)
    _refuse_absent("foot", feet, model, where, path)
    _refuse_absent("thruster", mounts, model, where, path)
    flat_feet = _soles(read, feet, closing) if flat_feet is None else flat_feet
    points, corners = add_flat_feet(model, feet, flat_feet)
    passive = () if closing is None else closing.passive
    if posture is not None:
        angles = checks.vector("posture", posture, model.nq - 7 - len(passive))
    for what, names in _doubtful_joints(model, passive, listed=listed is not None).items():
        if names:
            warnings.warn(f"{where}: joints {what}: {first_of(names)}", stacklevel=2)
    limits = np.array(model.effortLimit)
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
        label=label,
        source=deepcopy({name: value for name, value in told.items() if value is not None}),
        foot_radius=tuple(read.radii.get(name, 0.0) for name in points),
        loops=closing,
    )
    return robot if joints is None else robot.with_joints(_read_joints(joints))


def _read(urdf: Any, path: Path | None, frames: Sequence[str]) -> Description:
    """What a file, or a ``mujoco.MjModel``, says of a robot with these frames."""
    if path is not None:
        with robot_errors(path, "an MJCF file"):
            root = read_xml(path)
        if root.tag != "mujoco":
            return read_urdf(path, root, frames)
    from harpy_pin.model.mjcf import compile_mjcf, read_mujoco  # which URDFs do without

    if path is not None:
        with robot_errors(path, "an MJCF file"):
            return read_mujoco(compile_mjcf(path), frames, str(path))
    try:
        return read_mujoco(urdf, frames, "the MuJoCo model")
    except InputError as error:
        raise InputError(f"the MuJoCo model: {error}", name="urdf") from error


def _refuse_absent(
    kind: str, names: Sequence[str], model: pin.Model, where: str, path: Path | None
) -> None:
    """Refuse frames that a model has not, or that are named twice."""
    if len(set(names)) != len(names):
        raise InputError(f"a {kind} is named twice: {shown(', '.join(names), 300)}", name=kind)
    for name in names:
        if not model.existFrame(name):
            message = f"{where} has no {kind} frame {shown(name)}; {_links(model)}"
            raise RobotError(message, path=path)


def _soles(read: Description, feet: Sequence[str], closing: Loops | None) -> dict[str, FlatFoot]:
    """The soles that were found of legs that can keep them level."""
    model = read.model
    moved, above = feet_moved(model, feet, closing), driven_supports(model, closing)
    legs = {name: above[model.frames[model.getFrameId(name)].parentJoint] for name in feet}
    long = [name for name in feet if sum(moved[j] == 1 for j in legs[name]) >= SOLE_JOINTS]
    return {name: read.soles[name] for name in long if name in read.soles}


def _doubtful_joints(
    model: pin.Model, passive: Sequence[int], *, listed: bool
) -> dict[str, list[str]]:
    """Joints of which a file says what may be meant otherwise, by what it is."""
    parts = list(zip(model.names, model.joints, model.inertias, strict=True))[1:]
    no_loop = "as no closed loop (loops=, --loops) moves them"
    return {
        f"of effort 0, taken as motors without a limit, {no_loop}": [
            shown(name)
            for name, joint, _ in parts[1:]
            if model.effortLimit[joint.idx_v] == 0.0 and joint.id not in passive
        ],
        "whose body has a mass, no inertia": [
            shown(name)
            for name, _, body in parts
            if body.mass > 0.0 and not body.inertia.any() and not listed
        ],
    }


def _read_joints(path: str | Path) -> KnownJoints:
    """The joints in a file of ``harpy identify``: ``{"joints": {NAME: {"armature": 0.01, ...}}}``,
    null where a number is not known.
    """
    path = checks.path("joints", path)
    try:
        found = json.loads(path.read_text(encoding="utf-8"))["joints"]
        columns = {
            name: np.array([joint[name] for joint in found.values()], dtype=np.float64)
            for name in ("armature", "damping", "friction")
        }
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise RobotError(
            f"no joints in {shown(str(path), 300)}: {reason(error)}", path=path
        ) from error
    return KnownJoints(tuple(found), **columns)


def _links(model: pin.Model) -> str:
    """Names of a robot's links, for messages."""
    inner = {frame.parentFrame for frame in model.frames}
    bodies = [k for k, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
    names = [model.frames[k].name for k in sorted(bodies, key=lambda k: k in inner)]
    return f"its links, ends of limbs first: {first_of(names, 20)}"


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
