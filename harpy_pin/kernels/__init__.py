"""Kernels: functions in a small language that become portable C (docs/kernels.md)."""

from harpy_pin.kernels.kernels import Kernel, kernel

__all__ = ["Kernel", "kernel"]
