"""How a robot is eliminated: which limbs their feet determine, and the tree of all other joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from harpy_pin.errors import InputError
from harpy_pin.model.loops import driven_supports
from harpy_pin.model.record import Records, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.wbc.condensed.elimination import ROOT, EliminationRecord
from harpy_pin.wbc.condensed.gait_tasks import FeetRecord
from harpy_pin.wbc.condensed.limbs import LimbsRecord
from harpy_pin.wbc.condensed.limits import LimitsRecord
from harpy_pin.wbc.weights import WholeBodyLimits

_JOINTS = {1: 3}
"""Joints of a limb that its foot determines, by the contact points of the foot; else six."""


def foot_bodies(robot: Robot) -> NDArray[np.int64]:
    """(feet,) bodies to which the feet are fixed, points or soles; the base is 0.

    Raises:
        InputError: a foot is fixed to the base.
    """
    firsts = np.cumsum((0, *robot.corners))[:-1]
    frames = [robot.model.frames[robot.frame_id(robot.feet[first])] for first in firsts]
    bodies = np.array([frame.parentJoint - 1 for frame in frames], dtype=np.int64)
    if 0 in bodies:
        raise InputError(
            "a foot on the base itself is not supported: no joint moves it", name="robot"
        )
    return bodies


def determined_limbs(robot: Robot, task_bodies: Sequence[int] = ()) -> dict[int, list[int]]:
    """Columns of the joints of each limb that its foot determines, by the number of the foot.

    Its joints move no other foot and no body with a task, and there are as many as the foot has
    directions. All of them have feet of one kind: that of the first.

    Args:
        robot: any.
        task_bodies: that tasks are on.
    """
    bodies, above = foot_bodies(robot), driven_supports(robot.model, robot.loops)
    moved = np.zeros(robot.model.njoints, dtype=np.int64)
    for body in (*bodies, *task_bodies):
        moved[[*above[int(body) + 1]]] += 1
    limbs: dict[int, list[int]] = {}
    for foot, (body, points) in enumerate(zip(bodies, robot.corners, strict=True)):
        chain = list(above[int(body) + 1])
        alike = all(robot.corners[other] == points for other in limbs)
        if len(chain) == _JOINTS.get(points, 6) and all(moved[chain] == 1) and alike:
            limbs[foot] = [ROOT + robot.driven.index(joint) for joint in chain]
    return limbs


def limbs_record(
    robot: Robot, limbs: dict[int, list[int]], *, relative: int
) -> Records[LimbsRecord]:
    """A new :class:`LimbsRecord` of what :func:`determined_limbs` found, with a number of rows of
    relative tasks.
    """
    points = robot.corners[next(iter(limbs))] if limbs else 1
    firsts = np.cumsum((0, *robot.corners))
    joints = _JOINTS.get(points, 6)
    sizes = {**robot.sizes, "limbs": len(limbs), "j": joints, "r": 3 * points}
    sizes["relative"] = relative
    beside = [
        point
        for foot in range(len(robot.corners))
        if foot not in limbs
        for point in range(firsts[foot], firsts[foot + 1])
    ]
    return make_record(
        LimbsRecord,
        sizes,
        joint=np.array([*limbs.values()], dtype=np.int64).reshape(-1, joints),
        foot=firsts[[*limbs]].astype(np.int64),
        beside=np.array(beside, dtype=np.int64),
    )


def feet_record(
    robot: Robot, feet: Sequence[int], first_row: NDArray[np.int64]
) -> Records[FeetRecord]:
    """A new :class:`FeetRecord`, of feet by number.

    Raises:
        InputError: a foot has another number of contact points than one or four.
    """
    bodies, firsts = foot_bodies(robot), np.cumsum((0, *robot.corners))
    widest = max((robot.corners[foot] for foot in feet), default=1)
    basis = np.zeros((len(feet), 6, 3 * widest))
    for own, foot in zip(basis, feet, strict=True):
        names = robot.feet[firsts[foot] : firsts[foot + 1]]
        place = np.array(
            [robot.model.frames[robot.frame_id(name)].placement.translation for name in names]
        )
        if len(place) == 1:
            own[:3, :3] = np.eye(3)
        else:
            motions = np.vstack([np.hstack((np.eye(3), -pin.skew(p))) for p in place])
            own[:, : len(motions)] = np.linalg.qr(motions)[0].T
    return make_record(
        FeetRecord,
        body=bodies[[*feet]],
        foot=firsts[[*feet]].astype(np.int64),
        points=np.array([robot.corners[foot] for foot in feet], dtype=np.int64),
        first_row=first_row,
        basis=basis,
    )


def tree_paths(robot: Robot) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Depth (nv,) of each degree of freedom, and (nv, largest depth + 1) those from the root to
    it.
    """
    above, driven, root = driven_supports(robot.model, robot.loops), robot.driven, list(range(ROOT))
    paths = [root[: column + 1] for column in root]
    for joint in driven:
        chain = next(chain for chain in above if joint in chain)
        paths.append([*root, *(ROOT + driven.index(j) for j in chain if j <= joint)])
    path = np.zeros((len(paths), max(map(len, paths))), dtype=np.int64)
    for column, entries in enumerate(paths):
        path[column, : len(entries)] = entries
    return np.array([len(entries) - 1 for entries in paths], dtype=np.int64), path


