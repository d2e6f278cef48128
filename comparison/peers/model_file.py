"""A URDF of the numbers with which our controllers compute: masses and joints of their record,
contact points, soles.

Peers read this file, and nothing of the robot's own: what was changed since the robot was loaded is
in it, and meshes are not.
"""

import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import harpy_pin as hp
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import REVOLUTE, SLIDING, tree_record

BASE = "body_0"
"""Link of the base."""

_KINDS = {REVOLUTE: "revolute", SLIDING: "prismatic"}
_LIMITS = {"lower": "-100", "upper": "100", "effort": "1e9", "velocity": "1e9"}
"""Readers want some; torque limits are handed over as numbers."""


@dataclass(frozen=True)
class Links:
    """Names of links in the file, in the order of the robot's contact points, thrusters and flat
    feet.
    """

    contacts: list[str]
    thrusters: list[str]
    soles: list[str]  # in the middle of each flat foot; none where all feet are points


def links_of(robot: hp.Robot) -> Links:
    """Names of the links.

    Raises:
        RobotError: a flat foot has other than four corners, or there are points beside flat feet.
    """
    if robot.flat_feet and set(robot.flat_feet) != {4}:
        raise hp.RobotError("peers are given points, or soles of four corners")
    return Links(
        [f"contact_{k}" for k in range(len(robot.feet))],
        [f"thruster_{k}" for k in range(len(robot.thrusters))],
        [f"sole_{k}" for k in range(len(robot.flat_feet))],
    )


def sole_corners(robot: hp.Robot) -> Vector:
    """(soles, 4, 3) corners of each sole about its middle, in the axes of its link, m."""
    model, found = robot.model, []
    for n in range(len(robot.flat_feet)):
        corners = [
            model.frames[robot.frame_id(name)].placement for name in robot.feet[4 * n : 4 * n + 4]
        ]
        middle = np.mean([corner.translation for corner in corners], axis=0)
        found.append([corners[0].rotation.T @ (corner.translation - middle) for corner in corners])
    return np.array(found).reshape(-1, 4, 3)


def write_model(robot: hp.Robot, path: Path) -> None:
    """Write the file.

    Raises:
        RobotError: a joint that turns without end, or soles as :func:`links_of`.
    """
    tree: Any = tree_record(robot.model)[0]
    root = ElementTree.Element("robot", name=robot.name)
    for i in range(len(tree["mass"])):
        _add_body(root, f"body_{i}", tree["mass"][i], tree["centre"][i], tree["inertia"][i])
    for i, name in enumerate(robot.joints, start=1):
        kind = _KINDS.get(int(tree["kind"][i]))
        if kind is None:
            raise hp.RobotError(f"peers are given joints that end; '{name}' turns on")
        place = pin.SE3(tree["placement"][i], tree["origin"][i])
        joint = _add_joint(root, name, kind, f"body_{tree['parent'][i]}", f"body_{i}", place)
        ElementTree.SubElement(joint, "axis", xyz=_text(tree["axis"][i]))
        ElementTree.SubElement(joint, "limit", _LIMITS)
    links, model = links_of(robot), robot.model
    for name, frame in zip(
        links.contacts + links.thrusters, robot.feet + robot.thrusters, strict=True
    ):
        known = model.frames[robot.frame_id(frame)]
        _add_frame(root, name, known.parentJoint, known.placement)
    for n, name in enumerate(links.soles):
        corners = [model.frames[robot.frame_id(frame)] for frame in robot.feet[4 * n : 4 * n + 4]]
        middle = np.mean([corner.placement.translation for corner in corners], axis=0)
        _add_frame(
            root, name, corners[0].parentJoint, pin.SE3(corners[0].placement.rotation, middle)
        )
    ElementTree.ElementTree(root).write(path)


def _text(values: Vector) -> str:
    return " ".join(repr(float(value)) for value in values)


def _add_body(
    root: ElementTree.Element, name: str, mass: float, centre: Vector, inertia: Vector
) -> None:
    body = ElementTree.SubElement(ElementTree.SubElement(root, "link", name=name), "inertial")
    ElementTree.SubElement(body, "origin", xyz=_text(centre), rpy="0 0 0")
    ElementTree.SubElement(body, "mass", value=repr(float(mass)))
    moments = {
        f"i{'xyz'[a]}{'xyz'[b]}": repr(float(inertia[a, b])) for a in range(3) for b in range(a, 3)
    }
    ElementTree.SubElement(body, "inertia", moments)


def _add_joint(
    root: ElementTree.Element, name: str, kind: str, parent: str, child: str, place: pin.SE3
) -> ElementTree.Element:
    joint = ElementTree.SubElement(root, "joint", name=name, type=kind)
    turn = pin.rpy.matrixToRpy(place.rotation)
    ElementTree.SubElement(joint, "origin", xyz=_text(place.translation), rpy=_text(turn))
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    return joint


def _add_frame(root: ElementTree.Element, name: str, joint: int, place: pin.SE3) -> None:
    """Add a link without mass on the body behind a joint of the model."""
    ElementTree.SubElement(root, "link", name=name)
    _add_joint(root, f"{name}_joint", "fixed", f"body_{joint - 1}", name, place)
