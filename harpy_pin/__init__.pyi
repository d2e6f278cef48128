"""What ``import harpy_pin as hp`` offers; :mod:`lazy_loader` reads this file."""

from . import controllers, gaits, governors, log, model, simulation, view, wbc
from .controllers import (
    CondensedBatch,
    CondensedController,
    GovernedController,
    GovernedParameters,
    WholeBodyController,
    WholeBodyParameters,
    make_controller,
    make_governor,
)
from .errors import (
    ControlError,
    HarpyError,
    InputError,
    Interrupted,
    KernelError,
    OutOfReachError,
    RobotError,
    RunFileError,
)
from .gaits import (
    CommandedGait,
    Gait,
    GaitParameters,
    GaitTarget,
    Hovering,
    OnFeltGround,
    OnTerrain,
    Standing,
    Stepping,
    StraightGait,
    WalkingGait,
    make_commanded_gait,
    make_gait,
)
from .governors import (
    ConeGovernor,
    ConstraintRows,
    ContactForceFilter,
    ContactForceFilterParameters,
    ExplicitReferenceGovernor,
    ForceRows,
    Governor,
    Shield,
    ShieldBatch,
    ShieldReport,
)
from .log.measures import Measures, measure
from .log.run import Run
from .model.contact_map import ContactForceMap
from .model.dynamics import Dynamics
from .model.flat_foot import FlatFoot
from .model.ik import solve_ik
from .model.kinematics import LegGeometry, leg_inverse_kinematics
from .model.known_robots import robots
from .model.robot import Robot, load_harpy, load_robot
from .model.rotor import Rotor
from .model.state import Command, State
from .scenario import (
    Commanded,
    Compliant,
    Condensed,
    Disturbances,
    Drake,
    Governed,
    Hover,
    Mujoco,
    Optimised,
    PaperCurves,
    Scenario,
    Stand,
    StepInPlace,
    Straight,
    Walking,
    WholeBody,
    build,
    walk,
)
from .simulation.actuators import Actuators
from .simulation.battery import Battery
from .simulation.controller import Controller
from .simulation.ground import Ground
from .simulation.push import Push
from .simulation.sensors import Noise, Sensors
from .simulation.simulator import Simulator
from .simulation.terrain import HeightField, Plane, Ramp, Rough, Stairs, Terrain
from .simulation.thrusters import Thrusters
from .wbc import CentreOfMassTask, FootForceTask, FrameTask, JointTask, MomentumTask

__version__: str

__all__ = [
    "Actuators",
    "Battery",
    "CentreOfMassTask",
    "Command",
    "Commanded",
    "CommandedGait",
    "Compliant",
    "Condensed",
    "CondensedBatch",
    "CondensedController",
    "ConeGovernor",
    "ConstraintRows",
    "ContactForceFilter",
    "ContactForceFilterParameters",
    "ContactForceMap",
    "ControlError",
    "Controller",
    "Disturbances",
    "Drake",
    "Dynamics",
    "ExplicitReferenceGovernor",
    "FlatFoot",
    "FootForceTask",
    "ForceRows",
    "FrameTask",
    "Gait",
    "GaitParameters",
    "GaitTarget",
    "Governed",
    "GovernedController",
    "GovernedParameters",
    "Governor",
    "Ground",
    "HarpyError",
    "HeightField",
    "Hover",
    "Hovering",
    "InputError",
    "Interrupted",
    "JointTask",
    "KernelError",
    "LegGeometry",
    "Measures",
    "MomentumTask",
    "Mujoco",
    "Noise",
    "OnFeltGround",
    "OnTerrain",
    "Optimised",
    "OutOfReachError",
    "PaperCurves",
    "Plane",
    "Push",
    "Ramp",
    "Robot",
    "RobotError",
    "Rotor",
    "Rough",
    "Run",
    "RunFileError",
    "Scenario",
    "Sensors",
    "Shield",
    "ShieldBatch",
    "ShieldReport",
    "Simulator",
    "Stairs",
    "Stand",
    "Standing",
    "State",
    "StepInPlace",
    "Stepping",
    "Straight",
    "StraightGait",
    "Terrain",
    "Thrusters",
    "Walking",
    "WalkingGait",
    "WholeBody",
    "WholeBodyController",
    "WholeBodyParameters",
    "__version__",
    "build",
    "controllers",
    "gaits",
    "governors",
    "leg_inverse_kinematics",
    "load_harpy",
    "load_robot",
    "log",
    "make_commanded_gait",
    "make_controller",
    "make_gait",
    "make_governor",
    "measure",
    "model",
    "robots",
    "simulation",
    "solve_ik",
    "view",
    "walk",
    "wbc",
]
