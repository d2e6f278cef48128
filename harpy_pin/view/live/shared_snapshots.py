"""Snapshots of a session in memory that two processes share: the writer never waits for a reader."""

from __future__ import annotations

import ctypes
from multiprocessing.context import BaseContext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.ground.contact_frame import in_contact_frames
from harpy_pin.model.robot import Robot
from harpy_pin.view.live.live_session import LiveSession

__all__ = ["SharedSnapshots"]

PLACES = 256
"""Snapshots that a reader may be late by: five seconds."""


class SharedSnapshots:
    """A ring of snapshots with one writer; it may be handed to a process that is being started.

    A reader that is more than a ring late misses snapshots. One that reads while the oldest is overwritten throws it
    away: the count is looked at before and after.

    Args:
        context: of the processes.
        robot: gives the shapes.
    """

    def __init__(self, context: BaseContext, robot: Robot) -> None:
        self._dtype = _layout(robot)
        self._memory: Any = context.RawArray(ctypes.c_byte, PLACES * self._dtype.itemsize)
        self._count: Any = context.RawValue(ctypes.c_longlong, 0)
        self._ring = np.frombuffer(memoryview(self._memory), self._dtype)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_ring"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._ring = np.frombuffer(memoryview(self._memory), self._dtype)

    @property
    def count(self) -> int:
        """Snapshots written so far."""
        return int(self._count.value)

    def write(self, session: LiveSession) -> None:
        """Add a snapshot of the present state."""
        number = self.count
        p, s, state = self._ring[number % PLACES], session.simulator, session.simulator.state
        tick = session.last
        p["time"] = session.time
        p["q"] = state.q
        p["foot_position"], p["foot_velocity"] = state.foot_position, state.foot_velocity
        p["foot_force"] = state.foot_force
        normal = np.ascontiguousarray(session.plane.normal(*np.ascontiguousarray(state.foot_position[:, :2].T)))
        p["contact_force"] = in_contact_frames(normal, state.foot_force)
        p["contact_velocity"] = in_contact_frames(normal, state.foot_velocity)
        p["slope"], p["below"] = session.plane.slope, s.ground_below
        p["thrust"] = 0.0 if tick is None else tick.command.thrust
        p["power"] = session.power
        p["push"] = 0.0 if tick is None else tick.push
        p["target"], p["applied"] = session.body_reference, session.applied_reference
        p["heading"] = session.gait.target.heading[0]
        p["velocity"] = session.applied
        p["friction"] = s.ground.friction(state.foot_position[:, 0])
        p["estimate"] = session.friction_estimate
        p["stiffness"] = s.ground.stiffness
        p["slip"] = session.slip
        p["falls"], p["walk"] = session.falls, session.walks
        p["p50"], p["p99"] = session.times.percentile(50.0), session.times.percentile(99.0)
        p["factor"], p["lost"] = session.keeper.factor, session.keeper.lost
        p["moving"] = not (session.paused or session.ending)
        self._count.value = number + 1

    def read(self, since: int) -> tuple[NDArray[Any], int]:
        """Snapshots that came since the count of the last look, and the count of this one."""
        count = self.count
        first = max(since, count - PLACES + 1)
        found = self._ring[np.arange(first, count) % PLACES].copy()
        overwritten = max(self.count - PLACES + 1 - first, 0)
        return found[overwritten:], count


def _layout(robot: Robot) -> np.dtype[Any]:
    feet, thrusters = len(robot.feet), len(robot.thrusters)
    shapes: dict[str, tuple[int, ...]] = {
        "time": (),
        "q": (robot.model.nq,),
        "foot_position": (feet, 3),
        "foot_velocity": (feet, 3),
        "foot_force": (feet, 3),
        "contact_force": (feet, 3),
        "contact_velocity": (feet, 3),
        "slope": (),
        "below": (),
        "thrust": (thrusters, 3),
        "power": (2,),
        "push": (3,),
        "target": (3,),
        "applied": (3,),
        "heading": (),
        "velocity": (3,),
        "friction": (feet,),
        "estimate": (feet,),
        "stiffness": (),
        "slip": (feet,),
        "falls": (),
        "walk": (),
        "p50": (),
        "p99": (),
        "factor": (),
        "lost": (),
        "moving": (),
    }
    return np.dtype([(name, np.float64, shape) for name, shape in shapes.items()])
