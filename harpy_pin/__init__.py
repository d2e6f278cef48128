"""Contact-force governors and a QP whole-body controller for the thruster-assisted biped Harpy, on Pinocchio.

The names below are imported when they are first used, so that ``import harpy_pin`` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from harpy_pin.control import (
        GovernedController,
        GovernedParameters,
        WholeBodyController,
        WholeBodyParameters,
        make_controller,
        make_governor,
    )
    from harpy_pin.errors import (
        ControlError,
        HarpyError,
        InputError,
        Interrupted,
        OutOfReachError,
        RobotError,
        RunFileError,
    )
    from harpy_pin.gait import Gait, GaitParameters, StraightGait, make_gait
    from harpy_pin.governor import (
        ConeGovernor,
        ConstraintRows,
        ContactForceGovernor,
        ContactGovernorParameters,
        ExplicitReferenceGovernor,
        ForceRows,
        Governor,
        MarginGovernor,
    )
    from harpy_pin.model.contact_map import ContactForceMap
    from harpy_pin.model.dynamics import Dynamics
    from harpy_pin.model.ik import solve_ik
    from harpy_pin.model.kinematics import LegGeometry, leg_inverse_kinematics
    from harpy_pin.model.robot import Robot, load_harpy, load_robot
    from harpy_pin.model.state import Command, State
    from harpy_pin.plant.controller import Controller
    from harpy_pin.plant.ground import Ground
    from harpy_pin.plant.measures import Measures, measure
    from harpy_pin.plant.push import Push
    from harpy_pin.plant.run import Run
    from harpy_pin.plant.sensors import Noise
    from harpy_pin.plant.simulator import Simulator
    from harpy_pin.scenario import Scenario, build, walk

__version__ = "0.1.0"

_HOME = {
    "control": (
        "GovernedController",
        "GovernedParameters",
        "WholeBodyController",
        "WholeBodyParameters",
        "make_controller",
        "make_governor",
    ),
    "errors": (
        "ControlError",
        "HarpyError",
        "InputError",
        "Interrupted",
        "OutOfReachError",
        "RobotError",
        "RunFileError",
    ),
    "gait": (
        "Gait",
        "GaitParameters",
        "StraightGait",
        "make_gait",
    ),
    "governor": (
        "ConeGovernor",
        "ConstraintRows",
        "ContactForceGovernor",
        "ContactGovernorParameters",
        "ExplicitReferenceGovernor",
        "ForceRows",
        "Governor",
        "MarginGovernor",
    ),
    "model.contact_map": ("ContactForceMap",),
    "model.dynamics": ("Dynamics",),
    "model.ik": ("solve_ik",),
    "model.kinematics": (
        "LegGeometry",
        "leg_inverse_kinematics",
    ),
    "model.robot": (
        "Robot",
        "load_harpy",
        "load_robot",
    ),
    "model.state": (
        "Command",
        "State",
    ),
    "plant.controller": ("Controller",),
    "plant.ground": ("Ground",),
    "plant.measures": (
        "Measures",
        "measure",
    ),
    "plant.push": ("Push",),
    "plant.run": ("Run",),
    "plant.sensors": ("Noise",),
    "plant.simulator": ("Simulator",),
    "scenario": (
        "Scenario",
        "build",
        "walk",
    ),
}
_MODULE = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "Command",
    "ConeGovernor",
    "ConstraintRows",
    "ContactForceGovernor",
    "ContactForceMap",
    "ContactGovernorParameters",
    "ControlError",
    "Controller",
    "Dynamics",
    "ExplicitReferenceGovernor",
    "ForceRows",
    "Gait",
    "GaitParameters",
    "GovernedController",
    "GovernedParameters",
    "Governor",
    "Ground",
    "HarpyError",
    "InputError",
    "Interrupted",
    "LegGeometry",
    "MarginGovernor",
    "Measures",
    "Noise",
    "OutOfReachError",
    "Push",
    "Robot",
    "RobotError",
    "Run",
    "RunFileError",
    "Scenario",
    "Simulator",
    "State",
    "StraightGait",
    "WholeBodyController",
    "WholeBodyParameters",
    "__version__",
    "build",
    "leg_inverse_kinematics",
    "load_harpy",
    "load_robot",
    "make_controller",
    "make_gait",
    "make_governor",
    "measure",
    "solve_ik",
    "walk",
]


def __getattr__(name: str) -> Any:
    if name in _MODULE:
        return getattr(import_module(f"harpy_pin.{_MODULE[name]}"), name)
    raise AttributeError(f"module 'harpy_pin' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
