"""Ticks in time of this thread: other work on the machine does not count."""

from __future__ import annotations

from dataclasses import replace
from time import thread_time_ns
from typing import Any

import numpy as np

from harpy_pin.log.run import Run
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.scenario.build import Walk
from harpy_pin.simulation.loop import Controller

FIRST = 10
"""Ticks that are not timed: they load what every tick needs."""


class _Timed:
    """A controller whose ticks are timed, and of another one that is given the same states.

    Attributes:
        ticks: of both, ns.
        apart: largest difference of the torques, as a share of the largest torque.
    """

    def __init__(self, controller: Any, other: Controller | None) -> None:
        self._controller, self._other = controller, other
        self.ticks: list[tuple[int, int]] = []
        self.apart: list[float] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._controller, name)

    def step(self, state: State) -> Command:
        begin = thread_time_ns()
        command: Command = self._controller.step(state)
        between = thread_time_ns()
        if self._other is not None:
            torque = self._other.step(state).torque
            end = thread_time_ns()
            self.apart.append(float(np.abs(command.torque - torque).max() / np.abs(torque).max()))
        self.ticks.append((between - begin, 0 if self._other is None else end - between))
        return command


def time_ticks(walk: Walk, other: Controller | None = None) -> tuple[Run, Vector, Vector]:
    """Walk with every tick called from Python, and with another controller that is given the same states.

    Returns:
        The run; (ticks, 2) times of both, µs; and (ticks,) how far their torques are apart, as a share of the largest
        torque. Times and shares are without the first ten.
    """
    timed = _Timed(walk.controller, other)
    run = replace(walk, controller=timed).run(on_tick=_nothing)  # or the loop would be compiled as a whole
    return run, 1e-3 * np.array(timed.ticks[FIRST:]), np.array(timed.apart[FIRST:])


def _nothing(state: State) -> None:
    """Called before a tick."""
