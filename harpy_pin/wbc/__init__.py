"""Whole-body control by quadratic programming: the problem is built apart from being solved."""

from harpy_pin.wbc.problem import WholeBodyLimits, WholeBodyProblem, WholeBodyTargets, WholeBodyWeights
from harpy_pin.wbc.solver import QPSolution, QPStatus, WarmProxQP

__all__ = [
    "QPSolution",
    "QPStatus",
    "WarmProxQP",
    "WholeBodyLimits",
    "WholeBodyProblem",
    "WholeBodyTargets",
    "WholeBodyWeights",
]
