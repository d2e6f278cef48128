"""What ``harpy_pin.gaits.walking`` offers; :mod:`lazy_loader` reads this file."""

from .parameters import WalkingParameters
from .walking_gait import WalkingGait

__all__ = ["WalkingGait", "WalkingParameters"]
