"""A scenario is everything that makes a walk, made of parts; :func:`walk` walks it."""

from harpy_pin.scenario.build import Walk, build, walk
from harpy_pin.scenario.controller_parts import CONTROLLER_PARTS, Condensed, ControllerPart, Governed, WholeBody
from harpy_pin.scenario.disturbances import Disturbances
from harpy_pin.scenario.gait_parts import GAIT_PARTS, Commanded, GaitPart, Hover, Stand, Straight, Walking, gaits_of
from harpy_pin.scenario.parts import Part, read_part
from harpy_pin.scenario.plant_parts import PLANT_PARTS, Compliant, Mujoco, PlantPart
from harpy_pin.scenario.scenario import Scenario
from harpy_pin.scenario.settings import Setting, scenario_of, settings_table

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
