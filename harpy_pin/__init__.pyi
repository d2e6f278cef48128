"""What ``import harpy_pin as hp`` offers; :mod:`lazy_loader` reads this file."""

from . import control, gait, governor, model, mujoco, plant, view, wbc
from .control import (
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
from .gait import (
    CommandedGait,
    Gait,
    GaitParameters,
    GaitTarget,
    Hovering,
    Standing,
    Stepping,
    StraightGait,
    make_commanded_gait,
    make_gait,
)
from .governor import (
    ConeGovernor,
    ConstraintRows,
    ContactForceFilter,
    ContactForceFilterParameters,
    ExplicitReferenceGovernor,
    ForceRows,
    Governor,
    MarginGovernor,
    Shield,
    ShieldBatch,
    ShieldReport,
)
from .model.contact_map import ContactForceMap
from .model.dynamics import Dynamics
from .model.ik import solve_ik
from .model.kinematics import LegGeometry, leg_inverse_kinematics
from .model.patch import FlatFoot
from .model.robot import Robot, load_harpy, load_robot
from .model.rotor import Rotor
from .model.state import Command, State
from .plant.controller import Controller
from .plant.ground import Ground
from .plant.measures import Measures, measure
from .plant.push import Push
from .plant.run import Run
from .plant.sensors import Noise, Sensors
from .plant.simulator import Simulator
from .scenario import Scenario, build, walk
from .wbc import CentreOfMassTask, FootForceTask, FrameTask, JointTask, MomentumTask

__version__: str

__all__ = [
    "CentreOfMassTask",
    "Command",
    "CommandedGait",
    "CondensedBatch",
    "CondensedController",
    "ConeGovernor",
    "ConstraintRows",
    "ContactForceFilter",
    "ContactForceFilterParameters",
    "ContactForceMap",
    "ControlError",
    "Controller",
    "Dynamics",
    "ExplicitReferenceGovernor",
    "FlatFoot",
    "FootForceTask",
    "ForceRows",
    "FrameTask",
    "Gait",
    "GaitParameters",
    "GaitTarget",
    "GovernedController",
    "GovernedParameters",
    "Governor",
    "Ground",
    "HarpyError",
    "Hovering",
    "InputError",
    "Interrupted",
    "JointTask",
    "KernelError",
    "LegGeometry",
    "MarginGovernor",
    "Measures",
    "MomentumTask",
    "Noise",
    "OutOfReachError",
    "Push",
    "Robot",
    "RobotError",
    "Rotor",
    "Run",
    "RunFileError",
    "Scenario",
    "Sensors",
    "Shield",
    "ShieldBatch",
    "ShieldReport",
    "Simulator",
    "Standing",
    "State",
    "Stepping",
    "StraightGait",
    "WholeBodyController",
    "WholeBodyParameters",
    "__version__",
    "build",
    "condensed",
    "control",
    "gait",
    "governor",
    "leg_inverse_kinematics",
    "load_harpy",
    "load_robot",
    "make_commanded_gait",
    "make_controller",
    "make_gait",
    "make_governor",
    "measure",
    "model",
    "mujoco",
    "plant",
    "solve_ik",
    "view",
    "walk",
    "wbc",
]
