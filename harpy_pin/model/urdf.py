"""Reads a URDF of unknown origin: what Pinocchio's reader would drop, crash on or misread is
refused.

The checks are our own because yourdfpy, which was tried in their place, accepts NaN, negative
masses, cycles and entities, answers most of what it refuses with errors of Python's, and brings
lxml and trimesh along.
"""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.errors import InputError, RobotError, first_of, shown
from harpy_pin.model.flat_foot import FlatFoot, find_sole
from harpy_pin.model.loops import Coupling, Tie
from harpy_pin.model.state import Vector

_MAX_BYTES = 4_000_000
_MAX_LINKS = 500
"""Pinocchio's reader calls itself once per link of a chain; its stack ends somewhere above 3000."""
_MAX_NAME = 200
_MAX_DEPTH = 50  # most levels of elements inside elements; readers call themselves once for each
_LARGEST = 1e6
"""Largest masses, lengths and inertias, SI; larger ones overflow in the equations of motion."""
UNLIMITED = 1e300
"""Torques and speeds from here on have no limit."""
TURNS, DEGREES = 4.0 * np.pi, 720.0
"""Angles between these, rad, which are taken for degrees."""
_ROUNDING = 1e-12  # what files made by programs have below zero, kg·m²

_JOINTS = ("revolute", "continuous", "prismatic", "fixed")
_FIXED = ("parent", "child", "origin")  # elements that mean something in a fixed joint
_MOVING = (*_FIXED, "axis", "limit", "dynamics")  # in one that moves
# Numbers of an element: how many in each attribute, the attributes it must have, those it may have.
_NUMBERS: dict[str, tuple[int, tuple[str, ...], tuple[str, ...]]] = {
    "mass": (1, ("value",), ()),
    "inertia": (1, ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), ()),
    "origin": (3, (), ("xyz", "rpy")),
    "axis": (3, (), ("xyz",)),
    "limit": (1, ("effort", "velocity"), ("lower", "upper")),
    "dynamics": (1, (), ("damping", "friction", "armature")),
    "mimic": (1, (), ("multiplier", "offset")),
    "box": (3, ("size",), ()),
    "cylinder": (1, ("radius", "length"), ()),
    "sphere": (1, ("radius",), ()),
    "mesh": (3, (), ("scale",)),
    "color": (4, ("rgba",), ()),
}
_SIGNED = ("ixy", "ixz", "iyz", "xyz", "rpy", "lower", "upper", "scale", "multiplier", "offset")


@dataclass(frozen=True)
class Description:
    """What a file says of a robot.

    Attributes:
        model: Pinocchio's.
        posture: (joints,) angles in which it stands, rad; None where there are none.
        soles: of frames that are flat feet.
        radii: of the spheres around the points of other frames, m.
        ties: closed loops and couplings.
        undriven: Pinocchio's numbers of the joints without a motor.
        start: (all joints,) angles from which closed loops are searched; None for zero.
    """

    model: pin.Model
    posture: Vector | None = None
    soles: Mapping[str, FlatFoot] = field(default_factory=dict)
    radii: Mapping[str, float] = field(default_factory=dict)
    ties: Sequence[Tie] = ()
    undriven: Sequence[int] = ()
    start: Vector | None = None


