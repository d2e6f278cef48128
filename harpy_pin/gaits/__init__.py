"""Gaits: where the body and the feet should be, at any time."""

from harpy_pin.gaits.bezier import bezier
from harpy_pin.gaits.commanded import CommandedGait, CommandedParameters, make_commanded_gait
from harpy_pin.gaits.flight.flights import Fly, Jump
from harpy_pin.gaits.flight.flying_gait import FlyingGait
from harpy_pin.gaits.foothold_governor import FootholdGovernorParameters, GovernedGait
from harpy_pin.gaits.gait import Gait, GaitTarget
from harpy_pin.gaits.hovering import Hovering
from harpy_pin.gaits.named_gaits import GAITS, make_named_gait
from harpy_pin.gaits.on_felt_ground import OnFeltGround
from harpy_pin.gaits.on_terrain import OnTerrain
from harpy_pin.gaits.planar.gait_file import OptimisedGait, load_gait
from harpy_pin.gaits.planar.planar_gait import PlanarGait
from harpy_pin.gaits.planar.planar_model import PlanarModel
from harpy_pin.gaits.planar.planar_walk import PlanarSummary, PlanarWalk
from harpy_pin.gaits.spatial import SpatialGait
from harpy_pin.gaits.standing import Standing
from harpy_pin.gaits.stepping import Stepping
from harpy_pin.gaits.straight import GaitParameters, StraightGait, make_gait
from harpy_pin.gaits.walking import WalkingGait

__all__ = [
    "GAITS",
    "CommandedGait",
    "CommandedParameters",
    "Fly",
    "FlyingGait",
    "FootholdGovernorParameters",
    "Gait",
    "GaitParameters",
    "GaitTarget",
    "GovernedGait",
    "Hovering",
    "Jump",
    "OnFeltGround",
    "OnTerrain",
    "OptimisedGait",
    "PlanarGait",
    "PlanarModel",
    "PlanarSummary",
    "PlanarWalk",
    "SpatialGait",
    "Standing",
    "Stepping",
    "StraightGait",
    "WalkingGait",
    "bezier",
    "load_gait",
    "make_commanded_gait",
    "make_gait",
    "make_named_gait",
]
