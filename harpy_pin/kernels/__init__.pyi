"""What ``harpy_pin.kernels`` offers; :mod:`lazy_loader` reads this file."""

from .additions import ByPrecision, diagonal
from .kernels import Kernel, kernel

__all__ = ["ByPrecision", "Kernel", "diagonal", "kernel"]
