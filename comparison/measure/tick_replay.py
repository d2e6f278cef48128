"""Replays: recorded states go through a controller, timed as a whole or phase by phase.

Every replay resets the controller, presents the states in the order of time, and keeps every command, so that what
was timed can be compared with what should have come out. Keeping the command happens outside the timed span. A replay
goes on block by block, so that several can be interleaved.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter_ns

import numpy as np

from comparison.measure.controllers import Contender
from comparison.measure.statistics import Laps
from harpy_pin.controllers import GovernedController, WholeBodyController
from harpy_pin.model.state import Command, State, Vector

__all__ = [
    "GOVERNED_PHASES",
    "WBC_PHASES",
    "GovernedChain",
    "TickReplay",
    "WholeBodyChain",
    "replay",
    "timer_overhead",
    "without_gc",
]


GOVERNED_PHASES = ("plan", "governor", "actuate")
"""Gait and measurement; governor; thruster law, inverse kinematics and joint PID."""

WBC_PHASES = ("kinematics", "build", "solve", "finish")
"""Gait and rigid-body terms; task accelerations and the program's arrays; ProxQP; torques and thrusts."""


class TickReplay:
    """Times the complete tick, ``step(state)``.

    Attributes:
        phases: names of the columns of :attr:`laps`.
        laps: (ticks, phases) exclusive times, ns; their sum over a row is the tick.
        commands: (ticks, joints + 3 thrusters) torques (N·m) and thrusts (N).
    """

    phases: tuple[str, ...] = ("tick",)

    def __init__(self, controller: Contender) -> None:
        self.controller = controller
        self.start(())

    def start(self, states: Sequence[State]) -> None:
        """Begin a sequence: the controller forgets the one before."""
        robot = self.controller.robot
        self.states = states
        self.laps: Laps = np.zeros((len(states), len(self.phases)), dtype=np.int64)
        self.commands: Vector = np.full((len(states), len(robot.joints) + 3 * len(robot.thrusters)), np.nan)
        self.controller.reset()

    def time_block(self, begin: int, end: int) -> None:
        """Replay the states from ``begin`` to before ``end``; blocks must follow each other."""
        step, clock = self.controller.step, perf_counter_ns
        for i in range(begin, min(end, len(self.states))):
            state = self.states[i]
            t0 = clock()
            command = step(state)
            t1 = clock()
            self.laps[i, 0] = t1 - t0
            self._keep(i, command)

    def _keep(self, i: int, command: Command) -> None:
        row, joints = self.commands[i], len(command.torque)
        row[:joints] = command.torque
        row[joints:] = command.thrust.ravel()


class GovernedChain(TickReplay):
    """Times the phases of :data:`GOVERNED_PHASES`; each ends where the next begins."""

    phases = GOVERNED_PHASES
    controller: GovernedController

    def time_block(self, begin: int, end: int) -> None:
        """See :meth:`TickReplay.time_block`."""
        plan, govern, actuate = self.controller.plan, self.controller.govern, self.controller.actuate
        clock = perf_counter_ns
        for i in range(begin, min(end, len(self.states))):
            state = self.states[i]
            t0 = clock()
            plan(state)
            t1 = clock()
            govern(state)
            t2 = clock()
            command = actuate(state)
            t3 = clock()
            self.laps[i] = t1 - t0, t2 - t1, t3 - t2
            self._keep(i, command)


class WholeBodyChain(TickReplay):
    """Times the phases of :data:`WBC_PHASES`; each ends where the next begins."""

    phases = WBC_PHASES
    controller: WholeBodyController

    def time_block(self, begin: int, end: int) -> None:
        """See :meth:`TickReplay.time_block`."""
        c, clock = self.controller, perf_counter_ns
        prepare, build, solve, finish = c.prepare, c.build, c.solve, c.finish
        for i in range(begin, min(end, len(self.states))):
            state = self.states[i]
            t0 = clock()
            prepare(state)
            t1 = clock()
            build(state)
            t2 = clock()
            solve()
            t3 = clock()
            command = finish(state)
            t4 = clock()
            self.laps[i] = t1 - t0, t2 - t1, t3 - t2, t4 - t3
            self._keep(i, command)


def replay(timer: TickReplay, states: Sequence[State]) -> TickReplay:
    """Replay a whole sequence in one go.

    Returns:
        The timer, with its times and commands.
    """
    timer.start(states)
    timer.time_block(0, len(states))
    return timer


@contextmanager
def without_gc() -> Iterator[None]:
    """Collect garbage now, and not again until the end."""
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def timer_overhead() -> float:
    """Median difference of two readings of the clock with nothing between them, ns."""
    laps, clock = np.zeros(20_000, dtype=np.int64), perf_counter_ns
    for i in range(len(laps)):
        begin = clock()
        laps[i] = clock() - begin
    return float(np.median(laps))
