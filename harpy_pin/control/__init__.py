"""Controllers: anything with ``step(state) -> Command``."""

from harpy_pin.control.explicit import ExplicitController
from harpy_pin.control.governed import GovernedController, GovernedParameters, JointGains
from harpy_pin.control.named import CONTROLLERS, GOVERNORS, make_controller, make_governor, make_parameters
from harpy_pin.control.whole_body import WholeBodyController, WholeBodyParameters
from harpy_pin.plant.controller import Controller

__all__ = [
    "CONTROLLERS",
    "GOVERNORS",
    "Controller",
    "ExplicitController",
    "GovernedController",
    "GovernedParameters",
    "JointGains",
    "WholeBodyController",
    "WholeBodyParameters",
    "make_controller",
    "make_governor",
    "make_parameters",
]
