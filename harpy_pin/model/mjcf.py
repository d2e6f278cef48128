"""Robots in MuJoCo's format: a Pinocchio model of what MuJoCo compiles, and what a compiled model knows of joints.

MuJoCo compiles the file, so that classes, frames, included files, units and inertias of meshes are as it has them. What
a tree of rigid bodies has no place for is refused where it changes how the robot can move, and said in a warning
otherwise.
"""

from __future__ import annotations

import copy
import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError, install_line, shown
from harpy_pin.model.flat_foot import FlatFoot, find_sole
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import tree_record
from harpy_pin.model.urdf import check_bodies, robot_errors

FREE, BALL, SLIDE, HINGE = range(4)  # ``mujoco.mjtJoint``
JOINT_IN_PARENT, TENDON = 1, 3  # ``mujoco.mjtTrn``; a joint's own is 0
FIXED_GAIN, NO_BIAS, NO_DYNAMICS = 0, 0, 0  # ``mujoco.mjtGain``, ``mjtBias``, ``mjtDyn``
UNNAMED = "MuJoCo Model"
"""Name of a model whose file gives none."""
SWITCHES = {
    "mjDSBL_EQUALITY": ("eq_active0",),
    "mjDSBL_FRICTIONLOSS": ("dof_frictionloss",),
    "mjDSBL_LIMIT": ("jnt_limited",),
    "mjDSBL_SPRING": ("jnt_stiffness", "jnt_stiffnesspoly"),
    "mjDSBL_DAMPER": ("dof_damping", "dof_dampingpoly", "actuator_damping", "actuator_dampingpoly"),
    "mjDSBL_CLAMPCTRL": ("actuator_ctrllimited",),
}
"""Arrays without effect where an option disables them."""


def import_mujoco() -> Any:
    """The module ``mujoco``; an :class:`InputError` where it is not installed."""
    try:
        import mujoco
    except ImportError as error:
        raise InputError(f"no MuJoCo ({error}): {install_line('mujoco')}", name="plant", value="mujoco") from error
    return mujoco


def is_model(thing: Any) -> bool:
    """Whether something is a ``mujoco.MjModel``."""
    return hasattr(thing, "jnt_type")


def compile_mjcf(path: Path) -> Any:
    """The ``mujoco.MjModel`` of an MJCF file; one that MuJoCo refuses is a :class:`RobotError`."""
    with robot_errors(path, "an MJCF file", "MuJoCo"):
        return import_mujoco().MjModel.from_xml_path(str(path))


def read_mujoco(model: Any, frames: Sequence[str], label: str) -> tuple[pin.Model, Vector | None, dict[str, FlatFoot]]:
    """Pinocchio's model of one robot in a ``mujoco.MjModel``, its standing posture (joints,), rad, and its soles.

    The robot is the tree of bodies under a free joint that has one of these frames; without frames the tree with most
    joints. Angles are MuJoCo's: a joint at ``ref`` is as it is drawn in the file. Named bodies, sites, geoms and joints
    are frames. Of several with one name the first of that order has it, and the others have their kind before it:
    ``site:FL_foot``. The posture is the keyframe ``home``, None where there is none.

    Soles are the flat ones of these frames: rectangles around the ends of the lowest boxes, capsules and spheres of the
    frame's body that collide, or of the geom itself, where these are level in the posture.

    Args:
        model: is not changed.
        frames: names of the feet and mounts.
        label: of the file, before warnings; the name of a robot whose file has none.

    Raises:
        InputError: no body has a free joint, or the robot has what no tree of rigid bodies has: a ball joint, an active
            equality constraint, or a motor that pushes one way only.
        RobotError: as :func:`harpy_pin.model.urdf.check_bodies`.
    """
    model = _in_effect(model)
    bodies = _robot_bodies(model, frames)
    joints = np.flatnonzero(np.isin(model.jnt_bodyid, bodies) & (model.jnt_type != FREE))
    _refuse(model, bodies, joints)
    built = _tree(model, bodies, joints)
    name = bytes(model.names).split(b"\0")[0].decode()
    built.name = Path(label).stem if name == UNNAMED else name
    tree_record(built)
    check_bodies(built)
    left = _left_out(model, bodies, joints)
    if left:
        warnings.warn(f"{shown(label, 300)} has what a tree of rigid bodies has not: {'; '.join(left)}", stacklevel=4)
    root = body_name(model, bodies[0])
    names = ("home", f"{root.removesuffix(plain_name(root))}home")
    home = [key for key in range(model.nkey) if str(model.key(key).name) in names]
    posture = np.array(model.key_qpos[home[0], model.jnt_qposadr[joints]]) if home else None
    q, data = pin.neutral(built), built.createData()
    q[7:] = posture if home else 0.0
    pin.framesForwardKinematics(built, data, q)
    soles = {}
    for name, kind, body, number in _frames(model, bodies):
        if name in frames:
            soles[name] = _sole(model, kind, body, number, data.oMf[built.getFrameId(name)].rotation)
    return built, posture, {name: sole for name, sole in soles.items() if sole is not None}


