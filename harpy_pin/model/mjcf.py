"""Robots in MuJoCo's format: a Pinocchio model of what MuJoCo compiles, and what a compiled model
knows of joints.

MuJoCo compiles the file, so that classes, frames, included files, units and inertias of meshes are
as it has them. What a tree of rigid bodies has no place for is refused where it changes how the
robot can move, and said in a warning otherwise.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.model.flat_foot import SOLE_DEPTH, FlatFoot, find_sole
from harpy_pin.model.loops import joints_of
from harpy_pin.model.mjcf_loops import (
    body_name,
    driven_joints,
    import_mujoco,
    joint_name,
    read_ties,
    refuse_loops,
    tendon_bodies,
)
from harpy_pin.model.mjcf_options import enabled_actuators, in_effect
from harpy_pin.model.mjcf_rods import (
    BALL,
    FREE,
    SECOND,
    SLIDE,
    across,
    at_rest,
    held_springs,
    hinge_angles,
    hinge_names,
    hinged,
)
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import tree_record
from harpy_pin.model.urdf import Description, check_bodies, robot_errors

TENDON = 3  # ``mujoco.mjtTrn``
FIXED_GAIN, NO_BIAS, NO_DYNAMICS = 0, 0, 0  # ``mujoco.mjtGain``, ``mjtBias``, ``mjtDyn``
UNNAMED = "MuJoCo Model"
"""Name of a model whose file gives none."""


def is_model(thing: Any) -> bool:
    """Whether something is a ``mujoco.MjModel``."""
    return hasattr(thing, "jnt_type")


def compile_mjcf(path: Path) -> Any:
    """The ``mujoco.MjModel`` of an MJCF file; one that MuJoCo refuses is a :class:`RobotError`."""
    with robot_errors(path, "an MJCF file", "MuJoCo"):
        return import_mujoco().MjModel.from_xml_path(str(path))


def read_mujoco(model: Any, frames: Sequence[str], label: str) -> Description:
    """One robot in a ``mujoco.MjModel``.

    The robot is the tree of bodies under a free joint that has one of these frames; without frames
    the tree with most joints. Angles are MuJoCo's: a joint at ``ref`` is as it is drawn in the
    file. Named bodies, sites, geoms and joints are frames. Of several with one name the first of
    that order has it, and the others have their kind before it: ``site:FL_foot``. The posture is
    the keyframe ``home``.

    Soles are the flat ones of these frames: rectangles around the ends of the lowest boxes,
    capsules, spheres and meshes of the frame's body that collide, or of the geom itself, where
    these are level in the posture.

    Args:
        model: is not changed.
        frames: names of the feet and mounts.
        label: of the file, before warnings; the name of a robot whose file has none.

    Raises:
        InputError: no body has a free joint, or the robot has what no tree of rigid bodies has: a
            ball joint, an equality constraint that is no loop, or a motor that pushes one way
            only.
        RobotError: as :func:`harpy_pin.model.urdf.check_bodies`.
    """
    model = in_effect(model)
    bodies = _robot_bodies(model, frames)
    joints = robot_joints(model, bodies)
    _refuse(model, bodies, joints)
    built, held = build_tree(model, bodies, joints)
    name = bytes(model.names).split(b"\0")[0].decode()
    built.name = Path(label).stem if name == UNNAMED else name
    tree_record(built)
    check_bodies(built)
    ties = read_ties(model, built, held)
    acting = driven_joints(model)[enabled_actuators(model)]
    undriven = [
        built.getJointId(name)
        for name, joint in zip(hinge_names(model, joints), joints, strict=True)
        if joint not in acting
    ]
    tied = {built.names[j] for tie in ties for j in joints_of(built, tie)}
    left = left_out(model, bodies, joints, tied)
    if not np.array_equal(model.opt.gravity, pin.Model().gravity.linear):
        left.append(
            f"gravity {model.opt.gravity} m/s², which the robot's model has, but no gait and no "
            f"plant expects"
        )
    if left:
        warnings.warn(
            f"{shown(label, 300)} has what a tree of rigid bodies has not: {'; '.join(left)}",
            stacklevel=4,
        )
    root = body_name(model, bodies[0])
    names = ("home", f"{root.removesuffix(plain_name(root))}home")
    home = [key for key in range(model.nkey) if str(model.key(key).name) in names]
    posture = hinge_angles(model, joints, model.key_qpos[home[0]]) if home else None
    q, data = pin.neutral(built), built.createData()
    q[7:] = posture if home else 0.0
    pin.framesForwardKinematics(built, data, q)
    soles, radii = {}, {}
    for name, kind, body, number in _frames(model, bodies):
        if name in frames:
            frame = built.getFrameId(name)
            if sole := _sole(model, kind, body, number, data.oMf[frame].rotation):
                soles[name] = sole
            geoms = [
                g
                for g in range(model.ngeom)
                if held.get(model.geom_bodyid[g], (0,))[0] == held[body][0]
            ]
            places = [held[model.geom_bodyid[g]][1].act(model.geom_pos[g]) for g in geoms]
            radii[name] = sphere_radius(
                model, geoms, places, built.frames[frame].placement.translation
            )
    start = hinge_angles(model, joints, model.qpos0) if posture is None else posture
    return Description(built, posture, soles, radii, ties, undriven, start)


def touching_geoms(model: Any) -> NDArray[np.bool_]:
    """(geoms,) whether they can touch others."""
    touching = (model.geom_contype | model.geom_conaffinity) != 0
    touching[[*model.pair_geom1, *model.pair_geom2]] = True
    return np.asarray(touching)


def sphere_radius(model: Any, geoms: Sequence[int], places: ArrayLike, point: Vector) -> float:
    """Radius of the largest of some spheres that touch and have a point inside, m; 0 where none
    does.

    Args:
        model: ``mujoco.MjModel``.
        geoms: (n,) numbers.
        places: (n, 3) of these geoms.
        point: (3,).
    """
    sphere = touching_geoms(model) & (model.geom_type == int(import_mujoco().mjtGeom.mjGEOM_SPHERE))
    size, apart = (
        model.geom_size[geoms, 0],
        np.linalg.norm(np.reshape(places, (-1, 3)) - point, axis=1),
    )
    return float(size[sphere[geoms] & (apart <= size)].max(initial=0.0))


def _sole(model: Any, kind: str, body: int, number: int, upright: Vector) -> FlatFoot | None:
    """The sole of a frame's body, or of a geom, whose axes are ``upright`` (3, 3) while the robot
    stands.
    """
    own, shapes, found = pin.SE3.Identity(), import_mujoco().mjtGeom, []
    if kind in ("site", "geom"):
        own = placement(
            getattr(model, f"{kind}_pos")[number], getattr(model, f"{kind}_quat")[number]
        )
    touching = (model.geom_bodyid == body) & touching_geoms(model)
    for geom in [number] if kind == "geom" else np.flatnonzero(touching):
        place, size = (
            own.actInv(placement(model.geom_pos[geom], model.geom_quat[geom])),
            model.geom_size[geom],
        )
        match int(model.geom_type[geom]):
            case shapes.mjGEOM_BOX:
                found.append((place, size, 0.0))
            case shapes.mjGEOM_CAPSULE:
                found.append((place, np.array((0.0, 0.0, size[1])), size[0]))
            case shapes.mjGEOM_SPHERE:
                found.append((place, np.zeros(3), size[0]))
            case shapes.mjGEOM_MESH:
                mesh = model.geom_dataid[geom]
                first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
                ends = model.mesh_vert[first : first + count] @ place.rotation.T + place.translation
                height = ends @ upright[2]
                lowest = ends[height < height.min() + SOLE_DEPTH]
                found += [
                    (pin.SE3(np.eye(3), end), np.zeros(3), 0.0) for end in lowest.astype(float)
                ]
    return find_sole(found, upright)


def _robot_bodies(model: Any, frames: Sequence[str]) -> NDArray[np.int64]:
    """Numbers of the bodies of the tree that has the frames, parents first."""
    roots = [int(model.jnt_bodyid[joint]) for joint in np.flatnonzero(model.jnt_type == FREE)]
    if not roots:
        raise InputError("it has no free joint: its base is fixed")
    trees = [np.flatnonzero(model.body_rootid == root) for root in roots]
    owners = [
        tree for tree in trees if not {name for name, *_ in _frames(model, tree)}.isdisjoint(frames)
    ]
    if len(owners) > 1:
        names = " and ".join(f"'{body_name(model, int(tree[0]))}'" for tree in owners[:2])
        raise InputError(f"feet are on two free bodies, {names}: load one robot after the other")
    return max(owners or trees, key=lambda tree: int(model.body_dofnum[tree].sum())).astype(
        np.int64
    )


def robot_joints(model: Any, bodies: NDArray[np.int64]) -> NDArray[np.int64]:
    """Joints that move the bodies of a robot, those of rods twice, without those that stiff springs
    hold; see :mod:`harpy_pin.model.mjcf_rods`.
    """
    joints = np.flatnonzero(np.isin(model.jnt_bodyid, bodies) & (model.jnt_type != FREE))
    return hinged(model, np.setdiff1d(joints, held_springs(model, joints)))


def _refuse(model: Any, bodies: NDArray[np.int64], joints: NDArray[np.int64]) -> None:
    """Refuse what changes how the robot can move."""
    for joint in joints[model.jnt_type[joints] == BALL]:
        across(model, int(joint))
    refuse_loops(model, bodies)
    for name, values in known_joints(model, joints).items():
        checks.gains(f"{name} of joints", values, len(joints))
    for joint, peak in zip(joints, peak_torques(model, joints), strict=True):
        if peak == 0.0:
            raise InputError(
                f"joint '{joint_name(model, joint)}' can be pushed one way only, which is not "
                f"supported"
            )


def build_tree(
    model: Any, bodies: NDArray[np.int64], joints: NDArray[np.int64]
) -> tuple[pin.Model, dict[int, tuple[int, pin.SE3]]]:
    """Pinocchio's model of bodies and joints; and of each body the joint that moves it, with its
    place in its frame.

    Args:
        model: ``mujoco.MjModel``.
        bodies: parents first; the first one has the free joint.
        joints: those that move; others are held where the model draws them, and by stiff springs
            where these are at rest.
    """
    built, known, peak = pin.Model(), known_joints(model, joints), peak_torques(model, joints)
    built.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    built.addJointFrame(1, 0)
    moved = {joint: k for k, joint in enumerate(joints.tolist())}
    others = np.setdiff1d(np.flatnonzero(np.isin(model.jnt_bodyid, bodies)), joints)
    resting = held_springs(model, others)
    frames = {
        body: [entry for entry in _frames(model, bodies) if entry[2] == body]
        for body in bodies.tolist()
    }
    last = {0: 1}  # frame of each body
    held = {0: (1, pin.SE3.Identity())}
    for body in bodies.tolist():
        above = int(model.body_parentid[body])
        moving, place = held[above]
        frame = last[above]
        if above:
            place = place * placement(model.body_pos[body], model.body_quat[body])
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])):
            if joint not in moved:
                place = place * at_rest(model, joint) if joint in resting else place
                continue
            k, turns = moved[joint], model.jnt_type[joint] != SLIDE
            ball = model.jnt_type[joint] == BALL
            axes = across(model, joint)[:, :2].T if ball else model.jnt_axis[[joint]]
            ref = 0.0 if ball else float(model.qpos0[model.jnt_qposadr[joint]])
            limited = model.jnt_limited[joint] and not ball
            low, high = model.jnt_range[joint] if limited else (-np.inf, np.inf)
            place = place * placement(model.jnt_pos[joint])
            named_frame = next(
                name
                for name, kind, *_, number in frames[body]
                if kind == "joint" and number == joint
            )
            for axis, behind in zip(np.array(axes), ("", SECOND), strict=False):
                back = placement(-ref * axis)
                if turns:
                    back = pin.SE3(pin.exp3(-ref * axis), np.zeros(3))
                moving = built.addJoint(
                    moving,
                    _joint_model(axis, turns),
                    place * back,
                    joint_name(model, joint) + behind,
                    *(
                        np.array([value])
                        for value in (-peak[k], peak[k], -np.inf, np.inf, low, high)
                    ),
                    *(
                        np.array([value])
                        for value in (
                            -known["friction"][k],
                            known["friction"][k],
                            known["damping"][k],
                        )
                    ),
                )
                built.armature[built.joints[moving].idx_v] = known["armature"][k]
                place = pin.SE3.Identity()
                frame = built.addFrame(
                    pin.Frame(named_frame + behind, moving, frame, place, pin.FrameType.JOINT)
                )
            place = placement(-model.jnt_pos[joint])
        axes = placement(model.body_ipos[body], model.body_iquat[body])
        inertia = pin.Inertia(model.body_mass[body], np.zeros(3), np.diag(model.body_inertia[body]))
        built.appendBodyToJoint(moving, inertia, place * axes)
        for name, kind, _, number in frames[body]:
            if kind == "body":
                last[body] = built.addFrame(
                    pin.Frame(name, moving, frame, place, pin.FrameType.BODY)
                )
            elif kind != "joint":
                at = place * placement(
                    getattr(model, f"{kind}_pos")[number], getattr(model, f"{kind}_quat")[number]
                )
                built.addFrame(pin.Frame(name, moving, last[body], at, pin.FrameType.OP_FRAME))
        held[body] = (moving, place)
    base = int(model.body_dofadr[bodies[0]])
    built.armature[:6] = model.dof_armature[base : base + 6]
    built.gravity.linear = np.array(model.opt.gravity)
    return built, held


def _joint_model(axis: Vector, turns: bool) -> Any:
    """Pinocchio's joint that turns about an axis or slides along it."""
    along = np.flatnonzero(axis == 1.0)
    if len(along):
        return getattr(pin, f"JointModel{'R' if turns else 'P'}{'XYZ'[along[0]]}")()
    return (pin.JointModelRevoluteUnaligned if turns else pin.JointModelPrismaticUnaligned)(axis)


