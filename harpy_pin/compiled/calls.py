"""Calls of kernels that C makes by itself: what gaits, controllers and plants do in a tick of a closed loop."""

from __future__ import annotations

from typing import Any

from harpy_pin.compiled.bridge import Bound
from harpy_pin.compiled.kernels import Kernel

__all__ = ["Call"]


class Call:
    """A kernel, and arguments whose memory stays where it is.

    A kernel whose first argument is called ``t`` gets the time of the tick there, whatever is given.

    Args:
        kernel: to be called.
        arguments: numbers and arrays.
        expected: what it must return for the tick to go on in C; by default anything.
    """

    def __init__(self, kernel: Kernel[Any], *arguments: Any, expected: int | None = None) -> None:
        self.kernel, self.arguments, self.expected = kernel, arguments, expected

    @property
    def takes_time(self) -> bool:
        """Whether its first argument is the time of the tick."""
        return next(iter(self.kernel._names), "") == "t"

    def bind(self) -> Bound:
        """The call for C; see :meth:`harpy_pin.compiled.kernels.Kernel.bind`."""
        return self.kernel.bind(*self.arguments)
