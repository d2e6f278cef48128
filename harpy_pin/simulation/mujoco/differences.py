"""What a MuJoCo model of a robot has otherwise than the robot: numbers at zero angles, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin.errors import InputError
from harpy_pin.model.mjcf import peak_torques
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import tree_record

ROOT = 1  # index of the floating base's joint in Pinocchio's model
SHARE = 0.01  # share by which numbers may differ
LENGTH = 1e-3  # distance by which places may differ, m
ANGLE = 1e-2  # angle by which axes may differ, rad
MAX_TURN, MAX_SHIFT = 0.2, 0.05
"""Difference of axes, and distance, m, beyond which a joint has another direction, axis or zero."""
HINGE, SLIDE = 3, 2  # ``mujoco.mjtJoint``
LEAST = 1e-6  # masses, inertias and friction below it are none
ACTUATION = 1 << 11  # ``mujoco.mjtDisableBit.mjDSBL_ACTUATION``
INFINITE = np.array([[-np.inf], [np.inf]])
OF_WRAP = {1: "jnt_bodyid", 3: "site_bodyid", 4: "geom_bodyid", 5: "geom_bodyid"}
"""Bodies of what a tendon passes, by ``mujoco.mjtWrap``."""
ENDLESS = 1e3  # angles or lengths beyond it are no end of a joint
WRONG_IF_SPARSE = "4.0.0"  # MuJoCo whose Newton solver has a wrong Hessian with sparse Jacobians


class AtZero:
    """Model and robot with the base at the origin and all joints at zero.

    ``link`` is Pinocchio's index of the joint that moves each body, 0 for what is no part; ``foot`` the feet's places.
    """

    def __init__(self, mujoco: Any, model: Any, robot: Robot, joints: NDArray[np.int64], free: int) -> None:
        self.mujoco, self.model, self.robot, self.joints = mujoco, model, robot, joints
        self.root = int(model.body_rootid[model.jnt_bodyid[free]])
        data = mujoco.MjData(model)
        first = int(model.jnt_qposadr[free])
        data.qpos[first : first + 7] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        data.qpos[model.jnt_qposadr[joints]] = 0.0
        mujoco.mj_kinematics(model, data)
        self.data = data
        numbers = {int(model.jnt_bodyid[free]): ROOT}
        numbers |= {int(model.jnt_bodyid[joint]): ROOT + 1 + k for k, joint in enumerate(joints)}
        self.link = np.zeros(model.nbody, np.int64)
        for body in range(1, model.nbody):
            self.link[body] = numbers.get(body, self.link[model.body_parentid[body]])
        self.own = robot.model.createData()
        pin.framesForwardKinematics(robot.model, self.own, pin.neutral(robot.model))
        places = [self.own.oMf[robot.frame_id(name)].translation for name in robot.feet]
        self.foot: Vector = np.array(places).reshape(-1, 3)

    def check_joints(self) -> None:
        """Refuse joints that do not turn or slide about the robot's axes, in its direction and from its zero."""
        robot, model = self.robot, self.model
        for joint, name, own in zip(self.joints, robot.joints, list(robot.model.joints)[ROOT + 1 :], strict=True):
            kind = SLIDE if "JointModelP" in own.shortname() else HINGE
            if model.jnt_type[joint] != kind:
                desired = "turn about one axis" if kind == HINGE else "slide"
                raise InputError(f"joint '{name}' of the MuJoCo model does not {desired}, as the robot's", name="model")
        frames, (_, centre, _) = list(self.own.oMi)[ROOT:], self.links()
        levers = [frame.act(body.lever) for frame, body in zip(frames, list(robot.model.inertias)[ROOT:], strict=True)]
        joints = robot.joints
        for what, names, theirs, ours, most in (
            ("axis or direction of joint", joints, self.data.xaxis[self.joints], self.axes(), MAX_TURN),
            ("place of joint", joints, self.data.xanchor[self.joints], [m.translation for m in frames[1:]], MAX_SHIFT),
            ("place of the link", joints, centre[1:], levers[1:], MAX_SHIFT),
        ):
            if line := _compared(what, "", names, theirs, ours, most):
                raise InputError(f"the MuJoCo model has other joints than the robot: {line}", name="model")

    def axes(self) -> list[Vector]:
        """(3,) axis of each joint of the robot, in the world."""
        frames, axes = list(self.own.oMi)[ROOT:], tree_record(self.robot.model)["axis"][0]
        return [frame.rotation @ axis for frame, axis in zip(frames, axes, strict=True)][1:]

    def links(self) -> tuple[Vector, Vector, Vector]:
        """Mass, kg, centre, m, and inertia about it, kg·m², world axes, of the model's links, in Pinocchio's order."""
        model, data, count = self.model, self.data, self.robot.model.njoints - ROOT
        mass, centre, inertia = np.zeros(count), np.zeros((count, 3)), np.zeros((count, 3, 3))
        for n in range(count):
            bodies = np.flatnonzero(self.link == ROOT + n)
            mass[n] = model.body_mass[bodies].sum()
            if mass[n] > 0.0:
                centre[n] = model.body_mass[bodies] @ data.xipos[bodies] / mass[n]
            for body in bodies:
                axes, arm = data.ximat[body].reshape(3, 3), data.xipos[body] - centre[n]
                inertia[n] += (axes * model.body_inertia[body]) @ axes.T
                inertia[n] += model.body_mass[body] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return mass, centre, inertia

    def ends(self) -> tuple[Vector, Vector, Vector, Vector]:
        """(joints,) lower and upper ends of the model's joints, and of the robot's; infinite where there are none."""
        model, own = self.model, self.robot.model
        limited = (model.jnt_limited[self.joints] != 0) & _flags(self.mujoco, model)["limit"]
        theirs = np.where(limited, model.jnt_range[self.joints].T, INFINITE)
        ours = INFINITE.repeat(len(self.joints), axis=1)
        for k, joint in enumerate(list(own.joints)[ROOT + 1 :]):
            if joint.nq == 1:
                ours[:, k] = own.lowerPositionLimit[joint.idx_q], own.upperPositionLimit[joint.idx_q]
        ours[abs(ours) > ENDLESS] *= np.inf
        return theirs[0], theirs[1], ours[0], ours[1]

    def compensated(self, on: bool) -> tuple[list[str], Vector]:
        """Names of the robot's bodies in the model, and the shares of their weights that are compensated."""
        bodies = np.flatnonzero(self.link)
        return [self.model.body(body).name for body in bodies], self.model.body_gravcomp[bodies] * on

    def margins(self, link: NDArray[np.int64]) -> Vector:
        """(feet,) largest distance at which contacts of the feet's links with what is no part of the robot begin, m.

        Margins of two geoms add up, and MuJoCo holds the two that far apart.
        """
        model, found = self.model, np.zeros(link.shape[1])
        margin, own = model.geom_margin, self.link[model.geom_bodyid] != 0
        if model.opt.enableflags & self.mujoco.mjtEnableBit.mjENBL_OVERRIDE:
            margin = np.full(model.ngeom, 0.5 * model.opt.o_margin)
        kind, fits = model.geom_contype, model.geom_conaffinity
        for k in range(link.shape[1]):
            for geom in np.flatnonzero(link[:, k]):
                touched = ~own & ((kind & fits[geom] | kind[geom] & fits) != 0)
                found[k] = max(found[k], margin[geom] + margin[touched].max(initial=0.0))
                pairs = (model.pair_geom1 == geom) | (model.pair_geom2 == geom)
                found[k] = max(found[k], *model.pair_margin[pairs], 0.0)
        return found