def read_urdf(path: Path, root: ElementTree.Element, frames: Sequence[str]) -> Description:
    """The robot of a URDF: Pinocchio's model, root joint a free flyer, armature set; its joints
    that mimic others; the soles of these frames.

    Every joint has one number in q. It is Pinocchio's model of the file, but for this:

    - A ``continuous`` joint is a revolute one with infinite position limits, where Pinocchio keeps
      cosine and sine. If it has no ``<limit>``, its torque and speed are unlimited too.
    - The base is the first link with a mass or a joint: of massless links that are fixed above it
      (``base_footprint``) frames are left.
    - Of a link and a joint of one name the link's frame has it, and the joint's has ``joint:``
      before it.
    - A fixed joint has a place only: axis, limits and dynamics in it are ignored.

    ``floating`` and ``planar`` joints are refused, and so are bodies whose inertia no body can
    have.

    Args:
        path: of the file, for messages.
        root: of its XML, see :func:`read_xml`; it is changed.
        frames: names of feet; those that the model has not are left out.

    Raises:
        RobotError: the file is malformed, or describes what no body can be; always one line.
    """
    with robot_errors(path, "a URDF"):
        if root.tag != "robot" or root.find("link") is None:
            raise RobotError(
                f"{_shown(path)} is not a URDF: it has no <robot> with links", path=path
            )
        links, joints = root.findall("link"), root.findall("joint")
        _check_names([root], "robot")
        _check_names(links, "link")
        _check_names(joints, "joint")
        _check_tree(links, joints)
        for joint in joints:
            _keep(joint, _FIXED if joint.get("type") == "fixed" else (*_MOVING, "mimic"))
            _make_limited(joint)
        materials = root.findall("material")
        _check_names([material for material in materials if material.get("name")], "material")
        for element in (*links, *joints, *materials):
            _check_numbers(element)
        for joint in joints:
            _check_joint(joint)
        couplings = _couplings(path, joints)
        _warn_of_ranges(path, joints)
        colliding = {str(link.get("name")): link.findall("collision") for link in links}
        _keep(root, ("link", "joint"))
        for link in links:  # Pinocchio's reader reports shapes that it does not know on stderr
            _keep(link, ("inertial",))
        model = _build(root, links, joints)
        undriven = [j.id for j in list(model.joints)[2:] if model.effortLimit[j.idx_v] == 0.0]
        soles = _find_soles(model, colliding, frames)
        return Description(model, soles=soles, ties=couplings, undriven=undriven)


def _build(
    root: ElementTree.Element,
    links: Sequence[ElementTree.Element],
    joints: Sequence[ElementTree.Element],
) -> pin.Model:
    """Pinocchio's model of the XML of a URDF that was checked, and only of that: two readers need
    not agree on the bytes of a file.
    """
    unbounded = [joint.get("name") for joint in joints if joint.get("type") == "continuous"]
    for joint in joints:
        joint.set("type", str(joint.get("type")).replace("continuous", "revolute"))
    text = ElementTree.tostring(root, encoding="unicode")
    model = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
    for joint in joints:
        if (dynamics := joint.find("dynamics")) is not None:
            index = model.joints[model.getJointId(joint.get("name"))].idx_v
            model.armature[index] = float(dynamics.get("armature", "0"))
    for name in unbounded:
        place = model.joints[model.getJointId(name)].idx_q
        model.lowerPositionLimit[place] = -np.inf
        model.upperPositionLimit[place] = np.inf
    for limits in (model.effortLimit[6:], model.velocityLimit[6:]):
        limits[limits >= UNLIMITED] = np.inf
    _move_base(model, links, joints)
    _name_frames(model)
    check_bodies(model)
    return model


def _find_soles(
    model: pin.Model, colliding: Mapping[str, Sequence[ElementTree.Element]], frames: Sequence[str]
) -> dict[str, FlatFoot]:
    """The soles of frames, of the shapes that collide on links that move with them: boxes,
    spheres, capsules and cylinders that lie. The joints are at zero.
    """
    shapes = []
    for link, collisions in colliding.items():
        frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
        for shape in collisions:
            geometry, origin = shape.find("geometry/*"), shape.find("origin")
            if geometry is not None and geometry.tag in ("box", "sphere", "capsule", "cylinder"):
                place = {} if origin is None else origin.attrib
                x, turn = (
                    np.array(place.get(name, "0 0 0").split(), dtype=float)
                    for name in ("xyz", "rpy")
                )
                size = geometry.get("size", f"0 0 {geometry.get('length', '0')}").split()
                half, radius = 0.5 * np.array(size, dtype=float), float(geometry.get("radius", "0"))
                at = frame.placement * pin.SE3(pin.rpy.rpyToMatrix(turn), x)
                shapes.append((frame.parentJoint, at, half, radius))
    data, soles = model.createData(), {}
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    for name in filter(model.existFrame, frames):
        number = model.getFrameId(name)
        foot = model.frames[number]
        own = [
            (foot.placement.actInv(at), *size)
            for joint, at, *size in shapes
            if joint == foot.parentJoint
        ]
        sole = find_sole(own, data.oMf[number].rotation)
        if sole is not None:
            soles[name] = sole
    return soles


