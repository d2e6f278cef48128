"""Equivalent formulations of the whole-body problem, by name."""

from __future__ import annotations

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.model.robot import Robot
from harpy_pin.wbc.full import FullProblem
from harpy_pin.wbc.input_space import InputSpaceProblem
from harpy_pin.wbc.problem import WholeBodyProblem
from harpy_pin.wbc.weights import WholeBodyLimits, WholeBodyWeights

FORMULATIONS: dict[str, type[WholeBodyProblem]] = {
    kind.name: kind for kind in (FullProblem, InputSpaceProblem)
}
"""``full`` has accelerations, contact forces and thrusts as variables, ``input_space`` thrusts and
torques.
"""


@checked
def make_problem(
    name: str,
    robot: Robot,
    weights: WholeBodyWeights | None = None,
    limits: WholeBodyLimits | None = None,
) -> WholeBodyProblem:
    """A whole-body problem.

    Args:
        name: one of :data:`FORMULATIONS`.
        robot: any robot with feet.
        weights: of the tasks; by default those that fit the robot.
        limits: of the constraints.

    Raises:
        InputError: unknown name.
    """
    checks.one_of("formulation", name, FORMULATIONS)
    return FORMULATIONS[name](robot, weights, limits)
