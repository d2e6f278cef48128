"""Gaits: where the body and the feet should be, at any time."""

from harpy_pin.gaits.commanded import CommandedGait, CommandedParameters, make_commanded_gait
from harpy_pin.gaits.gait import Gait, GaitTarget
from harpy_pin.gaits.on_terrain import OnTerrain
from harpy_pin.gaits.plan import Plan, PlannedMoment
from harpy_pin.gaits.planned import PlannedGait, Planner
from harpy_pin.gaits.standing import Hovering, Standing
from harpy_pin.gaits.straight import GaitParameters, StepParameters, StraightGait, make_gait
from harpy_pin.gaits.swing import swing
from harpy_pin.gaits.walking import WalkingGait, WalkingParameters

__all__ = [
    "CommandedGait",
    "CommandedParameters",
    "Gait",
    "GaitParameters",
    "GaitTarget",
    "Hovering",
    "OnTerrain",
    "Plan",
    "PlannedGait",
    "PlannedMoment",
    "Planner",
    "Standing",
    "StepParameters",
    "StraightGait",
    "WalkingGait",
    "WalkingParameters",
    "make_commanded_gait",
    "make_gait",
    "swing",
]
