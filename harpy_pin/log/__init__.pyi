"""What ``harpy_pin.log`` offers; :mod:`lazy_loader` reads this file."""

from .measures import Chattering, Measures, chattering, measure
from .run import Run

__all__ = ["Chattering", "Measures", "Run", "chattering", "measure"]
