"""What ``harpy_pin.controllers`` offers; :mod:`lazy_loader` reads this file."""

from .condensed import CondensedController
from .governed import GovernedController
from .named_controllers import (
    CONTROLLERS,
    GOVERNORS,
    make_controller,
    make_governor,
    make_governor_parameters,
    make_parameters,
)
from .parameters import GovernedParameters, JointGains, WholeBodyParameters
from .stage import Stage
from .whole_body import WholeBodyController

__all__ = [
    "CONTROLLERS",
    "GOVERNORS",
    "CondensedController",
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
