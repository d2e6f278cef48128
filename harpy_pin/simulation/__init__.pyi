"""What ``harpy_pin.simulation`` offers; :mod:`lazy_loader` reads this file."""

from .actuators import Actuators
from .implicit_contact import contact_step
from .loop import Controller
from .own_loop import Recorder
from .pinocchio_plant import PinocchioPlant
from .plant import Plant
from .push import Push
from .sensors import Noise, Sensors
from .simulator import Simulator
from .thrusters import Thrusters

__all__ = [
    "Actuators",
    "Controller",
    "Noise",
    "PinocchioPlant",
    "Plant",
    "Push",
    "Recorder",
    "Sensors",
    "Simulator",
    "Thrusters",
    "contact_step",
]