def _sole(model: Any, kind: str, body: int, number: int, upright: Vector) -> FlatFoot | None:
    """The sole of a frame's body, or of a geom, whose axes are ``upright`` (3, 3) while the robot stands."""
    own, shapes, found = pin.SE3.Identity(), import_mujoco().mjtGeom, []
    if kind in ("site", "geom"):
        own = _place(getattr(model, f"{kind}_pos")[number], getattr(model, f"{kind}_quat")[number])
    touching = (model.geom_bodyid == body) & ((model.geom_contype | model.geom_conaffinity) != 0)
    for geom in [number] if kind == "geom" else np.flatnonzero(touching):
        place, size = own.actInv(_place(model.geom_pos[geom], model.geom_quat[geom])), model.geom_size[geom]
        match int(model.geom_type[geom]):
            case shapes.mjGEOM_BOX:
                found.append((place, size, 0.0))
            case shapes.mjGEOM_CAPSULE:
                found.append((place, np.array((0.0, 0.0, size[1])), size[0]))
            case shapes.mjGEOM_SPHERE:
                found.append((place, np.zeros(3), size[0]))
    return find_sole(found, upright)


def _in_effect(model: Any) -> Any:
    """The model, without what its options disable."""
    disable, flags = import_mujoco().mjtDisableBit, int(model.opt.disableflags)
    if not flags:
        return model
    model = copy.copy(model)
    for name in (n for switch, arrays in SWITCHES.items() if flags & int(getattr(disable, switch)) for n in arrays):
        getattr(model, name)[:] = 0
    if flags & int(disable.mjDSBL_GRAVITY):
        model.opt.gravity[:] = 0.0
    return model


def _robot_bodies(model: Any, frames: Sequence[str]) -> NDArray[np.int64]:
    """Numbers of the bodies of the tree that has the frames, parents first."""
    roots = [int(model.jnt_bodyid[joint]) for joint in np.flatnonzero(model.jnt_type == FREE)]
    if not roots:
        raise InputError("it has no free joint: its base is fixed")
    trees = [np.flatnonzero(model.body_rootid == root) for root in roots]
    owners = [tree for tree in trees if not {name for name, *_ in _frames(model, tree)}.isdisjoint(frames)]
    if len(owners) > 1:
        names = " and ".join(f"'{body_name(model, int(tree[0]))}'" for tree in owners[:2])
        raise InputError(f"feet are on two free bodies, {names}: load one robot after the other")
    return max(owners or trees, key=lambda tree: int(model.body_dofnum[tree].sum())).astype(np.int64)


def _refuse(model: Any, bodies: NDArray[np.int64], joints: NDArray[np.int64]) -> None:
    """Refuse what changes how the robot can move."""
    for joint in joints[model.jnt_type[joints] == BALL]:
        raise InputError(f"joint '{joint_name(model, joint)}' is a ball joint, which is not supported")
    kinds, of_site = import_mujoco().mjtEq, int(import_mujoco().mjtObj.mjOBJ_SITE)
    for number in np.flatnonzero(model.eq_active0):
        kind = kinds(model.eq_type[number]).name.removeprefix("mjEQ_").lower()
        ends = np.array([model.eq_obj1id[number], model.eq_obj2id[number]])
        ends = ends[ends >= 0]
        if kind in ("connect", "weld"):
            ends = model.site_bodyid[ends] if model.eq_objtype[number] == of_site else ends
        elif kind == "joint":
            ends = model.jnt_bodyid[ends]
        else:  # a tendon's or a flex's, which may pull on any body
            ends = bodies
        if np.isin(ends, bodies).any():
            name = f" '{model.equality(number).name}'" if model.equality(number).name else ""
            message = f"it has the equality constraint <{kind}>{name}: closed loops and couplings are not supported"
            raise InputError(message)
    for name, values in known_joints(model, joints).items():
        checks.gains(f"{name} of joints", values, len(joints))
    for joint, peak in zip(joints, peak_torques(model, joints), strict=True):
        if peak == 0.0:
            raise InputError(f"joint '{joint_name(model, joint)}' can be pushed one way only, which is not supported")


