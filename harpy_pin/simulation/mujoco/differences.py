"""What a MuJoCo model of a robot has otherwise than the robot: numbers at zero angles, side by
side.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from harpy_pin.errors import InputError
from harpy_pin.model.mjcf import build_tree, left_out, named, placement
from harpy_pin.model.mjcf_options import disabled, in_effect
from harpy_pin.model.mjcf_rods import BALL, HINGE, SLIDE, held_springs, hinge_names
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import SLIDING, tree_record

ROOT = 1  # index of the floating base's joint in Pinocchio's model
SHARE = 0.01  # share by which numbers may differ
LENGTH = 1e-3  # distance by which places may differ, m
ANGLE = 1e-2  # angle by which axes may differ, rad
MAX_TURN, MAX_SHIFT = 0.2, 0.05
"""Difference of axes, and distance, m, beyond which a joint has another direction, axis or zero."""
LEAST = 1e-6  # masses, inertias and friction below it are none
INFINITE = np.array([[-np.inf], [np.inf]])
ENDLESS = 1e3  # angles or lengths beyond it are no end of a joint
WRONG_IF_SPARSE = "4.0.0"  # MuJoCo whose Newton solver has a wrong Hessian with sparse Jacobians
LINKS = {"mass": (" kg", None), "centre of mass": (" m", LENGTH), "inertia": (" kg·m²", None)}
"""What is compared of the links: its unit, and by how much it may differ; None for
:data:`SHARE`.
"""
JOINTS = {
    "place of joint": (" m", LENGTH),
    "axis of joint": ("", ANGLE),
    "lower end of joint": (" rad", ANGLE),
    "upper end of joint": (" rad", ANGLE),
    "armature": (" kg·m²", None),
    "damping": (" N·m·s/rad", None),
    "dry friction": (" N·m", None),
    "largest torque": (" N·m", None),
}
"""The same of the joints."""
KNOWN = ("armature", "damping", "dry friction", "largest torque")
"""Of the joints what :meth:`~harpy_pin.model.robot.Robot.with_mujoco` takes from the model."""


class AtZero:
    """Model and robot with the base at the origin and all joints at zero.

    Attributes:
        model: without what its options disable.
        bodies: of the robot in the model.
        link: (bodies,) Pinocchio's index of the joint of the robot that moves each body, 0 for what
            is no part of it.
        theirs: numbers of the model's links and joints, in the robot's order.
        ours: of the robot's.
        names: of its joints, passive ones, too.
        resting: numbers of the model's joints that stiff springs hold.
        foot: (feet, 3) places of the feet, m.
    """

    def __init__(
        self, mujoco: Any, model: Any, robot: Robot, joints: NDArray[np.int64], free: int
    ) -> None:
        self.mujoco, self.robot, self.joints, self.model = mujoco, robot, joints, in_effect(model)
        self.names, kinds = tree_joints(robot), tree_record(robot.model)["kind"][0, 1:]
        for joint, name, kind in zip(joints, self.names, kinds, strict=True):
            rod = model.jnt_type[joint] == BALL and np.sum(joints == joint) == 2
            if not rod and model.jnt_type[joint] != (SLIDE if kind == SLIDING else HINGE):
                desired = "slide" if kind == SLIDING else "turn about one axis"
                raise InputError(
                    f"joint '{name}' of the MuJoCo model does not {desired}, as the robot's",
                    name="model",
                )
        self.bodies = np.flatnonzero(model.body_rootid == model.jnt_bodyid[free])
        self.built, self.held = built, held = build_tree(self.model, self.bodies, joints)
        names, data = hinge_names(model, joints), built.createData()
        of_tree = np.flatnonzero(np.isin(model.jnt_bodyid, self.bodies))
        self.resting = held_springs(self.model, np.setdiff1d(of_tree, joints))
        self.theirs = _numbers(built, data, names)
        numbers = {
            ROOT: ROOT,
            **{built.getJointId(name): ROOT + 1 + k for k, name in enumerate(names)},
        }
        self.link = np.zeros(model.nbody, np.int64)
        self._places = {
            body: data.oMi[joint] * place for body, (joint, place) in held.items() if body
        }
        for body in self._places:
            self.link[body] = numbers[held[body][0]]
        own = robot.model.createData()
        self.ours = _numbers(robot.model, own, self.names)
        pin.updateFramePlacements(robot.model, own)
        places = [own.oMf[robot.frame_id(name)].translation for name in robot.feet]
        self.foot: Vector = np.reshape(places, (-1, 3))

    def place(self, kind: str, number: int) -> pin.SE3:
        """Where a ``site`` or ``geom`` of the robot is."""
        position, quaternion = (
            getattr(self.model, f"{kind}_pos"),
            getattr(self.model, f"{kind}_quat"),
        )
        body = int(getattr(self.model, f"{kind}_bodyid")[number])
        return self._places[body] * placement(position[number], quaternion[number])

    def check_joints(self) -> None:
        """Refuse joints that do not turn or slide about the robot's axes, in its direction and from
        its zero.
        """
        for what, name, most in (
            ("axis or direction of joint", "axis of joint", MAX_TURN),
            ("place of joint", "place of joint", MAX_SHIFT),
            ("place of the link", "centre of mass", MAX_SHIFT),
        ):
            joints = slice(-len(self.joints), None)  # without the base
            if line := _compared(
                what, "", self.names, self.theirs[name][joints], self.ours[name][joints], most
            ):
                raise InputError(
                    f"the MuJoCo model has other joints than the robot: {line}", name="model"
                )

    def margins(self, link: NDArray[np.int64]) -> Vector:
        """(feet,) largest distance at which contacts of the feet's links with what is no part of
        the robot begin, m.

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


