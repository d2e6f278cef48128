"""A scenario is everything that makes a walk, made of parts; :func:`walk` walks it."""

from harpy_pin.scenario.build import Walk, build, walk
from harpy_pin.scenario.controller_parts import CONTROLLER_PARTS, Condensed, ControllerPart, Governed, WholeBody
from harpy_pin.scenario.disturbances import Disturbances
from harpy_pin.scenario.gait_parts import (
    GAIT_PARTS,
    Commanded,
    Flying,
    GaitPart,
    Hover,
    Optimised,
    PaperCurves,
    Stand,
    StepInPlace,
    Straight,
    Walking,
    gaits_of,
)
from harpy_pin.scenario.parts import Part, read_part
from harpy_pin.scenario.plant_parts import PLANT_PARTS, PLANTS, Compliant, Drake, Mujoco, PlantPart
from harpy_pin.scenario.scenario import Scenario

__all__ = [
    "CONTROLLER_PARTS",
    "GAIT_PARTS",
    "PLANTS",
    "PLANT_PARTS",
    "Commanded",
    "Compliant",
    "Condensed",
    "ControllerPart",
    "Disturbances",
    "Drake",
    "Flying",
    "GaitPart",
    "Governed",
    "Hover",
    "Mujoco",
    "Optimised",
    "PaperCurves",
    "Part",
    "PlantPart",
    "Scenario",
    "Stand",
    "StepInPlace",
    "Straight",
    "Walk",
    "Walking",
    "WholeBody",
    "build",
    "gaits_of",
    "read_part",
    "walk",
]
