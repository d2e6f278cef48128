"""The whole-body law in contact forces: the optimum of the whole-body program, three numbers for each foot."""

from harpy_pin.wbc.condensed.condensed_solver import CondensedSolver, CondensedStatus

__all__ = ["CondensedSolver", "CondensedStatus"]
