"""The whole-body law in contact forces: the optimum of the whole-body program, three numbers for each foot."""

from harpy_pin.wbc.condensed.condensed_solver import ExplicitLaw, LawStatus

__all__ = ["ExplicitLaw", "LawStatus"]