def placement(position: Vector, quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0)) -> pin.SE3:
    """A placement of MuJoCo's, whose quaternions begin with w."""
    return pin.SE3(
        pin.Quaternion(*(float(x) for x in quaternion)).toRotationMatrix(), np.array(position)
    )


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


def left_out(
    model: Any, bodies: NDArray[np.int64], joints: NDArray[np.int64], tied: Collection[str] = ()
) -> list[str]:
    """What a tree of rigid bodies has no place for, each in some words that name where it is;
    ``tied`` joints need no actuator.
    """
    held = held_springs(model, np.flatnonzero(np.isin(model.jnt_bodyid, bodies)))
    base, dofs, free = (
        [body_name(model, bodies[0])],
        model.jnt_dofadr[joints],
        model.body_jntadr[bodies[:1]],
    )
    names, drives = hinge_names(model, joints), joints[:, None] == driven_joints(model)
    acting = drives & enabled_actuators(model)
    mine = np.flatnonzero(acting.any(axis=0))
    actuators = [str(model.actuator(number).name) or f"number {number}" for number in mine]
    pulled = np.isin(
        np.arange(model.ntendon), model.actuator_trnid[model.actuator_trntype == TENDON, 0]
    )
    for name in (
        "stiffness",
        "stiffnesspoly",
        "damping",
        "dampingpoly",
        "frictionloss",
        "armature",
        "limited",
    ):
        pulled |= np.atleast_2d(getattr(model, f"tendon_{name}").T).any(axis=0)
    tendons = [
        n for n in np.flatnonzero(pulled).tolist() if np.isin(tendon_bodies(model, n), bodies).any()
    ]
    springs = np.column_stack((model.jnt_stiffness, model.jnt_stiffnesspoly))
    squares = drives @ (
        model.actuator_dampingpoly * model.actuator_gear[model.actuator_outadr, :1] ** 2
    )
    of_base = model.dof_jntid == free
    left = [
        named("springs of joint", names, springs[joints], " N·m/rad"),
        named(
            "stiff springs, held where they are at rest, of joint",
            [joint_name(model, joint) for joint in held],
            springs[held],
            " N·m/rad",
        ),
        named(
            "damping that is not linear of joint",
            names,
            model.dof_dampingpoly[dofs] + squares,
            " N·m·s²/rad²",
        ),
        named(
            "tendon",
            [str(model.tendon(n).name) or f"number {n}" for n in tendons],
            np.ones(len(tendons)),
        ),
        named(
            "gravcomp of body",
            [body_name(model, body) for body in bodies],
            model.body_gravcomp[bodies],
            "",
        ),
        named("delay of actuator", actuators, model.actuator_delay[mine], " s"),
        named(
            "a state of its own of actuator", actuators, model.actuator_dyntype[mine] != NO_DYNAMICS
        ),
        named(
            "no actuator of joint",
            names,
            ~acting.any(axis=1) & acting.any() & ~np.isin(names, list(tied)),
        ),
        named("a spring of the free joint of body", base, springs[free]),
        named(
            "damping of the free joint of body",
            base,
            model.dof_damping[of_base],
            " N·s/m, N·m·s/rad",
        ),
        named(
            "damping that is not linear of the free joint of body",
            base,
            model.dof_dampingpoly[of_base],
        ),
        named("dry friction of the free joint of body", base, model.dof_frictionloss[of_base]),
    ]
    if model.opt.density or model.opt.viscosity:
        air = (
            f"air of density {model.opt.density:g} kg/m³ and viscosity {model.opt.viscosity:g} Pa·s"
        )
        left.append(f"{air}, wind {model.opt.wind} m/s")
    return [line for line in left if line]


