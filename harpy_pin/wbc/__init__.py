"""Whole-body control by quadratic programming: the problem is built apart from being solved."""

from harpy_pin.wbc.backends.named import SOLVERS, installed_solvers, make_solver
from harpy_pin.wbc.formulations import FORMULATIONS, make_problem
from harpy_pin.wbc.problem import WholeBodyProblem
from harpy_pin.wbc.program import QuadraticProgram
from harpy_pin.wbc.settings import WholeBodyLimits, WholeBodyTargets, WholeBodyWeights
from harpy_pin.wbc.solver import QPSolution, QPSolver, QPStatus

__all__ = [
    "FORMULATIONS",
    "SOLVERS",
    "QPSolution",
    "QPSolver",
    "QPStatus",
    "QuadraticProgram",
    "WholeBodyLimits",
    "WholeBodyProblem",
    "WholeBodyTargets",
    "WholeBodyWeights",
    "installed_solvers",
    "make_problem",
    "make_solver",
]