@contextmanager
def robot_errors(path: Path, kind: str, reader: str = "Pinocchio") -> Iterator[None]:
    """A block in which a file of this kind is read: its errors become :class:`RobotError`."""
    try:
        yield
    except InputError as error:
        raise RobotError(f"{_shown(path)}: {error}", path=path) from error
    except OSError as error:
        raise RobotError(
            f"cannot read {_shown(path)}: {error.strerror or error}", path=path
        ) from error
    except (RuntimeError, ValueError, IndexError) as error:
        reason = " ".join(str(error).split())
        raise RobotError(
            f"{_shown(path)} is not {kind} that {reader} can read: {reason}", path=path
        ) from error


def _shown(path: Path) -> str:
    """A path as messages show it; one that a file names may be long, or hold a line feed."""
    return shown(str(path), 300)


def read_xml(path: Path) -> ElementTree.Element:
    """Root of the XML of a robot's file; errors are :class:`RobotError`, ``InputError`` and
    ``OSError``.
    """
    if not path.is_file():
        found = "it is no file" if path.exists() else "the file does not exist"
        raise RobotError(f"no URDF at {_shown(path)}: {found}", path=path)
    with path.open("rb") as file:
        data = file.read(_MAX_BYTES + 1)
    if len(data) > _MAX_BYTES:
        raise InputError(f"too large for a URDF: more than {_MAX_BYTES // 1_000_000} MB")
    if b"<!ENTITY" in data:
        raise InputError("it declares entities, which a URDF does not need")
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise RobotError(f"{_shown(path)} is not well-formed XML: {error}", path=path) from error
    if any("/xacro}" in element.tag for element in root.iter() if isinstance(element.tag, str)):
        root = _expand_xacro(path)
    level = [root]
    for _ in range(_MAX_DEPTH):
        level = [inner for element in level for inner in element]
    if level:
        raise InputError("its elements are nested too deeply")
    return root


def _expand_xacro(path: Path) -> ElementTree.Element:
    """The root of the URDF that a xacro file makes."""
    try:
        from xacrodoc import XacroDoc
    except ImportError as error:
        message = (
            "it is a xacro file: pip install xacrodoc, or make a URDF of it by xacro "
            "robot.xacro > robot.urdf"
        )
        raise InputError(message) from error
    try:
        with chdir(path.parent):  # from which it reads what the file includes
            text = XacroDoc.from_file(path.name, resolve_packages=False).to_urdf_string()
    except Exception as error:  # a file with expressions of Python's, whose errors are of all kinds
        raise InputError(f"xacro cannot expand it: {' '.join(str(error).split())}") from error
    return ElementTree.fromstring(text)


def _check_names(elements: Sequence[ElementTree.Element], kind: str) -> None:
    """Every element has a name of its own that can be shown."""
    seen: set[str] = set()
    for element in elements:
        name = element.get("name", "")
        if not name or not name.isprintable() or len(name) > _MAX_NAME:
            shown = ascii(name[:40])
            raise InputError(
                f"name of a {kind} must be 1 to {_MAX_NAME} printable characters, got {shown}"
            )
        if name in seen:
            raise InputError(f"two {kind}s are named '{name}'")
        seen.add(name)


def _check_tree(
    links: Sequence[ElementTree.Element], joints: Sequence[ElementTree.Element]
) -> None:
    """The joints make one tree of the links, not too large."""
    if len(links) > _MAX_LINKS:
        raise InputError(f"it has {len(links)} links; at most {_MAX_LINKS} are supported")
    names = [link.get("name") for link in links]
    parent_of: dict[str | None, str | None] = {}
    for joint in joints:
        parent, child = (
            None if end is None else end.get("link") for end in map(joint.find, ("parent", "child"))
        )
        for kind, end in (("parent", parent), ("child", child)):
            if end not in names:
                raise InputError(
                    f"the {kind} of joint '{joint.get('name')}' is no link of the file"
                )
        if child in parent_of:
            raise InputError(f"link '{child}' is the child of two joints")
        parent_of[child] = parent
    for link in names:
        at: str | None = link
        for _ in names:
            at = parent_of.get(at, at)
        if at in parent_of:
            raise InputError(f"the joints above link '{link}' go round in a circle")
    roots = [f"'{name}'" for name in names if name not in parent_of]
    if len(roots) > 1:
        raise InputError(
            f"its links are not one tree: {roots[0]} and {roots[1]} are both without a parent"
        )


