"""What ``harpy_pin.scenario`` offers; :mod:`lazy_loader` reads this file."""

from .build import Walk, build, walk
from .controller_parts import CONTROLLER_PARTS, Condensed, ControllerPart, Governed, WholeBody
from .disturbances import Disturbances
from .gait_parts import GAIT_PARTS, Commanded, GaitPart, Hover, Stand, Straight, Walking, gaits_of
from .parts import Part, read_part
from .plant_parts import PLANT_PARTS, Compliant, Mujoco, Pinocchio, PlantPart
from .scenario import Scenario
from .settings import Setting, scenario_of, settings_table

__all__ = [
    "CONTROLLER_PARTS",
    "GAIT_PARTS",
    "PLANT_PARTS",
    "Commanded",
    "Compliant",
    "Condensed",
    "ControllerPart",
    "Disturbances",
    "GaitPart",
    "Governed",
    "Hover",
    "Mujoco",
    "Part",
    "Pinocchio",
    "PlantPart",
    "Scenario",
    "Setting",
    "Stand",
    "Straight",
    "Walk",
    "Walking",
    "WholeBody",
    "build",
    "gaits_of",
    "read_part",
    "scenario_of",
    "settings_table",
    "walk",
]
