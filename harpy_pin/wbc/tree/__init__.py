"""The whole-body optimum of any tree of joints, in six unknowns."""

from harpy_pin.wbc.tree.whole_body import WholeBodySolution, WholeBodySolver, WholeBodyStatus

__all__ = ["WholeBodySolution", "WholeBodySolver", "WholeBodyStatus"]