def _keep(element: ElementTree.Element, tags: Sequence[str]) -> None:
    """Remove what :func:`read_urdf` ignores, so that nothing in it can be wrong."""
    for inner in list(element):
        if inner.tag not in tags:
            element.remove(inner)


def _make_limited(joint: ElementTree.Element) -> None:
    """Give a continuous joint without limits one, and numbers to limits of torque and speed that
    are infinite.
    """
    if joint.get("type") == "continuous" and joint.find("limit") is None:
        ElementTree.SubElement(joint, "limit", effort="inf", velocity="inf")
    for limit in joint.iter("limit"):
        for name in ("effort", "velocity"):
            if number_in(limit.get(name, "")) == np.inf:
                limit.set(name, str(UNLIMITED))


def _move_base(
    model: pin.Model, links: Sequence[ElementTree.Element], joints: Sequence[ElementTree.Element]
) -> None:
    """Give the floating base the frame of the first link with a mass or a moving child (not
    ``base_footprint``).
    """
    massive = {link.get("name") for link in links if link.find("inertial") is not None}
    base = model.frames[2].name
    while base not in massive:
        below = [
            joint
            for joint in joints
            if joint.find("parent").get("link") == base  # type: ignore[union-attr]
        ]
        if [joint.get("type") for joint in below] != ["fixed"]:
            break
        base = str(below[0].find("child").get("link"))  # type: ignore[union-attr]
    place = model.frames[model.getFrameId(base, pin.FrameType.BODY)].placement.inverse()
    if not place.isIdentity(0.0):
        model.inertias[1] = place.act(model.inertias[1])
        for k in [k for k in range(2, model.njoints) if model.parents[k] == 1]:
            model.jointPlacements[k] = place * model.jointPlacements[k]
        for frame in [frame for frame in list(model.frames)[2:] if frame.parentJoint == 1]:
            frame.placement = place * frame.placement


def _name_frames(model: pin.Model) -> None:
    """Of a link and a joint of one name the link's frame keeps it."""
    links = {frame.name for frame in model.frames if frame.type == pin.FrameType.BODY}
    for frame in model.frames:
        if frame.type != pin.FrameType.BODY and frame.name in links:
            frame.name = f"joint:{frame.name}"


def _warn_of_ranges(path: Path, joints: Sequence[ElementTree.Element]) -> None:
    """Say which angles are further from zero than a joint goes, which they may be in degrees or by
    a turn.
    """
    far = []
    for joint in joints:
        limit = joint.find("limit")
        if joint.get("type") == "revolute" and limit is not None:
            low, high = (float(limit.get(name, "0")) for name in ("lower", "upper"))
            if low > np.pi or high < -np.pi or TURNS < max(-low, high) <= DEGREES:
                far.append(f"'{joint.get('name')}' ({low:g} to {high:g} rad)")
    if far:
        message = f"{_shown(path)}: range of joint {first_of(far)} is far from zero"
        warnings.warn(f"{message}: is it in degrees, or off by a turn?", stacklevel=5)


