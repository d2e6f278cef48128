"""Gait: where the body and the feet should be, at any time."""

from harpy_pin.gait.base import Gait, GaitTarget
from harpy_pin.gait.bezier import bezier
from harpy_pin.gait.commanded import CommandedGait, CommandedParameters, make_commanded_gait
from harpy_pin.gait.hovering import Hovering
from harpy_pin.gait.named import GAITS, named_gait
from harpy_pin.gait.planar.gait import PlanarGait
from harpy_pin.gait.planar.gait_file import OptimisedGait, load_gait
from harpy_pin.gait.planar.model import PlanarModel
from harpy_pin.gait.planar.optimise import optimise_gait
from harpy_pin.gait.planar.periodicity import Periodicity, analyse_periodicity
from harpy_pin.gait.planar.search import SEARCHES, PlanarTask
from harpy_pin.gait.planar.walk import PlanarSummary, PlanarWalk
from harpy_pin.gait.spatial import SpatialGait
from harpy_pin.gait.standing import Standing
from harpy_pin.gait.stepping import Stepping
from harpy_pin.gait.straight import GaitParameters, StraightGait, make_gait

__all__ = [
    "GAITS",
    "SEARCHES",
    "CommandedGait",
    "CommandedParameters",
    "Gait",
    "GaitParameters",
    "GaitTarget",
    "Hovering",
    "OptimisedGait",
    "Periodicity",
    "PlanarGait",
    "PlanarModel",
    "PlanarSummary",
    "PlanarTask",
    "PlanarWalk",
    "SpatialGait",
    "Standing",
    "Stepping",
    "StraightGait",
    "analyse_periodicity",
    "bezier",
    "load_gait",
    "make_commanded_gait",
    "make_gait",
    "named_gait",
    "optimise_gait",
]
