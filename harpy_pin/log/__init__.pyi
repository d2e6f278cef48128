"""What ``harpy_pin.log`` offers; :mod:`lazy_loader` reads this file."""

from .measures import Measures, measure
from .power import Propulsion
from .run import Run

__all__ = ["Measures", "Propulsion", "Run", "measure"]
