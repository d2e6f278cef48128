"""The robot's tree of joints and bodies as a record, for kernels that compute its rigid-body terms.

Pinocchio has read and checked the model; here its numbers are laid out flat. The root is a free
flyer; every other joint has one axis, about which it turns or along which it slides.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.errors import RobotError
from harpy_pin.model.record import RecordOf, Records, make_record, sized
from harpy_pin.model.state import Vector

REVOLUTE, UNBOUNDED, SLIDING = 0, 1, 2
"""Kinds of joints: an angle; cosine and sine of an angle; a displacement."""


class TreeRecord(RecordOf):
    """Bodies and joints of a model: what is given, and what kernels work in.

    Bodies are numbered from the base, which is 0; a parent comes before its children. Positions and
    motions in "base axes" are relative to the base's origin.
    """

    parent: NDArray[np.int64]  # (bodies,) of each body
    kind: NDArray[np.int64]  # (bodies,) of the joint to its parent; see above
    place: NDArray[np.int64]  # (bodies,) of the joint's first number in q
    column: NDArray[np.int64]  # (bodies,) of the joint in v
    axis: Vector  # (bodies, 3) of the joint, in its own frame
    placement: (
        Vector  # (bodies, 3, 3) axes of the joint's frame in those of the parent body, at zero
    )
    origin: Vector  # (bodies, 3) of the joint's frame in the parent body's, m
    mass: Vector  # (bodies,) kg
    centre: Vector  # (bodies, 3) of mass, in the body's frame, m
    inertia: Vector  # (bodies, 3, 3) about the centre of mass, in the body's axes, kg m²
    unbounded: int  # joints of kind UNBOUNDED, by which q is longer
    armature: Vector  # (nv,) inertia of the rotors, kg m²
    gravity: Vector  # (3,) world axes, m/s²
    rotation: Vector = sized(3, 3)  # base axes to world
    axes: Vector  # (bodies, 3, 3) body axes to base axes
    position: Vector = sized("bodies", 3)  # of the body's frame, base axes, m
    # motion of unit joint velocity, linear (at the base's origin) and angular, base axes
    screw: Vector = sized("bodies", 6)
    twist: Vector = sized(
        "bodies", 6
    )  # velocity, linear (at the base's origin) and angular, base axes
    drift: Vector = sized(
        "bodies", 6
    )  # acceleration at zero joint acceleration, less gravity, in the same axes
    force: Vector = sized("bodies", 6)  # that gives the subtree of a body that acceleration
    moment: Vector = sized(
        "bodies", 4
    )  # mass of the subtree of a body, and mass times centre of mass
    composite: Vector = sized("bodies", 3, 3)  # inertia of the same about the base's origin


def tree_record(model: pin.Model) -> Records[TreeRecord]:
    """A new :class:`TreeRecord`.

    A :class:`RobotError` says that the root is no free flyer, or that a joint has several axes, or
    turns and slides.
    """
    joints = list(model.joints)[1:]
    if joints[0].shortname() != "JointModelFreeFlyer" or not model.jointPlacements[1].isIdentity(
        0.0
    ):
        raise RobotError(
            f"the root of '{model.name}' is not a free flyer with the base's own frame"
        )
    kinds, axes = zip(
        (REVOLUTE, np.zeros(3)), *(_axis(joint, model) for joint in joints[1:]), strict=True
    )
    bodies = len(joints)
    inertias = list(model.inertias)[1:]
    placements = list(model.jointPlacements)[1:]
    return make_record(
        TreeRecord,
        {"bodies": bodies},
        parent=np.array([max(model.parents[j.id] - 1, 0) for j in joints], dtype=np.int64),
        kind=np.array(kinds, dtype=np.int64),
        place=np.array([j.idx_q for j in joints], dtype=np.int64),
        column=np.array([j.idx_v for j in joints], dtype=np.int64),
        axis=np.array(axes),
        placement=np.array([placement.rotation for placement in placements]),
        origin=np.array([placement.translation for placement in placements]),
        mass=np.array([inertia.mass for inertia in inertias]),
        centre=np.array([inertia.lever for inertia in inertias]),
        inertia=np.array([inertia.inertia for inertia in inertias]),
        unbounded=np.int64(kinds.count(UNBOUNDED)),
        armature=np.array(model.armature),
        gravity=np.array(model.gravity.linear),
        axes=np.tile(np.eye(3), (bodies, 1, 1)),
    )


def feet_moved(model: pin.Model, feet: Sequence[str]) -> list[int]:
    """How many feet each of the model's joints moves, by Pinocchio's numbers; points on one link
    are one foot.

    A joint that moves one foot is of a leg; one that moves several, such as a waist, of none.

    Args:
        model: any.
        feet: names of frames.
    """
    ends = {model.frames[model.getFrameId(name)].parentJoint for name in feet}
    above = [j for end in ends for j in model.supports[end]]
    return [above.count(j) if j > 1 else 0 for j in range(model.njoints)]


def _axis(joint: Any, model: pin.Model) -> tuple[int, Vector]:
    """Kind and axis of a joint."""
    if joint.nv == 1 and joint.nq <= 2 and "Mimic" not in joint.shortname():
        data = joint.createData()
        joint.calc(data, pin.neutral(model))
        screw = np.array(data.S).reshape(6)
        if not screw[:3].any():
            return UNBOUNDED if joint.nq == 2 else REVOLUTE, screw[3:]
        if not screw[3:].any():
            return SLIDING, screw[:3]
    raise RobotError(
        f"joint '{model.names[joint.id]}' ({joint.shortname()}) of '{model.name}' is not "
        f"supported: "
        "a joint turns about one axis, or slides along one"
    )