def differences(here: AtZero, link: NDArray[np.int64], actuators: NDArray[np.int64]) -> str:
    """See :attr:`harpy_pin.simulation.mujoco.MujocoBridge.differences`.

    Args:
        here: model and robot.
        link: (geoms, feet) 1 where a geom is on the link of a foot.
        actuators: (joints,) those that drive the joints; none without any.
    """
    robot, data, joints, model = here.robot, here.data, here.joints, here.model
    links, hinges, base = ("the base", *robot.joints), robot.joints, robot.model.nv - len(joints)
    frames, bodies = list(here.own.oMi)[ROOT:], list(robot.model.inertias)[ROOT:]
    mass, centre, inertia = here.links()
    own = [frame.act(body) for frame, body in zip(frames, bodies, strict=True)]
    low, high, own_low, own_high = here.ends()
    on, place = _flags(here.mujoco, model), model.jnt_dofadr[joints]
    armature, damping = _with_actuators(model, joints)
    friction, peak = model.dof_frictionloss[place] * on["frictionloss"], peak_torques(model, joints)
    springs = np.column_stack((model.jnt_stiffness, model.jnt_stiffnesspoly))[joints] * on["spring"]
    hint = [
        _compared("armature", " kg·m²", hinges, armature, robot.model.armature[base:]),
        _compared("damping", " N·m·s/rad", hinges, damping[:, 0] * on["damper"], robot.model.damping[base:]),
        _compared("dry friction", " N·m", hinges, friction, robot.dry_friction),
        _compared("largest torque", " N·m", hinges, peak, robot.torque_limit),
    ]
    desired = np.fmin(peak, robot.torque_limit)
    reached = np.fmin(desired, _reached(here, actuators, on["clampctrl"]) if len(actuators) else np.inf)
    delays = model.actuator_delay[actuators] if len(actuators) else np.zeros(len(joints))
    gravity = model.opt.gravity if on["gravity"] else np.zeros(3)
    lines = [
        _compared("mass", " kg", links, mass, [body.mass for body in own]),
        _compared("centre of mass", " m", links, centre, [body.lever for body in own], LENGTH),
        _compared("inertia", " kg·m²", links, inertia, [body.inertia for body in own]),
        _compared("place of joint", " m", hinges, data.xanchor[joints], [m.translation for m in frames[1:]], LENGTH),
        _compared("axis of joint", "", hinges, data.xaxis[joints], here.axes(), ANGLE),
        *hint,
        "robot.with_mujoco(model) takes what the joints have in the model" if any(hint) else "",
        _compared("lower end of joint", " rad", hinges, low, own_low, ANGLE),
        _compared("upper end of joint", " rad", hinges, high, own_high, ANGLE),
        _compared("torque that ranges of control and force leave at the ends", " N·m", hinges, reached, desired),
        _named("further damping", "N·m·s²/rad²", hinges, damping[:, 1:] * on["damper"]),
        _named("spring", "N·m/rad", hinges, springs),
        _named("delay of the actuator", "s", hinges, delays),
        _named("compensated share of the weight", "", *here.compensated(on["gravity"])),
        _named("margin of the contacts, on which it hovers,", "m", robot.feet, here.margins(link)),
        _compared("gravity", " m/s²", ("the world",), gravity, robot.model.gravity.linear),
        *_settings(here, on),
    ]
    return "\n".join(line for line in lines if line)


