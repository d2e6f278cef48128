"""Controllers: anything with ``step(state) -> Command``."""

from harpy_pin.control.batch import BatchTargets, CondensedBatch
from harpy_pin.control.explicit import ExplicitController
from harpy_pin.control.governed import GovernedController
from harpy_pin.control.named import CONTROLLERS, GOVERNORS, make_controller, make_governor, make_parameters
from harpy_pin.control.settings import GovernedParameters, JointGains, WholeBodyParameters
from harpy_pin.control.whole_body import WholeBodyController
from harpy_pin.plant.controller import Controller

__all__ = [
    "CONTROLLERS",
    "GOVERNORS",
    "BatchTargets",
    "CondensedBatch",
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
