"""Kernels: functions in a small language that become portable C (docs/kernels.md)."""

from harpy_pin.kernels.kernels import BACKEND, Kernel, kernel

__all__ = ["BACKEND", "Kernel", "kernel"]
