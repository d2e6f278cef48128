"""What ``harpy_pin.simulation`` offers; :mod:`lazy_loader` reads this file."""

from .base import GRAVITY, Plant
from .controller import Controller
from .ground import Ground, contact_step, friction_force, normal_force
from .measures import Chattering, Measures, chattering, measure
from .profile import Profile, Profiler
from .push import Push
from .run import Run
from .sensors import Noise, Sensors
from .simulator import Simulator

__all__ = [
    "GRAVITY",
    "Chattering",
    "Controller",
    "Ground",
    "Measures",
    "Noise",
    "Plant",
    "Profile",
    "Profiler",
    "Push",
    "Run",
    "Sensors",
    "Simulator",
    "chattering",
    "contact_step",
    "friction_force",
    "measure",
    "normal_force",
]
