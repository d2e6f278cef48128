"""What ``harpy_pin.gaits`` offers; :mod:`lazy_loader` reads this file."""

from .commanded import CommandedGait, CommandedParameters, make_commanded_gait
from .gait import Gait, GaitTarget
from .on_terrain import OnTerrain
from .plan import Plan, PlannedMoment
from .planned import PlannedGait, Planner
from .standing import Hovering, Standing
from .straight import GaitParameters, StepParameters, StraightGait, make_gait
from .swing import swing
from .walking import WalkingGait, WalkingParameters

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