def _numbers(model: pin.Model, data: pin.Data, joints: Sequence[str]) -> dict[str, Any]:
    """What the base's link and those of some joints have, and these joints, in the axes of the base
    at zero angles.
    """
    pin.forwardKinematics(model, data, pin.neutral(model))
    numbers = [ROOT, *(model.getJointId(name) for name in joints)]
    frames, axes = [data.oMi[n] for n in numbers], tree_record(model)["axis"][0]
    links = [data.oMi[n].act(model.inertias[n]) for n in numbers]
    moving = [model.joints[n] for n in numbers[1:]]
    place, column = [joint.idx_q for joint in moving], [joint.idx_v for joint in moving]
    ends = np.array([model.lowerPositionLimit[place], model.upperPositionLimit[place]])
    endless = (np.abs(ends) > ENDLESS) | np.array([joint.nq > 1 for joint in moving], bool)
    lower, upper = np.where(endless, INFINITE, ends)
    return {
        "mass": [link.mass for link in links],
        "centre of mass": [link.lever for link in links],
        "inertia": [link.inertia for link in links],
        "place of joint": [frame.translation for frame in frames[1:]],
        "axis of joint": [
            frame.rotation @ axes[n - ROOT] for n, frame in zip(numbers, frames, strict=True)
        ][1:],
        "lower end of joint": lower,
        "upper end of joint": upper,
        "armature": model.armature[column],
        "damping": model.damping[column],
        "dry friction": model.upperDryFrictionLimit[column],
        "largest torque": model.effortLimit[column],
    }


def differences(here: AtZero, link: NDArray[np.int64], actuators: NDArray[np.int64]) -> str:
    """See :attr:`harpy_pin.simulation.mujoco.MujocoBridge.differences`.

    Args:
        here: model and robot.
        link: (geoms, feet) 1 where a geom is on the link of a foot.
        actuators: (joints,) those that drive the joints; none without any.
    """
    robot, theirs, ours = here.robot, here.theirs, here.ours
    compared = {what: ("the base", *here.names) for what in LINKS} | dict.fromkeys(
        JOINTS, here.names
    )
    lines = {
        what: _compared(what, unit, compared[what], theirs[what], ours[what], most)
        for what, (unit, most) in {**LINKS, **JOINTS}.items()
    }
    said = list(lines.values())
    if any(lines[what] for what in KNOWN):
        said.append("robot.with_mujoco(model) takes what the joints have in the model")
    if len(actuators):
        driven = np.array(robot.driven) - ROOT - 1
        desired = np.fmin(theirs["largest torque"][driven], robot.torque_limit)
        reached = np.fmin(desired, _reached(here, actuators, driven))
        what = "torque that ranges of control and force leave at the ends"
        said.append(_compared(what, " N·m", robot.joints, reached, desired))
    followers = [name for name in here.names if name not in robot.joints]
    gravity = here.model.opt.gravity, robot.model.gravity.linear
    said.append(_compared("gravity", " m/s²", ("the world",), *gravity))
    margins = named(
        "margin of the contacts, on which it hovers, of foot", robot.feet, here.margins(link), " m"
    )
    said += [
        f"the model has {what}"
        for what in (*left_out(here.model, here.bodies, here.joints, followers), margins)
        if what
    ]
    return "\n".join(line for line in (*said, *_settings(here)) if line)


