"""The condensed whole-body controller: the whole-body optimum by a program in the contact forces
alone.
"""

from harpy_pin.wbc.condensed.condensed_solver import CondensedSolver, CondensedStatus

__all__ = ["CondensedSolver", "CondensedStatus"]
