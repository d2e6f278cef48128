"""Flight: jumping, hovering, and flying from place to place, for robots with feet and thrusters or
rotors.

Importing it makes ``gait="flying"`` known to scenarios.
"""

from harpy_pin.contrib.flight.flights import Fly, Jump
from harpy_pin.contrib.flight.flying_gait import Flying, FlyingGait

__all__ = ["Fly", "Flying", "FlyingGait", "Jump"]