def _tree(model: Any, bodies: NDArray[np.int64], joints: NDArray[np.int64]) -> pin.Model:
    """Joints, inertias, limits and frames of the bodies."""
    built, known, peak = pin.Model(), known_joints(model, joints), peak_torques(model, joints)
    built.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    built.addJointFrame(1, 0)
    frames = {body: [entry for entry in _frames(model, bodies) if entry[2] == body] for body in bodies.tolist()}
    last = {0: 1}  # frame of each body
    held = {0: (1, pin.SE3.Identity())}  # joint that moves each body, and the body's place in its frame
    for body in bodies.tolist():
        above = int(model.body_parentid[body])
        moving, place = held[above]
        frame = last[above]
        if above:
            place = place * _place(model.body_pos[body], model.body_quat[body])
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])) if above else ():
            k, arm, axis = joint - int(joints[0]), model.jnt_pos[joint], np.array(model.jnt_axis[joint])
            turns, ref = model.jnt_type[joint] == HINGE, float(model.qpos0[model.jnt_qposadr[joint]])
            back = pin.SE3(pin.exp3(-ref * axis), np.zeros(3)) if turns else _place(-ref * axis)
            low, high = model.jnt_range[joint] if model.jnt_limited[joint] else (-np.inf, np.inf)
            moving = built.addJoint(
                moving,
                _joint_model(axis, turns),
                place * _place(arm) * back,
                joint_name(model, joint),
                *(np.array([value]) for value in (-peak[k], peak[k], -np.inf, np.inf, low, high)),
                *(np.array([value]) for value in (-known["friction"][k], known["friction"][k], known["damping"][k])),
            )
            built.armature[built.joints[moving].idx_v] = known["armature"][k]
            place = _place(-arm)
            name = next(name for name, kind, *_, number in frames[body] if kind == "joint" and number == joint)
            frame = built.addFrame(pin.Frame(name, moving, frame, pin.SE3.Identity(), pin.FrameType.JOINT))
        axes = _place(model.body_ipos[body], model.body_iquat[body])
        inertia = pin.Inertia(model.body_mass[body], np.zeros(3), np.diag(model.body_inertia[body]))
        built.appendBodyToJoint(moving, inertia, place * axes)
        for name, kind, _, number in frames[body]:
            if kind == "body":
                last[body] = built.addFrame(pin.Frame(name, moving, frame, place, pin.FrameType.BODY))
            elif kind != "joint":
                at = place * _place(getattr(model, f"{kind}_pos")[number], getattr(model, f"{kind}_quat")[number])
                built.addFrame(pin.Frame(name, moving, last[body], at, pin.FrameType.OP_FRAME))
        held[body] = (moving, place)
    base = int(model.body_dofadr[bodies[0]])
    built.armature[:6] = model.dof_armature[base : base + 6]
    built.gravity.linear = np.array(model.opt.gravity)
    return built


def _joint_model(axis: Vector, turns: bool) -> Any:
    """Pinocchio's joint that turns about an axis or slides along it."""
    along = np.flatnonzero(axis == 1.0)
    if len(along):
        return getattr(pin, f"JointModel{'R' if turns else 'P'}{'XYZ'[along[0]]}")()
    return (pin.JointModelRevoluteUnaligned if turns else pin.JointModelPrismaticUnaligned)(axis)


