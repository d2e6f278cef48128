"""What the controllers of this package share: states of any form are converted, and bad samples are answered."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import FullGait, Gait, GaitTarget, check_target, own_target
from harpy_pin.model.dynamics import Dynamics
from harpy_pin.model.entry import FADE, HOLD_TICKS, MISFIT, as_state
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.rotor import write_thrusts
from harpy_pin.model.state import Command, State, Vector

__all__ = ["GaitController", "fill_thrusts", "make_command"]


class GaitController(KeepsViews, ABC):
    """A controller that follows a gait.

    A sample is bad where its time is not finite or beyond 1e9 s, where a measurement that the controller reads, or the
    gait's target of the body at its time, is beyond ``MAX_SAMPLE`` = 1e6 in SI units, where a measurement is not
    finite, or where the quaternion is not of unit length (0.7 to 1.4). For ``HOLD_TICKS`` = 20 bad samples in a row the
    last good command is held, then it fades by ``FADE`` = 0.9 a tick. Nothing else of the controller moves meanwhile,
    so the next good sample is answered as if the bad ones had never come.

    Args:
        gait: where body and feet should be; the controller takes its own copy of a library's gait, with targets of its
            own, so that one gait may serve several controllers.
        period: time between ticks, s.

    Attributes:
        target: the gait's targets of the last tick.
        bad_samples: how many there were since the last reset.
    """

    _command: Command  # of the last tick; made by the class below, written in place

    def __init__(self, gait: Gait, period: float) -> None:
        self.gait: FullGait = own_target(gait)
        self.robot = gait.robot
        self.period = period
        self.target: GaitTarget = self.gait.target
        self._observe: Callable[[State], None] | None = getattr(self.gait, "observe", None)
        self._gait_signals: Callable[[], Mapping[str, ArrayLike]] = getattr(self.gait, "telemetry", dict)
        self.bad_samples = 0
        self._bad_in_a_row = 0  # the class below sets it to zero at a good sample
        self._convert = False  # whether states come in a form that kernels do not take

    def __repr__(self) -> str:
        gait = type(self.gait).__name__
        return f"{type(self).__name__}('{self.robot.name}', {gait}, period {1e3 * self.period:g} ms)"

    def reset(self) -> None:
        """Forget the bad samples."""
        self.bad_samples = self._bad_in_a_row = 0

    def step(self, state: State) -> Command:
        """One tick: joint torques and thrusts.

        Raises:
            InputError: an array of the state has the wrong shape, or no numbers.
        """
        if self._convert:
            state = as_state(state, self.robot)
        try:
            return self._phases(state)
        except Exception:
            fit = as_state(state, self.robot)
            if fit is state:
                raise
            self._convert = True
        return self.step(fit)

    def _plan(self, state: State) -> GaitTarget:
        """Targets of the gait at a state whose time is finite, checked where they are another object than before."""
        if self._observe is not None:
            self._observe(state)
        target = self.gait.update(state.t)
        if target is not self.target:
            self.target = check_target(target, self.robot)
        return target

    @abstractmethod
    def _phases(self, state: State) -> Command:
        """The controller's public methods of one tick, one after the other."""

    def _answer_bad(self, verdict: int, state: State) -> None:
        """Hold or fade the last good command, in place.

        Args:
            verdict: what a kernel returned in the place of ``GOOD``, see :mod:`harpy_pin.model.entry`.
            state: that it was given.

        Raises:
            InputError: the verdict is ``MISFIT``; the message says whether the state or the gait's targets are wrong.
        """
        if verdict == MISFIT:
            as_state(state, self.robot)
            turns = all(isfinite(x) for x in self.target.body) and bool(self.target.heading[0])
            message = "the gait turns, and this controller faces x" if turns else "the gait's targets are no numbers"
            raise InputError(message, name="gait", value=self.gait)
        self.bad_samples += 1
        self._bad_in_a_row += 1
        if self._bad_in_a_row > HOLD_TICKS:
            self._command.torque *= FADE
            self._command.thrust *= FADE


def make_command(dynamics: Dynamics, inputs: Vector, *, apart: bool = False) -> Command:
    """A command whose torques are the last of some inputs, written in place, and whose thrusts are the first.

    Free thrusters have the inputs' own memory; with rotors :func:`fill_thrusts` fills in the thrusts.

    Args:
        dynamics: of the robot.
        inputs: (thrust variables + joints,) [u; τ].
        apart: whether the thrusts have memory of their own in any case.
    """
    robot, thrusts = dynamics.robot, dynamics.robot.n_thrust
    if not robot.rotors and not apart:
        return Command(inputs[thrusts:], inputs[:thrusts].reshape(-1, 3))
    forces = np.zeros((len(robot.thrusters), 3))
    command = Command(inputs[thrusts:], forces)
    write_thrusts.prepare(dynamics.record, inputs, forces)
    fill_thrusts(dynamics, inputs, command)  # the first call takes milliseconds
    return command


def fill_thrusts(dynamics: Dynamics, inputs: Vector, command: Command) -> None:
    """Write the thrusts of inputs into a command, of rotors along the axes of the last update of the dynamics."""
    write_thrusts(dynamics.record, inputs, command.thrust)
