"""Tasks of a whole-body problem, one kind in each file: those that every problem has, and those that users add."""

from harpy_pin.wbc.tasks.added import AddedTask, AddedTasks
from harpy_pin.wbc.tasks.built_in import BuiltInTask, built_in_tasks
from harpy_pin.wbc.tasks.centroidal import CentreOfMassTask, MomentumTask
from harpy_pin.wbc.tasks.foot_force import FootForceTask
from harpy_pin.wbc.tasks.frame import FrameTask
from harpy_pin.wbc.tasks.joint import JointTask
from harpy_pin.wbc.tasks.task import MotionTask, Task

__all__ = [
    "AddedTask",
    "AddedTasks",
    "BuiltInTask",
    "CentreOfMassTask",
    "FootForceTask",
    "FrameTask",
    "JointTask",
    "MomentumTask",
    "MotionTask",
    "Task",
    "built_in_tasks",
]
