"""The tasks that every whole-body problem has, as instances of the classes that users add.

| weight | task | when |
|---|---|---|
| ``body`` | ``FrameTask`` of the base, position; or horizontally ``CentreOfMassTask`` | always |
| ``orientation`` | ``FrameTask`` of the base, orientation, local axes | always |
| ``swing`` | ``FrameTask`` of a foot, position | the foot is in swing |
| ``posture``, ``arms`` | ``JointTask`` of a joint that moves one foot, or of another one | always |
| ``force`` | ``FootForceTask`` of a foot, towards zero | the foot is in stance |

The targets say which of the two ``body`` is. A foot in stance has the ``FrameTask`` of its position
as a constraint: its error is zero. The weight ``thrust`` is on the inputs themselves, which are no
part of x = [a; f].

References are accelerations only: they are the arrays of
:class:`~harpy_pin.wbc.weights.WholeBodyTargets`, which a controller computes from its gait and
gains in every tick (:mod:`harpy_pin.controllers.tasks`). Rows and costs of these tasks are compiled
(:mod:`harpy_pin.wbc.full`, :mod:`harpy_pin.wbc.input_space`, :mod:`harpy_pin.wbc.condensed`);
``tests/wbc/test_built_in_tasks.py`` compares those costs with the tasks of this table.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from harpy_pin.arguments import checked
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.model.tree import feet_moved
from harpy_pin.wbc.tasks.task import FootForceTask, FrameTask, JointTask, MotionTask, Task
from harpy_pin.wbc.weights import WholeBodyTargets


@dataclass(frozen=True)
class BuiltInTask:
    """A task that every whole-body problem has.

    Attributes:
        weight: name of its weight in :class:`~harpy_pin.wbc.weights.WholeBodyWeights`.
        task: its rows.
        foot: index of the foot that it is for; None for a task that is always in the objective.
        stance: whether it is in the objective while that foot is in stance, or while it is in
            swing.
        share: (1,) number by which its weight is multiplied.
    """

    weight: str
    task: Task
    foot: int | None = None
    stance: bool = False
    share: Vector = field(default_factory=lambda: np.ones(1))

    def active(self, held: Vector) -> bool:
        """Whether it is in the objective.

        Args:
            held: (feet,) 1 where a foot is in stance, else 0.
        """
        return self.foot is None or bool(held[self.foot]) is self.stance


@checked
def built_in_tasks(robot: Robot, targets: WholeBodyTargets) -> list[BuiltInTask]:
    """The table above for a robot.

    Args:
        robot: any robot with a free base.
        targets: whose arrays are the tasks' references.
    """
    base = robot.model.names[1]
    orientation = FrameTask(base, part="orientation", axes="local")
    tasks = [
        BuiltInTask("body", _towards(FrameTask(base), targets.body)),
        BuiltInTask("orientation", _towards(orientation, targets.orientation)),
    ]
    for j, (joint, weight) in enumerate(zip(robot.joints, joint_weights(robot), strict=True)):
        task, share = (
            _towards(JointTask(joint), targets.joints[j : j + 1]),
            targets.joint_share[j : j + 1],
        )
        tasks.append(BuiltInTask(weight, task, share=share))
    for k, foot in enumerate(robot.feet):
        tasks.append(BuiltInTask("swing", _towards(FrameTask(foot), targets.feet[k]), k))
        tasks.append(BuiltInTask("force", FootForceTask(foot), k, stance=True))
    return tasks


def joint_weights(robot: Robot) -> list[str]:
    """Name of the weight of each joint's acceleration: ``posture`` where it moves one foot, else
    ``arms``.

    A waist between the base and several feet holds no foot where it should be: with the small
    weight of a leg nothing would hold it against the hips.
    """
    return [
        "posture" if moved == 1 else "arms" for moved in feet_moved(robot.model, robot.feet)[2:]
    ]


def _towards(task: MotionTask, acceleration: Vector) -> MotionTask:
    """The task with an array itself, not a copy, as its reference."""
    task.acceleration = acceleration
    return task
