"""Model-predictive control above the whole-body controllers: quadrupeds that trot, and run with
flight.
"""

from harpy_pin.contrib.preview.pace import Pace
from harpy_pin.contrib.preview.planner import Preview

__all__ = ["Pace", "Preview"]
