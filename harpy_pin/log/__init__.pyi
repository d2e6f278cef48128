"""What ``harpy_pin.log`` offers; :mod:`lazy_loader` reads this file."""

from .measures import Measures, measure
from .power import Motors, Power, Propulsion, power
from .run import Run

__all__ = ["Measures", "Motors", "Power", "Propulsion", "Run", "measure", "power"]