def named(what: str, names: Sequence[str], values: ArrayLike, unit: str | None = None) -> str:
    """Words on what some things have: of the first its name and, with a unit, its numbers; empty
    where none has any.

    Args:
        what: they have.
        names: of all.
        values: (names,), or several numbers for each; zero where there is nothing.
        unit: of the numbers.
    """
    numbers = np.atleast_2d(np.transpose(values)).T
    has = np.flatnonzero(numbers.any(axis=1))
    if not len(has):
        return ""
    given = ", ".join(f"{number:.4g}" for number in numbers[has[0]] if number)
    size = "" if unit is None else f" ({given}{unit})"
    more = f" and {len(has) - 1} more" if len(has) > 1 else ""
    return f"{what} {shown(names[has[0]])}{size}{more}"


def plain_name(name: str) -> str:
    """A name without the prefix of an attached model."""
    return re.split(r"[:/]", name)[-1]


def find_joints(model: Any, names: Sequence[str]) -> NDArray[np.int64]:
    """Numbers of joints in a ``mujoco.MjModel``, by their names without prefix.

    An :class:`InputError` says that it is no such model, lacks a joint, or has two of that name.
    """
    if not is_model(model):
        raise InputError(
            f"model must be a mujoco.MjModel, got {shown(model)}", name="model", value=model
        )
    found: dict[str, list[int]] = {}
    for number in np.flatnonzero(model.jnt_type != FREE).tolist():
        name = joint_name(model, number)
        for short in {name, plain_name(name), name.removeprefix("joint:")}:
            found.setdefault(short, []).append(number)
            if model.jnt_type[number] == BALL:
                found.setdefault(short + SECOND, []).append(number)
    for name in names:
        checks.one_of("joint of the MuJoCo model", name, found)
        if len(found[name]) > 1:
            raise InputError(
                f"the MuJoCo model has {len(found[name])} joints '{name}'", name="model"
            )
    return np.array([found[name][0] for name in names], dtype=np.int64)


