"""Robots in MuJoCo's format: files, by Pinocchio's own reader, and what a compiled model knows of joints.

Pinocchio reads bodies, joints with ``armature``, ``damping`` and ``frictionloss``, sites and keyframes. It ignores
equality constraints, actuators, the inertia of meshes and of geoms without contact, and a geom's mass that is its
class's: files that need these are refused, and torques are limited by a joint's ``actuatorfrcrange`` alone.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import tree_record
from harpy_pin.model.urdf import build_model, check_bodies, number_in, read_xml, robot_errors

FREE = 0  # ``mujoco.mjtJoint.mjJNT_FREE``


def build_any_model(path: Path) -> tuple[pin.Model, Vector | None]:
    """Pinocchio's model of a URDF or of an MJCF file, and the standing posture (joints,) where the file has one.

    Errors are those of :func:`harpy_pin.model.urdf.build_model`.
    """
    with robot_errors(path, "an MJCF file"):
        root = read_xml(path)
        if root.tag != "mujoco":
            return build_model(path), None
        _check_elements(root)
        model = pin.buildModelFromMJCF(str(path))
        if model.njoints < 2 or model.joints[1].shortname() != "JointModelFreeFlyer":
            raise InputError("its first body has no free joint")
        tree_record(model)
        check_bodies(model)
    keys = {entry.key(): np.array(entry.data()) for entry in model.referenceConfigurations}
    return model, keys["home"][7:] if "home" in keys else None


def _check_elements(root: ElementTree.Element) -> None:
    """Refuse what Pinocchio's reader would leave out or misread."""
    for kind in ("connect", "weld", "joint"):
        if any(equality.find(kind) is not None for equality in root.findall("equality")):
            raise InputError(f"it has the equality constraint <{kind}>: closed loops and couplings are not supported")
    if root.find("include") is not None:
        raise InputError("it includes other files, which are not read: give the robot's own file")
    for body in root.iter("body"):
        if body.find("inertial") is None and any("mesh" in geom.attrib for geom in body.findall("geom")):
            raise InputError(f"the inertia of body '{body.get('name')}' is that of a mesh, which is not read")
    _check_masses(root, {name: geom for tree in root.findall("default") for name, geom in _geoms_of(tree, {})}, "main")
    for element in root.iter():
        for name in ("mass", "armature", "damping", "frictionloss"):
            text = element.get(name)
            for part in (text or "").split() if element.tag in ("inertial", "geom", "joint") else ():
                checks.number(f"{name} in <{element.tag}>", number_in(part), low=0.0)
        if element.tag == "joint" and not element.get("axis", "0 0 1").strip(" 0.-"):
            raise InputError(f"axis of joint '{element.get('name')}' is zero")


def _geoms_of(tree: ElementTree.Element, inherited: Mapping[str, str]) -> Iterator[tuple[str, Mapping[str, str]]]:
    """Classes below a <default>, and what they say of geoms."""
    geom = tree.find("geom")
    own = {**inherited, **({} if geom is None else geom.attrib)}
    yield tree.get("class", "main"), own
    for child in tree.findall("default"):
        yield from _geoms_of(child, own)


def _check_masses(element: ElementTree.Element, classes: Mapping[str, Mapping[str, str]], usual: str) -> None:
    """Refuse masses of geoms that Pinocchio's reader leaves out, in bodies whose inertia is that of their geoms."""
    if element.get("mocap") == "true":  # no part of the robot
        return
    usual = element.get("childclass", usual)
    for geom in element.findall("geom") if element.tag == "body" and element.find("inertial") is None else ():
        of_class = classes.get(geom.get("class", usual), {})
        known = {"contype": "1", "conaffinity": "1", "density": "1000", **of_class, **geom.attrib}
        weighs = number_in(known.get("mass", known["density"])) != 0.0
        name = f"geom '{geom.get('name', '')}' of body '{element.get('name')}'"
        if weighs and number_in(known["contype"]) == number_in(known["conaffinity"]) == 0.0:
            raise InputError(f"{name} has a mass and no contact, which is not read: give the body an <inertial>")
        if weighs and "mass" in of_class and "mass" not in geom.attrib:
            raise InputError(f"the mass of {name} is that of its class, which is not read: give it a mass of its own")
    for child in element:
        if child.tag in ("worldbody", "body"):
            _check_masses(child, classes, usual)


def plain_name(name: str) -> str:
    """A name without the prefix of an attached model."""
    return re.split(r"[:/]", name)[-1]


def find_joints(model: Any, names: Sequence[str]) -> NDArray[np.int64]:
    """Numbers of joints in a ``mujoco.MjModel``, by their names without prefix.

    An :class:`InputError` says that it is no such model, has no free joint, lacks a joint, or has two of that name.
    """
    if not hasattr(model, "jnt_type"):
        raise InputError(f"model must be a mujoco.MjModel, got {shown(model)}", name="model", value=model)
    if FREE not in model.jnt_type:
        raise InputError("the MuJoCo model has no free joint: its base is fixed", name="model")
    found: dict[str, list[int]] = {}
    for number in range(model.njnt):
        if model.jnt_type[number] != FREE:
            name = str(model.joint(number).name)
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
    """Armature, kg·m², damping, N·m·s/rad, and dry friction, N·m, each (joints,), of joints of a MuJoCo model."""
    place = model.jnt_dofadr[joints]
    arrays = {"armature": model.dof_armature, "damping": model.dof_damping, "friction": model.dof_frictionloss}
    return {name: array[place] for name, array in arrays.items()}


def peak_torques(model: Any, joints: NDArray[np.int64]) -> Vector:
    """(joints,) largest torques of joints, N·m: of their ranges and of their actuators; infinite without limits.

    Limits of an actuator are ``forcerange``, and ``ctrlrange`` times the gain where its force is that product, both
    times ``gear``; those of several on a joint add up.
    """
    peak = np.full(len(joints), np.inf)
    for k, joint in enumerate(joints):
        forces = []
        for number in np.flatnonzero((model.actuator_trntype <= 1) & (model.actuator_trnid[:, 0] == joint)):
            limits = [np.inf]
            if model.actuator_forcelimited[number]:
                limits.append(abs(model.actuator_forcerange[number]).max())
            if (
                model.actuator_ctrllimited[number]
                and model.actuator_biastype[number] == 0
                and model.actuator_gaintype[number] == 0
            ):
                limits.append(abs(model.actuator_ctrlrange[number] * model.actuator_gainprm[number, 0]).max())
            forces.append(abs(model.actuator_gear[number, 0]) * min(limits))
        if forces:
            peak[k] = sum(forces)
        if model.jnt_actfrclimited[joint]:
            peak[k] = min(peak[k], abs(model.jnt_actfrcrange[joint]).max())
    return peak
