"""What ``import harpy_pin as hp`` offers; :mod:`lazy_loader` reads this file."""

from . import controllers, gaits, governors, ground, log, model, scenario, simulation, view, wbc
from .controllers import CondensedController, WholeBodyController, make_controller
from .errors import ControlError, HarpyError, InputError, Interrupted, RobotError, RunFileError
from .estimation import Estimator, Imu, Readings
from .gaits import (
    Gait,
    GaitTarget,
    Hovering,
    OnTerrain,
    Plan,
    PlannedGait,
    Standing,
    WalkingGait,
    make_commanded_gait,
    make_gait,
)
from .governors import ContactForceFilter, ContactForceFilterParameters, ExplicitReferenceGovernor
from .ground.ground import Ground
from .log.measures import measure
from .log.run import Run
from .model.dynamics import Dynamics
from .model.flat_foot import FlatFoot
from .model.loading import load_harpy, load_robot, robots
from .model.robot import Robot
from .model.rotor import Rotor
from .model.state import Command, State
from .scenario import (
    Commanded,
    Condensed,
    Disturbances,
    Governed,
    Mujoco,
    Pinocchio,
    Scenario,
    Straight,
    Walking,
    WholeBody,
    build,
    walk,
)
from .simulation.actuators import Actuators
from .simulation.loop import Controller
from .simulation.mujoco import MujocoBridge
from .simulation.own_loop import Recorder
from .simulation.push import Push
from .simulation.sensors import Noise
from .simulation.simulator import Simulator
from .simulation.thrusters import Thrusters
from .wbc import CentreOfMassTask, FootForceTask, FrameTask, JointTask, WholeBodySolver

__version__: str

__all__ = [
    "Actuators",
    "CentreOfMassTask",
    "Command",
    "Commanded",
    "Condensed",
    "CondensedController",
    "ContactForceFilter",
    "ContactForceFilterParameters",
    "ControlError",
    "Controller",
    "Disturbances",
    "Dynamics",
    "Estimator",
    "ExplicitReferenceGovernor",
    "FlatFoot",
    "FootForceTask",
    "FrameTask",
    "Gait",
    "GaitTarget",
    "Governed",
    "Ground",
    "HarpyError",
    "Hovering",
    "Imu",
    "InputError",
    "Interrupted",
    "JointTask",
    "Mujoco",
    "MujocoBridge",
    "Noise",
    "OnTerrain",
    "Pinocchio",
    "Plan",
    "PlannedGait",
    "Push",
    "Readings",
    "Recorder",
    "Robot",
    "RobotError",
    "Rotor",
    "Run",
    "RunFileError",
    "Scenario",
    "Simulator",
    "Standing",
    "State",
    "Straight",
    "Thrusters",
    "Walking",
    "WalkingGait",
    "WholeBody",
    "WholeBodyController",
    "WholeBodySolver",
    "__version__",
    "build",
    "controllers",
    "gaits",
    "governors",
    "ground",
    "load_harpy",
    "load_robot",
    "log",
    "make_commanded_gait",
    "make_controller",
    "make_gait",
    "measure",
    "model",
    "robots",
    "scenario",
    "simulation",
    "view",
    "walk",
    "wbc",
]
