"""Joints known from a log: armature, damping, dry friction, bias, delay, and the scale of the
torques.

Guide: the page *Joints from a log*. The torque that a rigid model needs for the logged motion is
compared with the logged one (:mod:`~harpy_pin.contrib.identify.regression`).
"""

from harpy_pin.contrib.identify.identification import identify
from harpy_pin.contrib.identify.joints import Joints
from harpy_pin.contrib.identify.motion import Excitation, excitation

__all__ = ["Excitation", "Joints", "excitation", "identify"]