def tree_joints(robot: Robot) -> tuple[str, ...]:
    """Names of all joints of a robot, passive ones, too."""
    return tuple(robot.model.names)[ROOT + 1 :]


def _reached(here: AtZero, actuators: NDArray[np.int64], driven: NDArray[np.int64]) -> Vector:
    """(joints,) torque in both directions that the actuators reach at rest at both ends of the
    joints, N·m.

    What cuts it off are the ranges of control, of the actuator's force and of the joint's.
    """
    model, joints = here.model, here.joints[driven]
    ends = np.array([here.theirs["lower end of joint"], here.theirs["upper end of joint"]])[
        :, driven
    ]
    control, output = model.actuator_ctrladr[actuators], model.actuator_outadr[actuators]
    ratio, gain = model.actuator_gear[output, 0], model.actuator_gainprm[actuators, 0]
    bias = np.where(
        (model.actuator_biastype[actuators] == 1)[:, None],
        model.actuator_biasprm[actuators, :2],
        0.0,
    )
    angle = np.where(np.isfinite(ends), ends, 0.0)
    limits = (
        (model.actuator_ctrllimited[control], model.actuator_ctrlrange[control]),
        (model.actuator_forcelimited[actuators], model.actuator_forcerange[actuators]),
        (model.jnt_actfrclimited[joints], model.jnt_actfrcrange[joints]),
    )
    ranges = [np.where(limited, bounds.T, INFINITE) for limited, bounds in limits]
    # (2 controls, 2 angles, joints)
    force = ranges[0][:, None] * gain + bias[:, 0] + bias[:, 1] * ratio * angle
    torque = np.sort(ratio * np.clip(force, ranges[1][0], ranges[1][1]), axis=0)
    torque = np.clip(torque, ranges[2][0], ranges[2][1])
    return np.asarray(np.maximum(np.minimum(-torque[0], torque[1]).min(axis=0), 0.0))


def _settings(here: AtZero) -> list[str]:
    """What a model's options do that a robot in this library does not know."""
    mujoco, model = here.mujoco, here.model
    off = sorted(disabled(model) & {"contact", "constraint"})
    lines = [f"the model has the flag {flag}='disable': nothing carries the feet" for flag in off]
    policy, tree = mujoco.mjtSleepPolicy, model.tree_sleep_policy[model.body_treeid[here.bodies[0]]]
    never = (policy.mjSLEEP_NEVER, policy.mjSLEEP_AUTO_NEVER)
    if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP and tree not in [
        int(kind) for kind in never
    ]:
        lines.append(
            "the robot may sleep in the model, and then has no contacts: give its base "
            "sleep='never'"
        )
    newton = model.opt.solver == mujoco.mjtSolver.mjSOL_NEWTON
    if newton and mujoco.mj_isSparse(model) and mujoco.__version__ == WRONG_IF_SPARSE:
        lines.append(
            f"Newton's solver is wrong with sparse Jacobians in MuJoCo {WRONG_IF_SPARSE}: "
            f"jacobian='dense'"
        )
    return lines


def _compared(
    what: str,
    unit: str,
    names: Sequence[str],
    theirs: ArrayLike,
    ours: ArrayLike,
    most: float | None = None,
) -> str:
    """A line about the numbers, vectors or matrices that differ by more than ``most``, or by a
    share of their size.
    """
    if not names:
        return ""
    a, b = (np.asarray(values, np.float64).reshape(len(names), -1) for values in (theirs, ours))
    with np.errstate(invalid="ignore"):
        apart, size = (
            np.linalg.norm(a - b, axis=1),
            np.fmax(np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)),
        )
        off = (a != b).any(axis=1) & ~(
            apart <= (SHARE * size + LEAST if most is None else most)
        ) | np.isinf(apart)
    if not off.any():
        return ""
    worst = int(np.argmax(np.where(off, apart, -1.0)))
    pair = [_shown(x) for x in (a[worst], b[worst])]
    more = f"; and {int(off.sum()) - 1} more" if off.sum() > 1 else ""
    return f"{what} of {names[worst]}: {pair[0]}{unit} in the model, {pair[1]} in the robot{more}"


def _shown(x: Vector) -> str:
    """A number, a vector, or the size of a matrix."""
    return str(x.round(3)) if len(x) == 3 else f"{x[0] if len(x) == 1 else np.linalg.norm(x):.4g}"
