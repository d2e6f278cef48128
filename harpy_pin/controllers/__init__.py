"""Controllers: anything with ``step(state) -> Command``."""

from harpy_pin.controllers.condensed import CondensedController
from harpy_pin.controllers.governed import GovernedController
from harpy_pin.controllers.named_controllers import (
    CONTROLLERS,
    GOVERNORS,
    make_controller,
    make_governor,
    make_governor_parameters,
    make_parameters,
)
from harpy_pin.controllers.parameters import GovernedParameters, JointGains, WholeBodyParameters
from harpy_pin.controllers.stage import Stage
from harpy_pin.controllers.whole_body import WholeBodyController
from harpy_pin.simulation.loop import Controller

__all__ = [
    "CONTROLLERS",
    "GOVERNORS",
    "CondensedController",
    "Controller",
    "GovernedController",
    "GovernedParameters",
    "JointGains",
    "Stage",
    "WholeBodyController",
    "WholeBodyParameters",
    "make_controller",
    "make_governor",
    "make_governor_parameters",
    "make_parameters",
]
