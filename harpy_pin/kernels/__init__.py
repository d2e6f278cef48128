"""Kernels: functions in a small language that become portable C (docs/kernels.md)."""

from harpy_pin.kernels.kernels import Kernel, kernel
from harpy_pin.kernels.types import ByPrecision

__all__ = ["ByPrecision", "Kernel", "kernel"]
