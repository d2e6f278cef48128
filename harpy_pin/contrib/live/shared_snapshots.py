"""Snapshots of a session in memory that two processes share: the writer never waits for a
reader.
"""

from __future__ import annotations

import ctypes
from multiprocessing.context import BaseContext
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin.contrib.live.live_session import LiveSession, Tick
from harpy_pin.log.power import PRESETS
from harpy_pin.model.state import Vector
from harpy_pin.view.scene.frames import about_normals

PLACES = 256
"""Snapshots that a reader may be late by: five seconds."""


class SharedSnapshots:
    """A ring of snapshots with one writer; it may be handed to a process that is being started.

    A reader that is more than a ring late misses snapshots. One that reads while the oldest is
    overwritten throws it away: the count is looked at before and after.

    Args:
        context: of the processes.
        session: whose snapshots they are.
    """

    def __init__(self, context: BaseContext, session: LiveSession) -> None:
        shapes = {name: np.shape(value) for name, value in _snapshot(session).items()}
        self._dtype = np.dtype([(name, np.float64, shape) for name, shape in shapes.items()])
        self._memory: Any = context.RawArray(ctypes.c_byte, PLACES * self._dtype.itemsize)
        self._count: Any = context.RawValue(ctypes.c_longlong, 0)

    @property
    def _ring(self) -> NDArray[Any]:
        return np.frombuffer(memoryview(self._memory), self._dtype)

    @property
    def count(self) -> int:
        """Snapshots written so far."""
        return int(self._count.value)

    def write(self, session: LiveSession) -> None:
        """Add a snapshot of the present state."""
        number = self.count
        place = self._ring[number % PLACES]
        for name, value in _snapshot(session).items():
            place[name] = value
        self._count.value = number + 1

    def read(self, since: int) -> tuple[NDArray[Any], int]:
        """Snapshots that came since the count of the last look, and the count of this one."""
        count = self.count
        first = max(since, count - PLACES + 1)
        found = self._ring[np.arange(first, count) % PLACES].copy()
        overwritten = max(self.count - PLACES + 1 - first, 0)
        return found[overwritten:], count


def power_of(tick: Tick) -> Vector:
    """(2,) of a tick: of the joints without braking, and of the thrusters at 1 kW for 18 N, W."""
    joints = np.maximum(tick.command.torque * tick.state.v[6:], 0.0).sum()
    return np.array(
        (joints, PRESETS["fan"].electrical(np.linalg.norm(tick.command.thrust, axis=1)).sum())
    )


def _snapshot(session: LiveSession) -> dict[str, ArrayLike]:
    """What is logged, and what only the page shows."""
    state, times, pacer = session.last.state, session.times, session.pacer
    about = (
        about_normals(session.plane, state.foot_position, v)
        for v in (state.foot_force, state.foot_velocity)
    )
    return {
        **session.signals,
        **dict(zip(("contact_force", "contact_velocity"), about, strict=True)),
        "below": session.simulator.ground_below,
        "power": power_of(session.last),
        "falls": session.falls,
        "p50": times.percentile(50.0),
        "p99": times.percentile(99.0),
        "factor": pacer.factor,
        "lost": pacer.lost,
        "moving": not (session.paused or session.ending),
    }
