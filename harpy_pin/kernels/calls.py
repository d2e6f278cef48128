"""Calls of kernels that C makes by itself, one at a time in a closed loop, or several in one
crossing from Python.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from harpy_pin.kernels.bridge import Bound, Caller, join
from harpy_pin.kernels.kernels import Kernel


class Call:
    """A kernel, and arguments whose memory stays where it is.

    A kernel whose first argument is called ``t`` gets the time of the tick there, whatever is
    given. For the tick to go on in C it must return what is ``expected``, if anything is.
    """

    def __init__(self, kernel: Kernel[Any], *arguments: Any, expected: int | None = None) -> None:
        self.kernel, self.arguments, self.expected = kernel, arguments, expected

    @property
    def takes_time(self) -> bool:
        """Whether its first argument is the time of the tick."""
        return next(iter(self.kernel._names), "") == "t"

    def bind(self) -> Bound:
        """The call for C; see :meth:`harpy_pin.kernels.kernels.Kernel.bind`."""
        return self.kernel.bind(*self.arguments)


MAX_SAMPLES = 8


class Link(ctypes.Structure):
    """A call as C has it."""

    _fields_ = (
        ("bound", ctypes.POINTER(Bound)),
        *((name, ctypes.c_int64) for name in ("takes_time", "answers", "expected")),
    )


def linked(calls: Sequence[Call]) -> tuple[ctypes.Array[Link], list[Bound]]:
    """Calls as an array of C, and what lives as long as C has it."""
    bound = [call.bind() for call in calls]
    links = [
        Link(ctypes.pointer(one), call.takes_time, call.expected is not None, call.expected or 0)
        for call, one in zip(calls, bound, strict=True)
    ]
    return (Link * len(links))(*links), bound


class _Sample(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("name", "memory")),
        ("axes", ctypes.c_int64),
        ("shape", ctypes.c_int64 * 2),
    )


class _Chain(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int64) for name in ("links", "samples")),
        *((name, ctypes.c_void_p) for name in ("type", "time")),
        ("longest", ctypes.c_double),
        ("first", ctypes.POINTER(Link)),
        ("sample", _Sample * MAX_SAMPLES),
    )


class Chain(Caller):
    """Calls one after the other for a state, ``chain(state)``.

    It copies what was measured to the ``samples``, arrays of up to two axes by the attribute of the
    state that they are, and returns what the last call does: an integer. Where the time is no float
    within ±``longest``, s, an array is not of float64 and of its shape, or a call does not return
    what it must, it returns None, and Python goes on.
    """

    def __init__(
        self, calls: Sequence[Call], samples: Mapping[str, np.ndarray[Any, Any]], *, longest: float
    ) -> None:
        first, bound = linked(calls)
        names = {name: sys.intern(name) for name in ("t", *samples)}
        given = [
            _Sample(id(names[name]), a.ctypes.data, a.ndim, (ctypes.c_int64 * 2)(*a.shape))
            for name, a in samples.items()
        ]
        number = np.dtype(np.float64)
        self._kept = (bound, first, samples, names, number)  # C has their addresses
        parts = (_Sample * MAX_SAMPLES)(*given)
        self._chain = _Chain(
            len(first), len(given), id(number), id(names["t"]), longest, first, parts
        )
        self._address = ctypes.addressof(self._chain)
        join(Chain, chains=True)
