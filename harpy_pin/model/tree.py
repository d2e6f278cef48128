"""The robot's tree of joints and bodies as a record, for kernels that compute its rigid-body terms.

Pinocchio has read and checked the model; here its numbers are laid out flat. The root is a free
flyer; every other joint has one axis, about which it turns or along which it slides.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.errors import RobotError
from harpy_pin.model.loops import Coupling, Loops, driven_supports, joints_of
from harpy_pin.model.record import ZERO, RecordOf, Records, make_record, sized
from harpy_pin.model.state import Vector

REVOLUTE, UNBOUNDED, SLIDING = 0, 1, 2
"""Kinds of joints: an angle; cosine and sine of an angle; a displacement."""


class LoopsRecord(RecordOf):
    """Closed loops, and the joints that they move; every size is zero where there are none.

    In the shapes ``driven`` joints have motors, ``passive`` ones follow, and ``tied`` are both
    together. Equations have one row for each coordinate of a point, each length and each coupling.
    """

    body: NDArray[np.int64]  # (loops, 2) of the ends of each loop
    offset: Vector  # (loops, 2, 3) of these ends there, m
    top: NDArray[np.int64]  # (loops,) the last body that moves both
    length: Vector  # (loops,) distance of the ends, m; 0 where they are one point
    first_row: NDArray[np.int64]  # (loops,) of each among the equations
    coupling: NDArray[np.int64]  # (couplings, 2) joints, the one that follows and its leader
    ratio: Vector  # (couplings,)
    shift: Vector  # (couplings,) rad
    above: NDArray[np.int64]  # bodies on the ways to loops that no passive joint moves
    moved: NDArray[np.int64]  # the others on these ways, parents first
    beyond: NDArray[np.int64]  # all other bodies, parents first
    damping: Vector  # (passive,) of the passive joints, N·m·s/rad
    dry: Vector  # (passive,) their dry friction, N·m
    start: Vector  # (tied,) angles at which the loops are closed, rad
    q: Vector = sized("tied + 7")  # configuration of the tree: base, driven, passive
    v: Vector = sized("tied + 6")  # its velocity
    acceleration: Vector = sized("tied + 6")  # its acceleration
    closed: int = ZERO  # whether the loops are closed at q, and not at a dead point
    end: Vector = sized("loops", 2, 3)  # of each loop, base axes, m
    residual: Vector = sized("rows")  # of the equations, m or rad; then what is left to accelerate
    slope: Vector  # (rows, tied) its derivative
    reach: Vector = sized("tied")  # squares of how far a joint moves the ends of loops, m²
    normal: Vector = sized("passive", "passive")  # factor of AᵀA, A the columns of passive joints
    step: Vector = sized("passive")
    move: Vector = sized("driven")
    spread: Vector  # (tied, driven) velocities of all joints by those of the driven ones
    side: Vector = sized("passive", "driven")
    cross: Vector = sized("driven", "driven")
    mass_matrix: Vector = sized("whole", "whole")  # of the tree
    bias: Vector = sized("whole")


class TreeRecord(RecordOf):
    """Bodies and joints of a model: what is given, and what kernels work in.

    Bodies are numbered from the base, which is 0; a parent comes before its children. Positions and
    motions in "base axes" are relative to the base's origin. Passive joints come after all others
    in q and v of the tree.
    """

    parent: NDArray[np.int64]  # (bodies,) of each body
    kind: NDArray[np.int64]  # (bodies,) of the joint to its parent; see above
    place: NDArray[np.int64]  # (bodies,) of the joint's first number in q
    column: NDArray[np.int64]  # (bodies,) of the joint in v
    end: NDArray[np.int64]  # (bodies,) last entry of v that moves the body
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
    loops: LoopsRecord


def tree_record(model: pin.Model, loops: Loops | None = None) -> Records[TreeRecord]:
    """A new :class:`TreeRecord`.

    A :class:`RobotError` says that the root is no free flyer, or that a joint has several axes, or
    turns and slides; or turns without bounds where there are loops.
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
    place, column = (
        np.array([getattr(j, name) for j in joints], dtype=np.int64) for name in ("idx_q", "idx_v")
    )
    columns = np.arange(model.nv)
    if loops is not None:
        if UNBOUNDED in kinds:
            raise RobotError(f"a joint of '{model.name}', which has loops, turns without bounds")
        passive = [j - 1 for j in loops.passive]
        driven = np.setdiff1d(np.arange(1, bodies), passive)
        column[[*driven, *passive]] = 6 + np.arange(bodies - 1)
        place = np.where(column < 6, 0, column + 1)
        columns = np.array([*range(6), *(joints[i].idx_v for i in (*driven, *passive))])
    above = driven_supports(model, loops)[1:]
    return make_record(
        TreeRecord,
        {"bodies": bodies},
        parent=np.array([max(model.parents[j.id] - 1, 0) for j in joints], dtype=np.int64),
        kind=np.array(kinds, dtype=np.int64),
        place=place,
        column=column,
        end=np.array([column[path[-1] - 1] if path else 5 for path in above], dtype=np.int64),
        axis=np.array(axes),
        placement=np.array([placement.rotation for placement in placements]),
        origin=np.array([placement.translation for placement in placements]),
        mass=np.array([inertia.mass for inertia in inertias]),
        centre=np.array([inertia.lever for inertia in inertias]),
        inertia=np.array([inertia.inertia for inertia in inertias]),
        unbounded=np.int64(kinds.count(UNBOUNDED)),
        armature=np.array(model.armature)[columns],
        gravity=np.array(model.gravity.linear),
        axes=np.tile(np.eye(3), (bodies, 1, 1)),
        loops=_loops_record(model, loops, column),
    )


