"""What ``harpy_pin.simulation.mujoco`` offers; :mod:`lazy_loader` reads this file."""

from .bridge import MujocoBridge
from .conventions import Conventions, installed_version
from .mujoco_model import MujocoModel
from .mujoco_plant import MujocoPlant
from .soft_contact import CONTACTS, PRESETS, SoftContact, preset_ground

__all__ = [
    "CONTACTS",
    "PRESETS",
    "Conventions",
    "MujocoBridge",
    "MujocoModel",
    "MujocoPlant",
    "SoftContact",
    "installed_version",
    "preset_ground",
]
