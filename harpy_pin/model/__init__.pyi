"""What ``harpy_pin.model`` offers; :mod:`lazy_loader` reads this file."""

from .catalogue import CATALOGUE, CatalogueRobot
from .dynamics import Dynamics
from .ik import IKResult, IKStatus, solve_ik
from .kinematics import LegGeometry, leg_inverse_kinematics
from .loading import KnownRobot, harpy_urdf, load_harpy, load_robot, robots
from .robot import Robot
from .state import GRAVITY, Command, State, Vector

__all__ = [
    "CATALOGUE",
    "GRAVITY",
    "CatalogueRobot",
    "Command",
    "Dynamics",
    "IKResult",
    "IKStatus",
    "KnownRobot",
    "LegGeometry",
    "Robot",
    "State",
    "Vector",
    "harpy_urdf",
    "leg_inverse_kinematics",
    "load_harpy",
    "load_robot",
    "robots",
    "solve_ik",
]
