"""What ``harpy_pin.log`` offers; :mod:`lazy_loader` reads this file."""

from .measures import Chattering, Measures, chattering, measure
from .power import Motors, Power, Propulsion, power
from .run import Run

__all__ = ["Chattering", "Measures", "Motors", "Power", "Propulsion", "Run", "chattering", "measure", "power"]
