"""What is compared: controllers of the library with their default settings."""

from __future__ import annotations

from typing import Any

from comparison.contenders import controller_part
from harpy_pin import Ground, Robot, Scenario, checks, make_controller, make_gait

CONTENDERS = {"ungoverned": "governed/none", "governed": "governed/paper", "condensed": "condensed", "wbc": "wbc"}
"""The paper's controller without a governor and with the paper's, the condensed controller, and the whole-body QP."""


def scenario_of(name: str, friction: float, **changes: Any) -> Scenario:
    """A contender's walk at the gait's default speed.

    The name is that of :func:`comparison.contenders.controller_part`; the controller knows the ground's static friction
    coefficient unless changes of the scenario say otherwise.
    """
    return Scenario(controller=controller_part(name), ground=Ground(mu_s=friction), **changes)


def make_contender(name: str, robot: Robot, friction: float) -> Any:
    """A new controller with a gait of its own, by its name in :data:`CONTENDERS`."""
    checks.one_of("contender", name, CONTENDERS)
    controller, _, governor = CONTENDERS[name].partition("/")
    return make_controller(controller, make_gait(robot), mu=friction, governor=governor or "none")
