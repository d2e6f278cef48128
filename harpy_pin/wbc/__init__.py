"""Whole-body control by quadratic programming: the problem is built apart from being solved."""

from harpy_pin.wbc.condensed import WholeBodySolution, WholeBodySolver, WholeBodyStatus
from harpy_pin.wbc.formulations import FORMULATIONS, make_problem
from harpy_pin.wbc.problem import WholeBodyProblem
from harpy_pin.wbc.program import QPSolution, QPSolver, QPStatus, QuadraticProgram
from harpy_pin.wbc.solvers import SOLVERS, make_solver
from harpy_pin.wbc.tasks.added import AddedTask, AddedTasks
from harpy_pin.wbc.tasks.task import (
    CentreOfMassTask,
    FootForceTask,
    FrameTask,
    JointTask,
    MomentumTask,
    Task,
)
from harpy_pin.wbc.weights import WholeBodyLimits, WholeBodyTargets, WholeBodyWeights

__all__ = [
    "FORMULATIONS",
    "SOLVERS",
    "AddedTask",
    "AddedTasks",
    "CentreOfMassTask",
    "FootForceTask",
    "FrameTask",
    "JointTask",
    "MomentumTask",
    "QPSolution",
    "QPSolver",
    "QPStatus",
    "QuadraticProgram",
    "Task",
    "WholeBodyLimits",
    "WholeBodyProblem",
    "WholeBodySolution",
    "WholeBodySolver",
    "WholeBodyStatus",
    "WholeBodyTargets",
    "WholeBodyWeights",
    "make_problem",
    "make_solver",
]