def _loops_record(
    model: pin.Model, loops: Loops | None, column: NDArray[np.int64]
) -> Records[LoopsRecord]:
    """A new :class:`LoopsRecord`, by the column of each body's joint."""
    ties = () if loops is None else loops.ties
    closing = [tie for tie in ties if not isinstance(tie, Coupling)]
    couplings = [tie for tie in ties if isinstance(tie, Coupling)]
    frames = [
        [model.frames[model.getFrameId(name)] for name in (tie.first, tie.second)]
        for tie in closing
    ]
    heights = [3 if tie.kind == "point" else 1 for tie in closing]
    above = [[set(model.supports[end.parentJoint]) for end in ends] for ends in frames]
    moved = [model.joints[j].idx_v for j in (() if loops is None else loops.passive)]
    passive = len(moved)
    tied = 0 if loops is None else model.njoints - 2
    first = np.cumsum((0, *heights))
    pairs = [[int(column[j - 1]) - 6 for j in joints_of(model, tie)] for tie in couplings]
    slope = np.zeros((first[-1] + len(couplings), tied))
    for row, (tie, pair) in enumerate(zip(couplings, pairs, strict=True), start=int(first[-1])):
        slope[row, pair] = 1.0, -tie.ratio
    start = np.zeros(tied)
    if loops is not None:
        start[column[1:] - 6] = loops.angles
    ways = {j - 1 for both in above for one in both for j in one if j > 1}
    follow = set() if loops is None else {*loops.passive}
    inside = {j - 1 for j in range(model.njoints) if follow & set(model.supports[j])}
    sizes = {"driven": tied - passive, "passive": passive, "tied": tied, "rows": len(slope)}
    sizes |= {"loops": len(closing)}
    return make_record(
        LoopsRecord,
        sizes | {"whole": tied + 6 if tied else 0},
        body=np.array([[end.parentJoint - 1 for end in ends] for ends in frames], np.int64).reshape(
            -1, 2
        ),
        offset=np.array([[end.placement.translation for end in ends] for ends in frames]).reshape(
            -1, 2, 3
        ),
        top=np.array([max(one & other) - 1 for one, other in above], np.int64),
        length=np.array([tie.length for tie in closing]),
        first_row=first[:-1].astype(np.int64),
        coupling=np.array(pairs, np.int64).reshape(-1, 2),
        ratio=np.array([tie.ratio for tie in couplings]),
        shift=np.array([tie.offset for tie in couplings]),
        above=np.array(sorted(ways - inside), np.int64),
        moved=np.array(sorted(ways & inside), np.int64),
        beyond=np.array(sorted({*range(1, tied + 1)} - ways), np.int64),
        damping=np.array([model.damping[k] for k in moved]),
        dry=np.array([model.upperDryFrictionLimit[k] for k in moved]),
        start=start,
        slope=slope,
        spread=np.eye(tied, tied - passive),
    )


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