def free_joint(model: Any, joints: NDArray[np.int64]) -> int:
    """Number of the free joint that moves the base of a robot with these joints; refuses a model
    without one.
    """
    free = np.flatnonzero(model.jnt_type == FREE)
    if len(joints):
        free = free[model.jnt_bodyid[free] == model.body_rootid[model.jnt_bodyid[joints[0]]]]
    if not len(free):
        raise InputError(
            "the MuJoCo model has no free joint above the robot's joints", name="model"
        )
    return int(free[0])


def known_joints(model: Any, joints: NDArray[np.int64]) -> dict[str, Vector]:
    """Armature, kg·m², damping, N·m·s/rad, and dry friction, N·m, each (joints,), of joints of a
    MuJoCo model.

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
    """(joints,) torques that joints take both ways, N·m: of their ranges and enabled actuators;
    infinite without any.

    Limits of an actuator are ``forcerange``, and ``ctrlrange`` times the gain where its force is
    that product, both times ``gear``; those of several on a joint add up. It is the smaller side of
    a range.
    """
    control, gear = model.actuator_ctrladr, model.actuator_gear[model.actuator_outadr, :1]
    motor = (model.actuator_biastype == NO_BIAS) & (model.actuator_gaintype == FIXED_GAIN)
    limited, everything = (
        motor & (model.actuator_ctrllimited[control] != 0),
        np.array([-np.inf, np.inf]),
    )
    force = np.where(model.actuator_forcelimited[:, None], model.actuator_forcerange, everything)
    own = np.sort(model.actuator_gainprm[:, :1] * model.actuator_ctrlrange[control])
    force = np.where(limited[:, None], np.clip(own, force[:, :1], force[:, 1:]), force)
    force = np.sort(gear * np.where(gear == 0.0, 0.0, force))
    drives = ((joints[:, None] == driven_joints(model)) & enabled_actuators(model))[:, :, None]
    low, high = np.where(drives.any(axis=1), np.where(drives, force, 0.0).sum(axis=1), everything).T
    of_joint = np.where(
        model.jnt_actfrclimited[joints, None], model.jnt_actfrcrange[joints], everything
    )
    both: Vector = np.minimum(-np.maximum(low, of_joint[:, 0]), np.minimum(high, of_joint[:, 1]))
    return np.maximum(both, 0.0)
