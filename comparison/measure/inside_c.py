"""Ticks of a controller on recorded states inside C: replay.c, behind the ticks.c of the closed
loop.
"""

import ctypes
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from comparison.measure.replay import TickReplay
from harpy_pin.errors import HarpyError
from harpy_pin.kernels.bridge import calling_library
from harpy_pin.kernels.calls import linked
from harpy_pin.model.state import State, Vector
from harpy_pin.simulation import ticks


class ReplayInsideC(TickReplay):
    """Times the ticks of a controller of which nothing is Python's."""

    def start(self, states: Sequence[State]) -> None:
        """See :meth:`TickReplay.start`."""
        super().start(states)
        if not states:
            return
        controller, arrays = self.controller, _arrays(states[0])
        controller.step(states[0])  # the gait's targets are there from the first tick on
        controller.reset()
        self._rows = np.array([np.concatenate([[s.t], *map(np.ravel, _arrays(s))]) for s in states])
        sample = np.zeros(self._rows.shape[1] - 1)
        parts = np.split(sample, np.cumsum([array.size for array in arrays])[:-1])
        calls = controller.calls(
            State(0.0, *(p.reshape(a.shape) for p, a in zip(parts, arrays, strict=True)))
        )
        self._links, self._bound = linked(calls)
        written = (sample, *controller.command[:2])
        self._kept = (
            sample,
            *(number for array in written for number in (array.ctypes.data, array.size)),
        )

    def time_block(self, begin: int, end: int) -> None:
        """See :meth:`TickReplay.time_block`."""
        rows, commands, laps = (
            array[begin:end] for array in (self._rows, self.commands, self.laps)
        )
        given = (self._links, len(self._links), *self._kept[1:], rows.ctypes.data, len(rows))
        if _library().replay(*given, commands.ctypes.data, laps.ctypes.data) != len(rows):
            raise HarpyError(f"a tick of {self.controller!r} was handed over to Python")


def overhead_inside_c() -> float:
    """Median difference of two readings of C's clock with nothing between them, ns."""
    laps = np.zeros(20_000, dtype=np.int64)
    _library().time_nothing(len(laps), laps.ctypes.data)
    return float(np.median(laps))


def _arrays(state: State) -> tuple[Vector, ...]:
    return state.q, state.v, state.foot_position, state.foot_velocity, state.foot_force


@cache
def _library() -> Any:
    library = calling_library(
        Path(ticks.__file__).with_suffix(".c"), Path(__file__).with_name("replay.c")
    )
    pointer, whole = ctypes.c_void_p, ctypes.c_int64
    library.replay.restype = whole
    library.replay.argtypes = (*(pointer, whole) * 5, pointer, pointer)
    library.time_nothing.argtypes = [whole, pointer]
    return library
