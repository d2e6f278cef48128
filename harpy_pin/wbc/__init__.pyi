"""What ``harpy_pin.wbc`` offers; :mod:`lazy_loader` reads this file."""

from .condensed import WholeBodySolution, WholeBodySolver, WholeBodyStatus
from .formulations import FORMULATIONS, make_problem
from .problem import WholeBodyProblem
from .program import QPSolution, QPSolver, QPStatus, QuadraticProgram
from .solvers import SOLVERS, make_solver
from .tasks.added import AddedTask, AddedTasks
from .tasks.task import CentreOfMassTask, FootForceTask, FrameTask, JointTask, MomentumTask, Task
from .weights import WholeBodyLimits, WholeBodyTargets, WholeBodyWeights

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
