"""MuJoCo as a second plant: the same robot, scenarios, controllers and logs in another engine.

With the extra ``mujoco``: ``walk(Scenario(plant="mujoco"))`` or ``harpy walk --set plant=mujoco``.
MuJoCo itself is imported when the first model is made.
"""

from harpy_pin.simulation.mujoco.bridge import MujocoBridge
from harpy_pin.simulation.mujoco.conventions import Conventions, installed_version
from harpy_pin.simulation.mujoco.mujoco_model import MujocoModel
from harpy_pin.simulation.mujoco.mujoco_plant import MujocoPlant
from harpy_pin.simulation.mujoco.soft_contact import CONTACTS, PRESETS, SoftContact, preset_ground

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
