"""Closed loops and coupled joints in MuJoCo's models, and what these call joints and bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.errors import InputError, install_line
from harpy_pin.model.loops import Coupling, Loop, Tie
from harpy_pin.model.mjcf_options import enabled_actuators
from harpy_pin.model.state import Vector

JOINT_IN_PARENT = 1  # ``mujoco.mjtTrn``; a joint's own is 0
SITE = 3  # ``mujoco.mjtWrap``
WRAPPED = {1: "jnt_bodyid", 3: "site_bodyid", 4: "geom_bodyid", 5: "geom_bodyid"}
"""Bodies of what a tendon passes, by ``mujoco.mjtWrap``."""


def import_mujoco() -> Any:
    """The module ``mujoco``; an :class:`InputError` where it is not installed."""
    try:
        import mujoco
    except ImportError as error:
        raise InputError(
            f"no MuJoCo ({error}): {install_line('mujoco')}", name="plant", value="mujoco"
        ) from error
    return mujoco


def refuse_loops(model: Any, bodies: NDArray[np.int64]) -> None:
    """Refuse an active equality constraint on one of these bodies that is no loop of the robot."""
    for number in np.flatnonzero(model.eq_active0).tolist():
        kind = import_mujoco().mjtEq(model.eq_type[number]).name.removeprefix("mjEQ_").lower()
        held = np.isin(_tied_bodies(model, number, kind), bodies)
        if not held.any():
            continue
        loop = kind in ("connect", "joint", "tendon") and len(held) == 2 and bool(held.all())
        if kind == "tendon":
            first = model.tendon_adr[model.eq_obj1id[number]]
            loop &= bool(np.all(model.wrap_type[first : first + 2] == SITE))
        if kind != "connect":
            loop &= not model.eq_data[number, 2 if kind == "joint" else 1 : 5].any()
        if not loop:
            name = f" '{model.equality(number).name}'" if model.equality(number).name else ""
            message = f"the equality constraint <{kind}>{name} of the MuJoCo model holds the robot"
            raise InputError(
                f"{message} otherwise than a loop: supported are <connect> of two of its bodies, "
                "<joint>, linear, of two joints, and <tendon> of one tendon between two sites",
                name="model",
            )


def read_ties(
    model: Any, built: pin.Model, held: Mapping[int, tuple[int, pin.SE3]]
) -> tuple[Tie, ...]:
    """Loops and couplings of a MuJoCo model; frames of their ends are added to Pinocchio's.

    Args:
        model: ``mujoco.MjModel``, all of whose equality constraints :func:`refuse_loops` lets pass.
        built: Pinocchio's.
        held: of each body of the robot the joint that moves it, and its place in its frame.
    """
    kinds, found = import_mujoco().mjtEq, list[Tie]()
    acting = driven_joints(model)[enabled_actuators(model)]
    for number in np.flatnonzero(model.eq_active0).tolist():
        kind, data = model.eq_type[number], model.eq_data[number]
        ends = [int(model.eq_obj1id[number]), int(model.eq_obj2id[number])]
        word = kinds(kind).name.removeprefix("mjEQ_").lower()
        if not np.isin(_tied_bodies(model, number, word), [body for body in held if body]).any():
            continue
        if kind == kinds.mjEQ_JOINT:
            rest = [float(model.qpos0[model.jnt_qposadr[end]]) for end in ends]
            names, ratio = [joint_name(model, end) for end in ends], float(data[1])
            offset = rest[0] + float(data[0]) - ratio * rest[1]
            if ends[0] in acting and ends[1] in acting:
                raise InputError(
                    f"joints '{names[0]}' and '{names[1]}' are coupled and both have a motor, "
                    "which is not supported"
                )
            if ends[0] in acting and ratio != 0.0:
                names, ratio, offset = names[::-1], 1.0 / ratio, -offset / ratio
            found.append(Coupling(names[0], names[1], ratio, offset))
            continue
        sites, length = kind == kinds.mjEQ_TENDON, 0.0
        if sites:
            first = model.tendon_adr[ends[0]]
            length = float(model.tendon_length0[ends[0]] + data[0])
            ends = model.wrap_objid[first : first + 2].tolist()
        places = sites_at(model, ends) if sites else connected(model, number)
        names = [f"loop:{number}:{end}" for end in ("first", "second")]
        for name, (body, at) in zip(names, places, strict=True):
            joint, place = held[body]
            place = place * pin.SE3(np.eye(3), at)
            built.addFrame(pin.Frame(name, joint, place, pin.FrameType.OP_FRAME))
        found.append(Loop(names[0], names[1], "length" if length else "point", length))
    return tuple(found)


def connected(model: Any, number: int) -> list[tuple[int, Vector]]:
    """Body and place there of both ends of a ``<connect>``."""
    ends = [int(model.eq_obj1id[number]), int(model.eq_obj2id[number])]
    if model.eq_objtype[number] == int(import_mujoco().mjtObj.mjOBJ_SITE):
        return sites_at(model, ends)
    places = np.array(model.eq_data[number, :6]).reshape(2, 3)
    return list(zip(ends, places, strict=True))


def sites_at(model: Any, sites: Sequence[int]) -> list[tuple[int, Vector]]:
    """Body and place there of sites."""
    return [(int(model.site_bodyid[site]), np.array(model.site_pos[site])) for site in sites]


def _tied_bodies(model: Any, number: int, kind: str) -> Any:
    """Bodies that an equality constraint holds."""
    ends = np.array([end for end in (model.eq_obj1id[number], model.eq_obj2id[number]) if end >= 0])
    if kind == "joint":
        return model.jnt_bodyid[ends]
    if kind == "tendon":
        return [body for tendon in ends for body in tendon_bodies(model, tendon)]
    if kind.startswith("flex"):
        first = model.flex_vertadr[ends[0]]
        return model.flex_vertbodyid[first : first + model.flex_vertnum[ends[0]]]
    return (
        model.site_bodyid[ends]
        if model.eq_objtype[number] == int(import_mujoco().mjtObj.mjOBJ_SITE)
        else ends
    )


def tendon_bodies(model: Any, tendon: int) -> list[int]:
    """Bodies that a tendon passes."""
    wraps = slice(model.tendon_adr[tendon], model.tendon_adr[tendon] + model.tendon_num[tendon])
    passed = zip(model.wrap_type[wraps].tolist(), model.wrap_objid[wraps].tolist(), strict=True)
    return [int(getattr(model, WRAPPED[kind])[item]) for kind, item in passed if kind in WRAPPED]


def body_name(model: Any, number: int) -> str:
    """Name of a body; ``body_3`` of one without."""
    return str(model.body(number).name) or f"body_{number}"


def joint_name(model: Any, number: int) -> str:
    """Name of a joint; of one without, that of its body with ``_joint`` behind, and ``_joint_1``
    for its second.
    """
    body = int(model.jnt_bodyid[number])
    place = int(number) - int(model.body_jntadr[body])
    return (
        str(model.joint(number).name)
        or f"{body_name(model, body)}_joint{f'_{place}' if place else ''}"
    )


def driven_joints(model: Any) -> NDArray[np.int64]:
    """(actuators,) number of the joint that each actuator of a model drives; −1 where it drives
    something else.
    """
    return np.where(
        model.actuator_trntype <= JOINT_IN_PARENT, model.actuator_trnid[:, 0], -1
    ).astype(np.int64)