def _flags(mujoco: Any, model: Any) -> dict[str, bool]:
    """Whether the parts of MuJoCo's step are on, by the names of ``<flag>``."""
    bits = {name.removeprefix("mjDSBL_").lower(): int(bit) for name, bit in mujoco.mjtDisableBit.__members__.items()}
    return {name: not model.opt.disableflags & bit for name, bit in bits.items()}


def enabled_actuators(model: Any) -> NDArray[np.bool_]:
    """(actuators,) whether they act."""
    on = np.array([not model.opt.disableactuator >> max(group, 0) & 1 for group in model.actuator_group.tolist()], bool)
    return on & (not model.opt.disableflags & ACTUATION)


def tendon_trees(model: Any, tendon: int) -> set[int]:
    """Roots of the trees that a tendon pulls at."""
    first, count = model.tendon_adr[tendon], model.tendon_num[tendon]
    bodies = []
    for kind, item in zip(model.wrap_type[first : first + count], model.wrap_objid[first : first + count], strict=True):
        if kind in OF_WRAP:
            bodies.append(getattr(model, OF_WRAP[kind])[item])
    return set(model.body_rootid[bodies].tolist())


def _with_actuators(model: Any, joints: NDArray[np.int64]) -> tuple[Vector, Vector]:
    """Armature (joints,), kg·m², and the three coefficients of damping (joints, 3), with those of the actuators."""
    place = model.jnt_dofadr[joints]
    armature, damping = model.dof_armature[place], np.column_stack((model.dof_damping, model.dof_dampingpoly))[place]
    of_actuators = np.column_stack((model.actuator_damping, model.actuator_dampingpoly))
    for k, joint in enumerate(joints):
        for n in np.flatnonzero((model.actuator_trntype <= 1) & (model.actuator_trnid[:, 0] == joint)):
            ratio = model.actuator_gear[model.actuator_outadr[n], 0] ** 2
            armature[k] += ratio * model.actuator_armature[n]
            damping[k] += ratio * of_actuators[n]
    return armature, damping


