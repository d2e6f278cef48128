"""Who is compared: controllers of the library with their default settings."""

from __future__ import annotations

from harpy_pin.control import GovernedController, WholeBodyController, make_controller
from harpy_pin.errors import InputError
from harpy_pin.gait import make_gait
from harpy_pin.model.robot import Robot

__all__ = ["CONTENDERS", "Contender", "make_contender", "make_governed", "make_whole_body"]

CONTENDERS = ("ungoverned", "governed", "wbc")
"""The paper's controller without a governor, with the paper's governor, and the QP whole-body controller."""

Contender = GovernedController | WholeBodyController


def make_contender(name: str, robot: Robot, friction: float) -> Contender:
    """A new controller with a gait of its own.

    Args:
        name: one of :data:`CONTENDERS`.
        robot: what to control.
        friction: coefficient that the controller assumes; the comparison gives it the ground's.

    Raises:
        InputError: unknown name, or a friction out of its domain.
    """
    if name not in CONTENDERS:
        raise InputError.unknown("contender", name, CONTENDERS)
    gait = make_gait(robot)
    if name == "wbc":
        return make_controller("wbc", gait, mu=friction)
    return make_controller("governed", gait, mu=friction, governor="none" if name == "ungoverned" else "paper")


def make_governed(robot: Robot, friction: float) -> GovernedController:
    """The contender ``governed``, with its type."""
    controller = make_contender("governed", robot, friction)
    assert isinstance(controller, GovernedController)
    return controller


def make_whole_body(robot: Robot, friction: float) -> WholeBodyController:
    """The contender ``wbc``, with its type."""
    controller = make_contender("wbc", robot, friction)
    assert isinstance(controller, WholeBodyController)
    return controller