def _check_numbers(owner: ElementTree.Element) -> None:
    """Every number of a link or joint is one to both readers, and within its domain; blanks are
    made single.
    """
    kind = f"{owner.tag} '{owner.get('name')}'"
    for inertial in owner.iter("inertial"):
        for tag in ("mass", "inertia"):
            if inertial.find(tag) is None:
                raise InputError(f"the inertial of {kind} has no <{tag}>")
    for element in owner.iter():
        count, required, optional = _NUMBERS.get(element.tag, (0, (), ()))
        for name in (*required, *optional):
            text = element.get(name)
            if text is None and name in optional:
                continue
            what = f"{element.tag} {name} of {kind}"
            parts = (text or "").split()
            if len(parts) != count:
                raise InputError(
                    f"{what} must be {count} number{'s' * (count > 1)}, got {ascii(text)[:60]}"
                )
            high = np.inf if element.tag == "limit" else _LARGEST  # a limit that is huge is none
            low = -high if name in _SIGNED else -_ROUNDING if element.tag == "inertia" else 0.0
            for part in parts:
                if "_" in part or not part.isascii():  # numbers to Python alone
                    raise InputError(f"{what} must be a number, got {ascii(part)[:60]}")
                checks.number(what, number_in(part), low=low, high=high)
            element.set(name, " ".join(parts))


def number_in(text: str) -> float | str:
    """The number that a text is; the text itself where it is none."""
    try:
        return float(text)
    except ValueError:
        return text


def _check_joint(joint: ElementTree.Element) -> None:
    """A joint of a supported kind, with an axis and limits in order."""
    name, kind = joint.get("name"), joint.get("type")
    if kind not in _JOINTS:
        raise InputError(
            f"joint '{name}' is of type {ascii(kind)[:60]}; supported: {', '.join(_JOINTS)}"
        )
    if kind == "fixed":
        return
    axis, limit = joint.find("axis"), joint.find("limit")
    if axis is not None and not any(float(part) for part in axis.get("xyz", "1 0 0").split()):
        raise InputError(f"axis of joint '{name}' is zero")
    if kind == "continuous":  # its range is infinite, whatever the file says
        return
    if limit is None:
        raise InputError(f"joint '{name}' has no <limit>")
    upper, lower = float(limit.get("upper", "0")), float(limit.get("lower", "0"))
    checks.number(f"upper limit of joint '{name}'", upper, low=lower)


def _couplings(path: Path, joints: Sequence[ElementTree.Element]) -> list[Coupling]:
    """The joints that mimic others; one that mimics none of the file's is warned of."""
    moving, found, alone = [j.get("name") for j in joints if j.get("type") != "fixed"], [], []
    for joint in joints:
        name, mimic = str(joint.get("name")), joint.find("mimic")
        if mimic is None:
            continue
        leader = mimic.get("joint", "")
        joint.remove(mimic)
        if leader not in moving or leader == name:
            alone.append(f"'{name}' ({shown(leader)})")
            continue
        ratio, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
        found.append(Coupling(name, leader, ratio, offset))
    if alone:
        message = f"{_shown(path)}: joints mimic none that moves, and move on their own"
        warnings.warn(f"{message}: {first_of(alone)}", stacklevel=5)
    return found


def check_bodies(model: pin.Model) -> None:
    """What moves together is a body that can exist, and every joint moves something.

    The links that a fixed joint holds together are one body: files of real robots have links of no
    use on their own.
    """
    mass = sum(inertia.mass for inertia in model.inertias)
    if mass <= 0.0:
        raise InputError(f"total mass is {mass} kg")
    for name, body in zip(model.names, model.inertias, strict=True):
        smallest, middle, largest = np.linalg.eigvalsh(body.inertia)
        margin = _ROUNDING + 1e-6 * abs(largest)
        moments = f"{smallest:.3g}, {middle:.3g}, {largest:.3g} kg·m²"
        message = (
            f"no body has the inertia of what joint '{name}' moves: of its principal moments "
            f"{moments} one is"
        )
        if smallest < -margin:
            raise InputError(f"{message} negative")
        if smallest + middle < largest - margin:
            warnings.warn(f"{message} larger than the sum of the others", stacklevel=2)
    matrix = pin.crba(model, model.createData(), pin.neutral(model))
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        least = min(
            list(model.joints)[1:],
            key=lambda joint: matrix.diagonal()[joint.idx_v :][: joint.nv].min(),
        )
        raise InputError(
            "its mass matrix is singular: some joint moves no mass and has no armature, "
            f"most likely '{model.names[least.id]}'"
        ) from None
