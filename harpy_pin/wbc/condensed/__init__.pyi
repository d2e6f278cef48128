"""What ``harpy_pin.wbc.condensed`` offers; :mod:`lazy_loader` reads this file."""

from .condensed_solver import CondensedSolver, CondensedStatus
from .whole_body import WholeBodySolution, WholeBodySolver, WholeBodyStatus

__all__ = [
    "CondensedSolver",
    "CondensedStatus",
    "WholeBodySolution",
    "WholeBodySolver",
    "WholeBodyStatus",
]
