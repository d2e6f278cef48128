"""Closed loops and coupled joints: what ties the joints of a robot's tree to each other.

A loop holds two points of the tree together, or a fixed distance apart, as a rod does; a coupling
makes one joint a linear function of another. Joints without a motor that they move are *passive*. A
configuration of a robot has the driven joints alone, and the passive ones follow from them, by
Gauss–Newton from angles at which the loops are known to be closed: along the straight way from
there, so that a linkage never changes to its other assembly. Velocities follow by v_tree = T v.

Here loops are read and checked, on Pinocchio; :mod:`harpy_pin.model.closure` closes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from harpy_pin import checks
from harpy_pin.errors import InputError, RobotError, shown
from harpy_pin.model.state import Vector

KINDS = ("point", "length")
JUMP = 0.2
"""Largest change of a driven joint from which the passive ones are searched at once, rad."""
ITERATIONS = 20
"""Most iterations of a search."""
CLOSED = 1e-9
"""Residual of loops that are closed, m and rad."""
RANK = 1e-6
"""Singular values below this share of the largest count as none."""


@dataclass(frozen=True)
class Loop:
    """Two frames whose origins are one point, or a fixed distance apart.

    Attributes:
        first: name of a frame.
        second: name of the other one.
        kind: ``"point"`` or ``"length"``.
        length: distance of a ``"length"``, m.
    """

    first: str
    second: str
    kind: str = "point"
    length: float = 0.0


@dataclass(frozen=True)
class Coupling:
    """A joint that is at ``ratio`` times the angle of another one, and an offset.

    Attributes:
        joint: name of the joint that follows.
        leader: name of the joint that it follows.
        ratio: of the two.
        offset: rad.
    """

    joint: str
    leader: str
    ratio: float = 1.0
    offset: float = 0.0


Tie = Loop | Coupling


@dataclass(frozen=True, eq=False)
class Loops:
    """The ties of a robot's joints.

    Attributes:
        ties: loops and couplings.
        passive: Pinocchio's numbers of the joints that they move.
        angles: (all joints,) at which the loops are closed, in the model's order, rad.
    """

    ties: tuple[Tie, ...]
    passive: tuple[int, ...]
    angles: Vector


def read_loops(given: Any, model: pin.Model) -> tuple[Loop, ...]:
    """Loops as :func:`~harpy_pin.model.loading.load_robot` takes them: triples of two frames and a
    kind.

    A length is that at zero angles.
    """
    data, found = model.createData(), []
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    for entry in given:
        if isinstance(entry, str) or not isinstance(entry, Sequence) or len(entry) != 3:
            raise InputError(
                f"a loop must be (frame, frame, kind), got {shown(entry)}", name="loops"
            )
        first, second, kind = entry
        for name in (first, second):
            checks.one_of("frame of a loop", name, [frame.name for frame in model.frames])
        checks.one_of("kind of loop", kind, KINDS)
        ends = [data.oMf[model.getFrameId(name)].translation for name in (first, second)]
        length = float(np.linalg.norm(ends[0] - ends[1])) if kind == "length" else 0.0
        if kind == "length" and length < CLOSED:
            raise InputError(
                f"the loop of '{first}' and '{second}' has no length: they are one point",
                name="loops",
            )
        found.append(Loop(first, second, kind, length))
    return tuple(found)


def joints_of(model: pin.Model, tie: Tie) -> list[int]:
    """Pinocchio's numbers of the joints that a tie ties: of a loop those on its way round.

    An :class:`InputError` says that it ties the robot to the world, or nothing.
    """
    if isinstance(tie, Coupling):
        return [model.getJointId(name) for name in (tie.joint, tie.leader)]
    ends = [model.frames[model.getFrameId(name)].parentJoint for name in (tie.first, tie.second)]
    where = f"the loop of '{tie.first}' and '{tie.second}'"
    if 0 in ends:
        raise InputError(f"{where} holds the robot to the world: its base must float", name="loops")
    around = set(model.supports[ends[0]]) ^ set(model.supports[ends[1]])
    if not around:
        raise InputError(f"{where} has no joint: both are on one link", name="loops")
    return sorted(around)


def residual_of(model: pin.Model, ties: Sequence[Tie], q: Vector) -> tuple[Vector, Vector]:
    """How far ties are from being closed (rows,), m and rad, and the derivative (rows, nv) by the
    tree's velocity; three rows of a point, one of a length or a coupling.
    """
    data, rows, slopes = model.createData(), list[Any](), list[Any]()
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    for tie in ties:
        if isinstance(tie, Coupling):
            joints = [model.joints[model.getJointId(name)] for name in (tie.joint, tie.leader)]
            rows.append([q[joints[0].idx_q] - tie.ratio * q[joints[1].idx_q] - tie.offset])
            slope = np.zeros((1, model.nv))
            slope[0, joints[1].idx_v], slope[0, joints[0].idx_v] = -tie.ratio, 1.0
        else:
            frames = [model.getFrameId(name) for name in (tie.first, tie.second)]
            apart = data.oMf[frames[0]].translation - data.oMf[frames[1]].translation
            jacobians = [
                pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:3]
                for frame in frames
            ]
            slope = jacobians[0] - jacobians[1]
            if tie.kind == "length":
                slope = (apart @ slope / tie.length)[None]
                apart = [0.5 * (apart @ apart - tie.length**2) / tie.length]
            rows.append(apart)
            # What moves both ends alike moves none against the other.
            others = [j for j in range(1, model.njoints) if j not in joints_of(model, tie)]
            for joint in others:
                slope[:, model.joints[joint].idx_v :][:, : model.joints[joint].nv] = 0.0
        slopes.append(slope)
    return np.concatenate(rows), np.vstack(slopes)


def _search(model: pin.Model, loops: Loops, q: Vector) -> float:
    """Move the passive joints of a configuration of the tree, in place, until the loops are closed;
    returns how far they are from it.
    """
    joints = [model.joints[j] for j in loops.passive]
    place, column = [joint.idx_q for joint in joints], [joint.idx_v for joint in joints]
    for _ in range(ITERATIONS):
        residual, slope = residual_of(model, loops.ties, q)
        step = np.linalg.lstsq(slope[:, column], residual, rcond=RANK)[0]
        q[place] -= np.clip(step, -0.5, 0.5)
        if np.abs(step).max() < 1e-12:
            break
    return float(np.abs(residual_of(model, loops.ties, q)[0]).max())


def start_angles(model: pin.Model, *known: Vector | None) -> Vector:
    """(all joints,) from which closed loops are searched: those of the file, or zero or the next
    limit.
    """
    for angles in known:
        if angles is not None:
            return angles
    return np.asarray(np.clip(0.0, model.lowerPositionLimit[7:], model.upperPositionLimit[7:]))


def find_loops(
    model: pin.Model, ties: Sequence[Tie], undriven: Sequence[int], angles: Vector
) -> Loops:
    """The ties with the joints that they move, closed.

    Args:
        model: the tree.
        ties: loops and couplings.
        undriven: Pinocchio's numbers of the joints without a motor.
        angles: (all joints,) from which the search for closed loops begins; those of driven joints
            stay.

    Raises:
        InputError: a tie ties nothing, or the robot to the world.
        RobotError: the loops do not close, leave a joint without a motor free, or hold a driven
            one.
    """
    followers = {model.getJointId(tie.joint) for tie in ties if isinstance(tie, Coupling)}
    around = {joint for tie in ties for joint in joints_of(model, tie)}
    passive = tuple(sorted(followers | (around & {*undriven})))
    loops, q = Loops(tuple(ties), passive, angles), np.append(pin.neutral(model)[:7], angles)
    if not passive:
        raise RobotError(
            f"the loops of '{model.name}' move no joint: each needs joints without a motor, "
            "whose effort is 0, or which have no actuator"
        )
    left = _search(model, loops, q)
    residual, slope = residual_of(model, ties, q)
    column = [model.joints[j].idx_v for j in passive]
    if not left < CLOSED:
        worst, tie = 0, ties[0]
        for tie in ties:
            worst += 1 if isinstance(tie, Coupling) or tie.kind == "length" else 3
            if worst > int(np.argmax(np.abs(residual))):
                break
        what = (
            f"the coupling of joint '{tie.joint}'"
            if isinstance(tie, Coupling)
            else f"the loop of '{tie.first}' and '{tie.second}'"
        )
        raise RobotError(
            f"{what} of '{model.name}' does not close where the robot stands, with all its other "
            f"loops: {left:.2g} m or rad are left"
        )
    size, way = np.linalg.svd(slope[:, column])[1:]
    rank = int(np.sum(size > RANK * max(size[0], 1.0)))
    if rank < len(passive):
        loose = passive[int(np.argmax(np.abs(way[-1])))]
        raise RobotError(
            f"no loop of '{model.name}' holds joint '{model.names[loose]}' where the robot stands: "
            "it needs a motor, a stiffer spring, or other angles to begin with"
        )
    rest = slope - slope[:, column] @ np.linalg.lstsq(slope[:, column], slope, rcond=RANK)[0]
    if np.abs(rest).max() > RANK:
        held = int(np.argmax(np.abs(rest).max(axis=0)))
        name = next(model.names[j.id] for j in list(model.joints)[1:] if j.idx_v == held)
        raise RobotError(
            f"the loops of '{model.name}' leave its motor at '{name}' no motion: they contradict "
            "each other, or there are too many motors on their way round (effort 0 says that a "
            "joint has none)"
        )
    return Loops(tuple(ties), passive, np.array(q[7:]))


def driven_supports(model: pin.Model, loops: Loops | None) -> list[tuple[int, ...]]:
    """Of each joint of Pinocchio's the driven joints that may move it, from the base on.

    Without loops they are its ancestors. Joints that one loop ties move whatever is on it. They are
    put one above the other, as an elimination tree has them: so the mass matrix of the driven
    joints has no entry but between a joint and its ancestors.
    """
    if loops is None:
        return [tuple(above)[2:] for above in model.supports]
    tied: dict[int, set[int]] = {j: {j} for j in range(2, model.njoints)}
    for tie in loops.ties:
        around = set().union(*(tied[j] for j in joints_of(model, tie)))
        for joint in around:
            tied[joint] = around
    moved_by = [
        {
            other
            for j in list(above)[2:]
            for other in (tied[j] if j in loops.passive else {j})
            if other not in loops.passive
        }
        for above in model.supports
    ]
    lower: dict[int, set[int]] = {j: set() for joints in moved_by for j in joints}
    for joints in moved_by:
        for joint in joints:
            lower[joint] |= {other for other in joints if other < joint}
    for joint in sorted(lower, reverse=True):
        if lower[joint]:
            parent = max(lower[joint])
            lower[parent] |= lower[joint] - {parent}
    path: dict[int, tuple[int, ...]] = {}
    for joint in sorted(lower):
        path[joint] = (*path.get(max(lower[joint], default=0), ()), joint)
    return [path[max(joints)] if joints else () for joints in moved_by]