def _place(position: Vector, quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> pin.SE3:
    """A placement of MuJoCo's, whose quaternions begin with w."""
    return pin.SE3(pin.Quaternion(*(float(x) for x in quaternion)).toRotationMatrix(), np.array(position))


def _frames(model: Any, bodies: NDArray[np.int64]) -> list[tuple[str, str, int, int]]:
    """Name, kind, body and number of everything in these bodies that is a frame of the robot."""
    taken, found = {"universe", "root_joint"}, []
    for kind, owners in (
        ("body", np.arange(model.nbody)),
        ("site", model.site_bodyid),
        ("geom", model.geom_bodyid),
        ("joint", model.jnt_bodyid),
    ):
        for number in np.flatnonzero(np.isin(owners, bodies)).tolist():
            named = {"body": body_name, "joint": joint_name}.get(kind)
            name = str(getattr(model, kind)(number).name) if named is None else named(model, number)
            if name and not (kind == "joint" and model.jnt_type[number] == FREE):
                name = f"{kind}:{name}" if name in taken else name
                taken.add(name)
                found.append((name, kind, int(owners[number]), number))
    return found


def body_name(model: Any, number: int) -> str:
    """Name of a body; ``body_3`` of one without."""
    return str(model.body(number).name) or f"body_{number}"


def joint_name(model: Any, number: int) -> str:
    """Name of a joint; of one without, that of its body with ``_joint`` behind, and ``_joint_1`` for its second."""
    body = int(model.jnt_bodyid[number])
    place = int(number) - int(model.body_jntadr[body])
    return str(model.joint(number).name) or f"{body_name(model, body)}_joint{f'_{place}' if place else ''}"


def _left_out(model: Any, bodies: NDArray[np.int64], joints: NDArray[np.int64]) -> list[str]:
    """What a tree of rigid bodies has no place for, each in some words that name where it is."""
    base, dofs = [body_name(model, bodies[0])], model.jnt_dofadr[joints]
    free = model.dof_jntid == model.body_jntadr[bodies[0]]
    names, drives = [joint_name(model, joint) for joint in joints], joints[:, None] == driven_joints(model)
    mine = np.flatnonzero(drives.any(axis=0))
    actuators = [str(model.actuator(number).name) or f"number {number}" for number in mine]
    tendons = [str(model.tendon(number).name) or f"number {number}" for number in range(model.ntendon)]
    pulled = np.isin(np.arange(model.ntendon), model.actuator_trnid[model.actuator_trntype == TENDON, 0])
    for name in ("stiffness", "stiffnesspoly", "damping", "dampingpoly", "frictionloss", "armature", "limited"):
        pulled |= getattr(model, f"tendon_{name}").any(axis=tuple(range(1, getattr(model, f"tendon_{name}").ndim)))
    stiff = (model.jnt_stiffness != 0.0) | model.jnt_stiffnesspoly.any(axis=1)
    bent = model.dof_dampingpoly.any(axis=1)
    said = [
        ("springs of joint", names, stiff[joints]),
        ("damping that is not linear of joint", names, bent[dofs] | (drives @ model.actuator_dampingpoly).any(axis=1)),
        ("tendon", tendons, pulled),
        ("gravcomp of body", [body_name(model, body) for body in bodies], model.body_gravcomp[bodies]),
        ("delay of actuator", actuators, model.actuator_delay[mine]),
        ("a state of its own of actuator", actuators, model.actuator_dyntype[mine] != NO_DYNAMICS),
        ("no actuator of joint", names, ~drives.any(axis=1) & drives.any()),
        ("a spring of the free joint of body", base, stiff[model.body_jntadr[bodies[:1]]]),
        ("damping of the free joint of body", base, [(model.dof_damping[free] + bent[free]).any()]),
        ("dry friction of the free joint of body", base, [model.dof_frictionloss[free].any()]),
        ("density of the option", ["air"], [model.opt.density or model.opt.viscosity]),
    ]
    found = [(what, [name for name, has in zip(n, there, strict=True) if has]) for what, n, there in said]
    left = [f"{what} {shown(n[0])}{f' and {len(n) - 1} more' if len(n) > 1 else ''}" for what, n in found if n]
    if not np.array_equal(model.opt.gravity, pin.Model().gravity.linear):
        left.append(f"gravity {model.opt.gravity} m/s², which the robot's model has, but no gait and no plant expects")
    return left


def driven_joints(model: Any) -> NDArray[np.int64]:
    """(actuators,) number of the joint that each actuator of a model drives; −1 where it drives something else."""
    return np.where(model.actuator_trntype <= JOINT_IN_PARENT, model.actuator_trnid[:, 0], -1).astype(np.int64)


def plain_name(name: str) -> str:
    """A name without the prefix of an attached model."""
    return re.split(r"[:/]", name)[-1]


def find_joints(model: Any, names: Sequence[str]) -> NDArray[np.int64]:
    """Numbers of joints in a ``mujoco.MjModel``, by their names without prefix.

    An :class:`InputError` says that it is no such model, has no free joint, lacks a joint, or has two of that name.
    """
    if not is_model(model):
        raise InputError(f"model must be a mujoco.MjModel, got {shown(model)}", name="model", value=model)
    if FREE not in model.jnt_type:
        raise InputError("the MuJoCo model has no free joint: its base is fixed", name="model")
    found: dict[str, list[int]] = {}
    for number in range(model.njnt):
        if model.jnt_type[number] != FREE:
            name = joint_name(model, number)
            for short in {name, plain_name(name), name.removeprefix("joint:")}:
                found.setdefault(short, []).append(number)
    for name in names:
        checks.one_of("joint of the MuJoCo model", name, found)
        if len(found[name]) > 1:
            raise InputError(f"the MuJoCo model has {len(found[name])} joints '{name}'", name="model")
    return np.array([found[name][0] for name in names], dtype=np.int64)


def free_joint(model: Any, joints: NDArray[np.int64]) -> int:
    """Number of the free joint that moves the base of a robot with these joints; refuses a model without one."""
    free = [number for number in range(model.njnt) if model.jnt_type[number] == FREE]
    if len(joints):
        root = model.body_rootid[model.jnt_bodyid[joints[0]]]
        free = [number for number in free if model.jnt_bodyid[number] == root]
    if not free:
        raise InputError("the MuJoCo model has no free joint above the robot's joints", name="model")
    return free[0]


def known_joints(model: Any, joints: NDArray[np.int64]) -> dict[str, Vector]:
    """Armature, kg·m², damping, N·m·s/rad, and dry friction, N·m, each (joints,), of joints of a MuJoCo model.

    Armature and damping of actuators count at their joints, times the gear squared.
    """
    place, drives = model.jnt_dofadr[joints], joints[:, None] == driven_joints(model)
    gear = model.actuator_gear[model.actuator_outadr, 0]
    return {
        "armature": model.dof_armature[place] + drives @ (model.actuator_armature * gear**2),
        "damping": model.dof_damping[place] + drives @ (model.actuator_damping * gear**2),
        "friction": np.array(model.dof_frictionloss[place]),
    }


def peak_torques(model: Any, joints: NDArray[np.int64]) -> Vector:
    """(joints,) torques that joints can take both ways, N·m: of their ranges and actuators; infinite without limits.

    Limits of an actuator are ``forcerange``, and ``ctrlrange`` times the gain where its force is that product, both
    times ``gear``; those of several on a joint add up. It is the smaller side of a range.
    """
    control, gear = model.actuator_ctrladr, model.actuator_gear[model.actuator_outadr, :1]
    motor = (model.actuator_biastype == NO_BIAS) & (model.actuator_gaintype == FIXED_GAIN)
    limited, everything = motor & (model.actuator_ctrllimited[control] != 0), np.array([-np.inf, np.inf])
    force = np.where(model.actuator_forcelimited[:, None], model.actuator_forcerange, everything)
    own = np.sort(model.actuator_gainprm[:, :1] * model.actuator_ctrlrange[control])
    force = np.where(limited[:, None], np.clip(own, force[:, :1], force[:, 1:]), force)
    force = np.sort(gear * np.where(gear == 0.0, 0.0, force))
    drives = (joints[:, None] == driven_joints(model))[:, :, None]
    low, high = np.where(drives.any(axis=1), np.where(drives, force, 0.0).sum(axis=1), everything).T
    of_joint = np.where(model.jnt_actfrclimited[joints, None], model.jnt_actfrcrange[joints], everything)
    both: Vector = np.minimum(-np.maximum(low, of_joint[:, 0]), np.minimum(high, of_joint[:, 1]))
    return np.maximum(both, 0.0)
