"""Gait: where the body and the feet should be, at any time."""

from harpy_pin.gait.bezier import bezier
from harpy_pin.gait.walk import Gait, GaitParameters, GaitTarget, make_gait

__all__ = ["Gait", "GaitParameters", "GaitTarget", "bezier", "make_gait"]
