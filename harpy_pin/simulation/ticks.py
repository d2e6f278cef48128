"""Many ticks of a closed loop in one call of C (ticks.c), where Python has nothing to say between
them.

A controller says which kernels a tick of it consists of (its ``calls``, those of its gait
included), and has its signals in arrays that stay where they are. C calls these kernels, and the
plant's, by their addresses. They are those that Python calls one by one, so every number of the log
is the one that the loop in Python gives.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.kernels.bridge import Bound, calling_library
from harpy_pin.kernels.calls import Call, Link, linked
from harpy_pin.log.recorder import Recorder
from harpy_pin.simulation.push import Push, push_forces
from harpy_pin.simulation.step import MISFIT_COMMAND, physics_steps, stands

if TYPE_CHECKING:
    from harpy_pin.simulation.simulator import Simulator

KINDS = {np.dtype(np.float64): 0, np.dtype(np.int64): 1, np.dtype(np.bool_): 2}
"""Elements of signals, as in ticks.c."""
HANDED_OVER = -1
"""Ending of a piece whose next tick is Python's: the gait or the controller does not answer as
usual.
"""


class _Signal(ctypes.Structure):
    _fields_ = (("source", ctypes.c_void_p), ("count", ctypes.c_int64), ("kind", ctypes.c_int64))


class _Loop(ctypes.Structure):
    _fields_ = (
        ("calls", ctypes.POINTER(Link)),
        *((name, ctypes.c_int64) for name in ("timed", "count")),
        *((name, ctypes.POINTER(Bound)) for name in ("physics", "stands")),
        ("signals", ctypes.POINTER(_Signal)),
        *((name, ctypes.c_int64) for name in ("signal_count", "width")),
        *((name, ctypes.c_void_p) for name in ("t", "push", "tick_ns")),
        *((name, ctypes.c_int64) for name in ("push_count", "misfit")),
        *((name, ctypes.c_double) for name in ("start", "period")),
        *((name, ctypes.c_int64) for name in ("sweeps", "ending")),
    )


class CompiledLoop:
    """A controller and a simulator of the library's own in a loop of C.

    A tick makes the ``calls`` of the controller, those of its gait included, then those before a
    row is logged. It writes the ``command`` (torque, thrust), and all signals are arrays, by name,
    that stay where they are; the recorder has its first row of them. ``start`` is the time of the
    first tick, and ``period`` the time between ticks, s, with so many physics steps in each; below
    ``fall_height``, m, the body has fallen.
    """

    def __init__(
        self,
        simulator: Simulator,
        calls: Sequence[Call],
        before_row: Sequence[Call],
        command: tuple[Any, Any],
        signals: Mapping[str, NDArray[Any]],
        recorder: Recorder,
        *,
        start: float,
        period: float,
        substeps: int,
        fall_height: float,
    ) -> None:
        self._simulator, self._recorder, self._substeps = simulator, recorder, substeps
        links, bound = linked((*calls, *before_row))
        push, state = np.zeros((substeps, 3)), (simulator.q, simulator.v)
        plant = (simulator.dynamics._record_, simulator._ground, simulator._record_)
        physics = physics_steps.bind(*plant, *state, *command, push)
        standing = stands.bind(simulator._terrain, *state, fall_height)
        layout = recorder.layout
        ordered = (signals[name] for name in layout.shapes)
        sources = [_Signal(array.ctypes.data, array.size, KINDS[array.dtype]) for array in ordered]
        self._kept = (bound, physics, standing, signals)  # C has their addresses
        self._loop = _Loop(
            calls=links,
            timed=len(calls),
            count=len(links),
            physics=ctypes.pointer(physics),
            stands=ctypes.pointer(standing),
            signals=(_Signal * len(sources))(*sources),
            signal_count=len(sources),
            width=layout.width,
            t=signals["t"].ctypes.data,
            push=push.ctypes.data,
            tick_ns=signals["tick_ns"].ctypes.data,
            push_count=push.size,
            misfit=MISFIT_COMMAND,
            start=start,
            period=period,
        )

    def run(self, tick: int, ticks: int, pushes: Sequence[Push]) -> tuple[int, int]:
        """From the next tick on, of all ticks of the run, until the piece of the log is full.

        Returns how many were done, and how it stands: 0, 1 and 2 as
        :func:`~harpy_pin.simulation.step.stands` says, or ``HANDED_OVER``.
        """
        simulator, recorder, substeps, loop = (
            self._simulator,
            self._recorder,
            self._substeps,
            self._loop,
        )
        count = min(ticks - tick, recorder.room)
        rows = np.empty((count, recorder.layout.width))
        forces = np.zeros((count, substeps, 3)) if pushes else None
        if forces is not None:
            for n in range(count):
                forces[n] = push_forces(
                    pushes, loop.start + (tick + n) * loop.period, simulator.dt, substeps
                )
        given = None if forces is None else forces.ctypes.data
        done: int = _run_ticks()(ctypes.byref(loop), tick, count, given, rows.ctypes.data)
        simulator.sweeps = loop.sweeps
        recorder.append_table(rows[:done])
        if done:
            simulator.t = loop.start + (tick + done - 1) * loop.period + substeps * simulator.dt
        return done, loop.ending


def lasting_signals(
    signals: Mapping[str, Any], again: Mapping[str, Any], recorder: Recorder
) -> bool:
    """Whether signals, asked for twice, are arrays that stay where they are, and those of a log
    with its first row.
    """
    layout = recorder.layout
    return signals.keys() == layout.shapes.keys() and all(
        isinstance(array, np.ndarray)
        and array.dtype in KINDS
        and array.flags.c_contiguous
        and array.shape == layout.shapes[name]
        and (name in layout.flags) == (array.dtype == np.bool_)
        and (array.size == 0 or array.ctypes.data == again[name].ctypes.data)
        for name, array in signals.items()
    )


@cache
def _run_ticks() -> Any:
    """``run_ticks`` of ticks.c; other threads of Python may go on meanwhile."""
    library = calling_library(Path(__file__).with_suffix(".c"))
    pointer, whole = ctypes.c_void_p, ctypes.c_int64
    return ctypes.CFUNCTYPE(whole, ctypes.POINTER(_Loop), whole, whole, pointer, pointer)(
        ("run_ticks", library)
    )
