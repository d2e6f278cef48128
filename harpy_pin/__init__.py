"""Contact-force governors and a QP whole-body controller for the thruster-assisted biped Harpy, on Pinocchio.

The names below are imported when they are first used, so that ``import harpy_pin`` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from harpy_pin.contact import ContactForceMap
    from harpy_pin.control import (
        GovernedController,
        GovernedParameters,
        WholeBodyController,
        WholeBodyParameters,
        make_controller,
        make_governor,
    )
    from harpy_pin.dynamics import Dynamics
    from harpy_pin.errors import (
        ControlError,
        HarpyError,
        InputError,
        OutOfReachError,
        RobotError,
        RunFileError,
    )
    from harpy_pin.gait import Gait, GaitParameters, make_gait
    from harpy_pin.governor import (
        BarrierGovernor,
        ClampGovernor,
        ConeGovernor,
        ConstraintRows,
        ContactForceGovernor,
        ContactGovernorParameters,
        ExplicitReferenceGovernor,
        ForceRows,
        Governor,
        MarginGovernor,
    )
    from harpy_pin.ground import Ground
    from harpy_pin.ik import solve_ik
    from harpy_pin.kinematics import LegGeometry, leg_inverse_kinematics
    from harpy_pin.measures import Measures, measure
    from harpy_pin.push import Push
    from harpy_pin.robot import Robot, load_harpy, load_robot
    from harpy_pin.run import Run
    from harpy_pin.simulation import Simulator
    from harpy_pin.state import Command, Reference, State

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
    "contact": ("ContactForceMap",),
    "dynamics": ("Dynamics",),
    "errors": ("ControlError", "HarpyError", "InputError", "OutOfReachError", "RobotError", "RunFileError"),
    "gait": ("Gait", "GaitParameters", "make_gait"),
    "governor": (
        "BarrierGovernor",
        "ClampGovernor",
        "ConeGovernor",
        "ConstraintRows",
        "ContactForceGovernor",
        "ContactGovernorParameters",
        "ExplicitReferenceGovernor",
        "ForceRows",
        "Governor",
        "MarginGovernor",
    ),
    "ground": ("Ground",),
    "ik": ("solve_ik",),
    "kinematics": ("LegGeometry", "leg_inverse_kinematics"),
    "measures": ("Measures", "measure"),
    "push": ("Push",),
    "robot": ("Robot", "load_harpy", "load_robot"),
    "run": ("Run",),
    "simulation": ("Simulator",),
    "state": ("Command", "Reference", "State"),
}
_ROOM = {name: room for room, names in _HOME.items() for name in names}

__all__ = [
    "BarrierGovernor",
    "ClampGovernor",
    "Command",
    "ConeGovernor",
    "ConstraintRows",
    "ContactForceGovernor",
    "ContactForceMap",
    "ContactGovernorParameters",
    "ControlError",
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
    "LegGeometry",
    "MarginGovernor",
    "Measures",
    "OutOfReachError",
    "Push",
    "Reference",
    "Robot",
    "RobotError",
    "Run",
    "RunFileError",
    "Simulator",
    "State",
    "WholeBodyController",
    "WholeBodyParameters",
    "__version__",
    "leg_inverse_kinematics",
    "load_harpy",
    "load_robot",
    "make_controller",
    "make_gait",
    "make_governor",
    "measure",
    "solve_ik",
]


def __getattr__(name: str) -> Any:
    if name in _ROOM:
        return getattr(import_module(f"harpy_pin.{_ROOM[name]}"), name)
    raise AttributeError(f"module 'harpy_pin' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
