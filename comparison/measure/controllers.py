"""What is compared: controllers of the library with their default settings."""

from __future__ import annotations

from typing import Any

from comparison.contenders import controller_part
from harpy_pin import Ground, Robot, Scenario, checks, make_controller, make_gait
from harpy_pin.controllers import CondensedController, GovernedController, WholeBodyController

__all__ = ["CONTENDERS", "Contender", "make_contender", "make_governed", "make_whole_body", "scenario_of"]

CONTENDERS = {"ungoverned": "governed/none", "governed": "governed/paper", "condensed": "condensed", "wbc": "wbc"}
"""The paper's controller without a governor and with the paper's, the condensed controller, and the whole-body QP."""

Contender = GovernedController | CondensedController | WholeBodyController


def scenario_of(name: str, friction: float, **changes: Any) -> Scenario:
    """A contender's walk at the gait's default speed.

    The name is that of :func:`comparison.contenders.controller_part`; the controller knows the ground's static friction
    coefficient unless changes of the scenario say otherwise.
    """
    return Scenario(controller=controller_part(name), ground=Ground(mu_s=friction), **changes)


def make_contender(name: str, robot: Robot, friction: float) -> Contender:
    """A new controller with a gait of its own.

    Raises:
        InputError: unknown name, or a friction out of its domain.
    """
    checks.one_of("contender", name, CONTENDERS)
    controller, _, governor = CONTENDERS[name].partition("/")
    return make_controller(controller, make_gait(robot), mu=friction, governor=governor or "none")


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
