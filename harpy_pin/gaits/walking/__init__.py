"""A walk of any robot with two, four or six feet."""

from harpy_pin.gaits.walking.parameters import WalkingParameters
from harpy_pin.gaits.walking.walking_gait import WalkingGait

__all__ = ["WalkingGait", "WalkingParameters"]
