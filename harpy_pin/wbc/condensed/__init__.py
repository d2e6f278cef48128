"""The condensed whole-body optimum: accelerations eliminated, and one equation in six unknowns for
the forces.
"""

from harpy_pin.wbc.condensed.condensed_solver import CondensedSolver, CondensedStatus
from harpy_pin.wbc.condensed.whole_body import WholeBodySolution, WholeBodySolver, WholeBodyStatus

__all__ = [
    "CondensedSolver",
    "CondensedStatus",
    "WholeBodySolution",
    "WholeBodySolver",
    "WholeBodyStatus",
]