def last_columns(robot: Robot) -> NDArray[np.int64]:
    """(bodies,) last degree of freedom that moves each body."""
    above = driven_supports(robot.model, robot.loops)[1:]
    last = [ROOT + robot.driven.index(chain[-1]) if chain else ROOT - 1 for chain in above]
    return np.array(last, dtype=np.int64)


def elimination_record(
    robot: Robot, limbs: dict[int, list[int]], *, task_bodies: Sequence[int] = (), relative: int = 0
) -> tuple[Records[EliminationRecord], NDArray[np.int64]]:
    """A new :class:`EliminationRecord`, and the first row of each foot on none of the limbs.

    Args:
        robot: any.
        limbs: that are eliminated before.
        task_bodies: that tasks of frames are on.
        relative: rows of relative tasks.
    """
    depth, path = tree_paths(robot)
    before = {column for columns in limbs.values() for column in columns}
    order = np.array([k for k in range(ROOT, len(depth)) if k not in before], dtype=np.int64)
    feet = [foot for foot in range(len(robot.corners)) if foot not in limbs]
    last = last_columns(robot)
    ends = last[foot_bodies(robot)[feet]]
    starts = path[ends, ROOT] if feet else ends  # first joint of the branch of each foot
    branches = [int(k) for k in np.unique(starts)]
    first, first_row = np.zeros(len(feet), dtype=np.int64), [0]
    row_end: list[int] = []
    for branch in branches:
        for foot in np.flatnonzero(starts == branch):
            first[foot] = len(row_end)
            row_end += [ends[foot]] * (3 if robot.corners[feet[foot]] == 1 else 6)
        first_row.append(len(row_end))
    filled = np.zeros(len(depth), dtype=np.int64)
    for body in task_bodies:
        end = last[body]
        filled[path[end, : depth[end] + 1]] = 1
    on = [
        branches.index(path[k, ROOT]) if depth[k] >= ROOT and path[k, ROOT] in branches else -1
        for k in range(len(depth))
    ]
    width = int(depth[order].max(initial=ROOT - 1)) + 1
    system = make_record(
        EliminationRecord,
        {**robot.sizes, "width": width, "rows": len(row_end), "relative": relative},
        order=order,
        depth=depth,
        path=np.ascontiguousarray(path[:, :width]),
        filled=filled,
        branch=np.array(on, dtype=np.int64),
        first_row=np.array(first_row, dtype=np.int64),
        row_end=np.array(row_end, dtype=np.int64),
    )
    return system, first


def limits_record(
    robot: Robot, limits: WholeBodyLimits, *, period: float = 0.0, deceleration: float = 100.0
) -> Records[LimitsRecord]:
    """A new :class:`LimitsRecord`; velocities and positions are not limited without a period."""
    torque, (place, unbounded) = limits.torque_scale * robot.torque_limit, robot.layout
    ends = np.column_stack((robot.joint_lower[place - 7], robot.joint_upper[place - 7]))
    ends[unbounded != 0] = -np.inf, np.inf
    return make_record(
        LimitsRecord,
        robot.sizes,
        torque_range=np.column_stack((-torque, torque)),
        acceleration_range=np.full(ends.shape, (-np.inf, np.inf)),
        place=place,
        position_range=ends,
        velocity_limit=robot.velocity_limit,
        period=period,
        deceleration=deceleration,
    )
