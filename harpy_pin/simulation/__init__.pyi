"""What ``harpy_pin.simulation`` offers; :mod:`lazy_loader` reads this file."""

from .actuators import Actuators
from .battery import Battery
from .controller import Controller
from .ground import Ground, friction_force, normal_force
from .implicit_contact import contact_step
from .plant import GRAVITY, Plant
from .profile import Profile, Profiler
from .push import Push
from .sensors import Noise, Sensors
from .simulator import Simulator
from .terrain import HeightField, Plane, Ramp, Rough, Stairs, Terrain
from .thrusters import Thrusters

__all__ = [
    "GRAVITY",
    "Actuators",
    "Battery",
    "Controller",
    "Ground",
    "HeightField",
    "Noise",
    "Plane",
    "Plant",
    "Profile",
    "Profiler",
    "Push",
    "Ramp",
    "Rough",
    "Sensors",
    "Simulator",
    "Stairs",
    "Terrain",
    "Thrusters",
    "contact_step",
    "friction_force",
    "normal_force",
]
