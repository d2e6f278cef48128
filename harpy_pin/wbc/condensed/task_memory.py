"""Tasks of one's own in the memory of a record, where kernels read them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.model.memory import move_array
from harpy_pin.model.record import Records, field, make_record
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.wbc.condensed.elimination import ROOT
from harpy_pin.wbc.condensed.tasks import FrameTasksRecord, JointTasksRecord, MomentumTasksRecord
from harpy_pin.wbc.tasks.task import CentreOfMassTask, FrameTask, JointTask, MomentumTask

AnyTask = FrameTask | JointTask | CentreOfMassTask | MomentumTask
REFERENCES = frozenset(("position", "rotation", "velocity", "acceleration", "momentum", "rate"))
"""Arrays of tasks that move into the record."""
KINDS = (FrameTask, JointTask, CentreOfMassTask, MomentumTask)


class TaskRecords(NamedTuple):
    """Records of tasks, the bodies of frames whose rows are on one path, those that other tasks are
    on, and the number of rows that are on two.
    """

    frames: Records[FrameTasksRecord]
    joints: Records[JointTasksRecord]
    momentum: Records[MomentumTasksRecord]
    filling: list[int]
    others: list[int]
    relative: int


def known_tasks(tasks: Sequence[object]) -> list[AnyTask]:
    """The tasks, if they are of kinds that are known, with one centre of mass and one angular
    momentum.
    """
    known: list[AnyTask] = []
    for task in tasks:
        if not isinstance(task, KINDS) or (
            isinstance(task, MomentumTask) and task.part != "angular"
        ):
            raise InputError(
                "tasks must be FrameTask, JointTask, CentreOfMassTask, or MomentumTask of the "
                f"angular part, got {shown(task)}",
                name="tasks",
                value=task,
            )
        if all(type(task).rows is not kind.rows for kind in KINDS):
            raise InputError(
                f"rows of one's own, as of {type(task).__name__}, are for the whole-body QP: "
                "here they are compiled, and references change in place",
                name="tasks",
                value=task,
            )
        known.append(task)
    for kind in (CentreOfMassTask, MomentumTask):
        if sum(isinstance(task, kind) for task in known) > 1:
            raise InputError(f"one {kind.__name__} at most", name="tasks")
    return known


def task_records(robot: Robot, tasks: Sequence[AnyTask], *, width: int) -> TaskRecords:
    """New records of tasks.

    Args:
        robot: any.
        tasks: of the kinds that :func:`known_tasks` lets pass.
        width: of the elimination's rows.

    Raises:
        InputError: unknown frames or joints.
    """
    model = robot.model
    framed = [task for task in tasks if isinstance(task, FrameTask)]
    frames = [model.frames[robot.frame_id(task.frame)] for task in framed]
    names = [joint for task in tasks if isinstance(task, JointTask) for joint in task.joints]
    for name in names:
        checks.one_of("joint", name, robot.joints)
    joints, (place, unbounded) = [robot.joints.index(name) for name in names], robot.layout
    columns = [ROOT + joint for joint in joints]
    bodies = [frame.parentJoint - 1 for frame in frames]
    on_root = [None if task.root is None else robot.frame_id(task.root) for task in framed]
    roots = [pin.Frame() if at is None else model.frames[at] for at in on_root]
    root_bodies = [-1 if at is None else model.frames[at].parentJoint - 1 for at in on_root]
    relative = [
        (n, row)
        for n, task in enumerate(framed)
        if task.root is not None
        for row in range(6)[task._rows]
    ]
    pairs = np.array(relative, dtype=np.int64).reshape(-1, 2).T.copy()
    sizes = {"frames": len(frames), "joint_rows": len(joints), "width": width, "nv": robot.nv}
    return TaskRecords(
        make_record(
            FrameTasksRecord,
            sizes,
            body=np.array(bodies, dtype=np.int64),
            offset=np.array([frame.placement.translation for frame in frames]).reshape(-1, 3),
            turn=np.array([frame.placement.rotation for frame in frames]).reshape(-1, 3, 3),
            local=np.array([task.axes == "local" for task in framed], dtype=np.int64),
            root=np.array(root_bodies, dtype=np.int64),
            root_offset=np.array([root.placement.translation for root in roots]).reshape(-1, 3),
            root_turn=np.array([root.placement.rotation for root in roots]).reshape(-1, 3, 3),
            relative_task=pairs[0],
            relative_row=pairs[1],
            rotation=np.tile(np.eye(3), (len(frames), 1, 1)),
        ),
        make_record(
            JointTasksRecord,
            sizes,
            column=np.array(columns, dtype=np.int64),
            place=place[joints],
            unbounded=unbounded[joints],
        ),
        make_record(MomentumTasksRecord, sizes),
        [body for body, at in zip(bodies, on_root, strict=True) if at is None],
        [
            *(robot.driven[joint] - 1 for joint in joints),
            *(body for n, _ in relative for body in (bodies[n], root_bodies[n])),
        ],
        len(relative),
    )


def adopt_tasks(
    tasks: Mapping[AnyTask, ArrayLike], record: Any, newton: Any
) -> dict[AnyTask, Vector]:
    """Move the tasks' references into a record, and write weights and gains there.

    Args:
        tasks: each with its weight, one number or one for each row.
        record: with the fields ``frames``, ``joints`` and ``momentum`` of :class:`TaskRecords`.
        newton: the record of the search.

    Returns:
        The weights of each task, (rows,).
    """
    found: dict[AnyTask, Vector] = {}
    frame, row = 0, 0
    for task, weight in tasks.items():
        arrays, rows = _arrays(record["momentum"][0]), slice(0, 3)
        first = 3 if isinstance(task, MomentumTask) else 0
        weights = field(newton, "momentum_weight")[first:]
        if isinstance(task, FrameTask):
            arrays, rows = _arrays(record["frames"][0], frame), task._rows
            frame, weights = frame + 1, arrays["weight"]
        elif isinstance(task, JointTask):
            arrays, rows = _arrays(record["joints"][0]), slice(row, row + len(task.joints))
            row, weights = rows.stop, arrays["weight"]
        found[task] = weights[rows]
        found[task][:] = checks.gains("weight", weight, len(found[task]))
        if isinstance(task, MomentumTask):
            arrays["gain"][:] = task.gain
        else:
            arrays["stiffness"][rows], arrays["damping"][rows] = task.gains
        for name in arrays.keys() & REFERENCES:
            given = getattr(task, name, None)
            if given is not None:
                place = arrays[name] if arrays[name].shape == given.shape else arrays[name][rows]
                place[:] = given
                move_array(task, name, place)
    return found


def _arrays(record: Any, index: int | None = None) -> dict[str, Vector]:
    """Views of what a record has of its tasks, or of one of them."""
    names = (REFERENCES | {"weight", "stiffness", "damping", "gain"}) & {*record.dtype.names}
    return {name: record[name] if index is None else record[name][index] for name in names}