def _reached(here: AtZero, actuators: NDArray[np.int64], clamped: bool) -> Vector:
    """(joints,) torque in both directions that the actuators reach at rest at both ends of the joints, N·m.

    What cuts it off are the ranges of control, of the actuator's force and of the joint's.
    """
    model, joints, ends = here.model, here.joints, np.array(here.ends()[:2])
    control, output = model.actuator_ctrladr[actuators], model.actuator_outadr[actuators]
    ratio, gain = model.actuator_gear[output, 0], model.actuator_gainprm[actuators, 0]
    bias = np.where((model.actuator_biastype[actuators] == 1)[:, None], model.actuator_biasprm[actuators, :2], 0.0)
    angle = np.where(np.isfinite(ends), ends, 0.0)
    limits = (
        (model.actuator_ctrllimited[control] * clamped, model.actuator_ctrlrange[control]),
        (model.actuator_forcelimited[actuators], model.actuator_forcerange[actuators]),
        (model.jnt_actfrclimited[joints], model.jnt_actfrcrange[joints]),
    )
    ranges = [np.where(limited, bounds.T, INFINITE) for limited, bounds in limits]
    force = ranges[0][:, None] * gain + bias[:, 0] + bias[:, 1] * ratio * angle  # (2 controls, 2 angles, joints)
    torque = np.sort(ratio * np.clip(force, ranges[1][0], ranges[1][1]), axis=0)
    torque = np.clip(torque, ranges[2][0], ranges[2][1])
    return np.asarray(np.maximum(np.minimum(-torque[0], torque[1]).min(axis=0), 0.0))


def _settings(here: AtZero, on: dict[str, bool]) -> list[str]:
    """What a model's options do that a robot in this library does not know."""
    mujoco, model, lines = here.mujoco, here.model, []
    if model.opt.density or model.opt.viscosity:
        air = f"density {model.opt.density:g} kg/m³, viscosity {model.opt.viscosity:g} Pa·s, wind {model.opt.wind} m/s"
        lines.append(f"the air resists in the model: {air}")
    pulling = model.tendon_stiffness + model.tendon_damping + model.tendon_frictionloss + model.tendon_limited
    root = here.root
    tendons = [model.tendon(n).name for n in np.flatnonzero(pulling) if root in tendon_trees(model, int(n))]
    if tendons:
        lines.append(f"tendons pull at the robot in the model: {', '.join(tendons)}")
    for flag in ("contact", "constraint"):
        if not on[flag]:
            lines.append(f"the model has the flag {flag}='disable': nothing carries the feet")
    policy, tree = mujoco.mjtSleepPolicy, model.tree_sleep_policy[model.body_treeid[root]]
    never = (policy.mjSLEEP_NEVER, policy.mjSLEEP_AUTO_NEVER)
    if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP and tree not in [int(kind) for kind in never]:
        lines.append("the robot may sleep in the model, and then has no contacts: give its base sleep='never'")
    newton = model.opt.solver == mujoco.mjtSolver.mjSOL_NEWTON
    if newton and mujoco.mj_isSparse(model) and mujoco.__version__ == WRONG_IF_SPARSE:
        lines.append(f"Newton's solver is wrong with sparse Jacobians in MuJoCo {WRONG_IF_SPARSE}: jacobian='dense'")
    return lines


def _compared(
    what: str, unit: str, names: Sequence[str], theirs: ArrayLike, ours: ArrayLike, most: float | None = None
) -> str:
    """A line about the numbers, vectors or matrices that differ by more than ``most``, or by a share of their size."""
    if not names:
        return ""
    a, b = (np.asarray(values, np.float64).reshape(len(names), -1) for values in (theirs, ours))
    with np.errstate(invalid="ignore"):
        apart, size = np.linalg.norm(a - b, axis=1), np.fmax(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1))
        off = (a != b).any(axis=1) & ~(apart <= (SHARE * size + LEAST if most is None else most)) | np.isinf(apart)
    if not off.any():
        return ""
    worst = int(np.argmax(np.where(off, apart, -1.0)))
    pair = [_shown(x) for x in (a[worst], b[worst])]
    more = f"; and {int(off.sum()) - 1} more" if off.sum() > 1 else ""
    return f"{what} of {names[worst]}: {pair[0]}{unit} in the model, {pair[1]} in the robot{more}"


def _shown(x: Vector) -> str:
    """A number, a vector, or the size of a matrix."""
    return str(x.round(3)) if len(x) == 3 else f"{x[0] if len(x) == 1 else np.linalg.norm(x):.4g}"


def _named(what: str, unit: str, names: Sequence[str], values: Vector) -> str:
    """A line about what the model has and the robot has not; ``values`` (names,), or several numbers for each."""
    numbers = np.abs(np.asarray(values).reshape(len(names), -1)) if names else np.zeros((0, 1))
    has = numbers.max(axis=1) > LEAST
    if not has.any():
        return ""
    worst = int(np.argmax(numbers.max(axis=1)))
    given = ", ".join(f"{number:.4g}" for number in numbers[worst] if number > LEAST)
    more = f"; and {int(has.sum()) - 1} more" if has.sum() > 1 else ""
    return f"{what} of {names[worst]}: {given} {unit} in the model, none in the robot".replace("  ", " ") + more
