"""What the controllers of this package share: states of any form are converted, and bad samples are
answered.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict
from math import isfinite
from threading import RLock
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin.controllers.parameters import GovernedParameters, WholeBodyParameters
from harpy_pin.controllers.tick import BAD_SAMPLE, TickRecord
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import LONGEST, Gait, GaitTarget, Unobserved, check_target, own_target
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.kernels.calls import Call, Chain
from harpy_pin.model.entry import MISFIT, as_state
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.record import Records, field
from harpy_pin.model.state import Command, State, Vector


class GaitController(KeepsViews, ABC):
    """A controller that follows a gait.

    A sample is bad where its time is not finite or beyond 1e9 s, where a measurement that the
    controller reads, or the gait's target of the body at its time, is beyond ``MAX_SAMPLE`` = 1e6
    in SI units, where a measurement is not finite, or where the quaternion is not of unit length
    (0.7 to 1.4). For ``HOLD_TICKS`` = 20 bad samples in a row the last good command is held, then
    it fades by ``FADE`` = 0.9 a tick. Nothing else of the controller moves meanwhile, so the next
    good sample is answered as if the bad ones had never come; only joint targets begin anew.

    Where several threads call one controller, a tick waits for another's end; they share its
    command.

    Args:
        gait: where body and feet should be. Of one that never changes the controller takes a copy
            with targets of its own; every other gait serves one controller.
        period: time between ticks, s.

    Attributes:
        target: the gait's targets of the last tick.
        command: arrays of the torques and thrusts of the last tick, and of the motors' law where
            there is one; overwritten by the next.
        acceleration: (nv,) of all coordinates that the last command intends, for
            :meth:`~harpy_pin.estimation.estimator.Estimator.step`; None where a controller has
            none.
    """

    _made_anew: ClassVar[tuple[str, ...]] = ("_step", "_parts", "_chain", "_lock")
    _step: Kernel[int]  # of a tick: record, targets, what was measured, and further parts
    _parts: tuple[NDArray[Any], ...] = ()
    _in_python = False  # whether a tick is Python's, not that kernel alone
    _chain: Chain | None = None  # gait and controller in one crossing from Python
    _chained = False  # whether that was looked for
    parameters: GovernedParameters | WholeBodyParameters
    _record_: Records[Any]  # of the controller
    _intended: Vector | None = None  # acceleration of the last command
    _command: Command  # of the last tick, in the record
    _signals: dict[str, ArrayLike]  # of the last tick, by name

    @property
    def acceleration(self) -> Vector | None:
        """The motion that the last command intends (nv,)."""
        return self._intended

    def __init__(self, gait: Gait, parameters: GovernedParameters | WholeBodyParameters) -> None:
        self.gait = own_target(gait)
        self.robot = gait.robot
        self.parameters, self.period = parameters, parameters.period
        self.target: GaitTarget = self.gait.target
        self._convert = False  # whether states come in a form that kernels do not take

    def _begin(self, record: Records[Any]) -> None:
        """Take up the record of the controller, and begin to compile its tick."""
        self._record_ = record
        self._command = Command(field(record, "torque"), field(record, "thrust"))
        self.command: tuple[Vector, ...] = (self._command.torque, self._command.thrust)
        if "motors" in (record.dtype.names or ()):
            self._command.law = field(record["motors"], "law")
            self.command += (self._command.law,)
        self._bad_samples, self._verdict = field(record, "bad_samples"), field(record, "verdict")
        self._signals = {"bad_samples": self._bad_samples}
        q, v = self.gait.initial_state()
        self._sample = (q.copy(), v.copy(), *np.zeros((3, len(self.robot.feet), 3)))
        self._nothing = (np.full(q.shape, np.nan), *self._sample[1:])
        self._make_anew()

    @abstractmethod
    def _make_anew(self) -> None:
        """Choose the kernel of the tick, :attr:`_step`."""
        self._chain, self._chained, self._lock = None, False, RLock()

    measured: ClassVar[tuple[str, ...]] = ("q", "v", "foot_force")
    """Measurements of a state, in the order of the kernel's arguments."""

    def _measured(self, state: State) -> tuple[Vector, ...]:
        """What the kernel of the tick takes of a state."""
        return state.q, state.v, state.foot_force

    def __repr__(self) -> str:
        gait = type(self.gait).__name__
        return (
            f"{type(self).__name__}('{self.robot.name}', {gait}, period {1e3 * self.period:g} ms)"
        )

    def reset(self) -> None:
        """Forget the last command, and the bad samples."""
        for name in ("verdict", "bad_samples", "bad_in_a_row", "torque", "thrust"):
            self._record_[name] = 0

    @property
    def bad_samples(self) -> int:
        """How many bad samples there were since the last reset."""
        return int(self._bad_samples)

    def step(self, state: State) -> Command:
        """One tick: joint torques and thrusts.

        Raises:
            InputError: an array of the state has the wrong shape, or no numbers.
        """
        chain = self._chain
        if chain is not None:
            status = chain(state)
            if status is not None:
                if status == BAD_SAMPLE:
                    self._refuse_misfit(state)
                return self._command
        with self._lock:
            self._chain = None  # so that other threads wait here
            try:
                if self._convert:
                    state = as_state(state, self.robot)
                try:
                    return self._tick(state)
                except Exception:
                    fit = as_state(state, self.robot)
                    if fit is state:
                        raise
                    self._convert = True
                return self._tick(fit)
            finally:
                self._chain = self._chain or chain

    def _plan(self, state: State) -> GaitTarget:
        """Targets of the gait at a state whose time is finite, checked where they are another
        object than before.
        """
        self.gait.observe(state)
        target = self.gait.update(state.t)
        if target is not self.target:
            self.target = check_target(target, self.robot)
        return target

    def _tick(self, state: State) -> Command:
        """One tick: the gait's targets, then everything else.

        A time at which no gait has targets is answered as a bad sample; so is all before a gait has
        seen a good one.
        """
        answer, target = self._answer_in_python if self._in_python else self._answer, None
        if -LONGEST < state.t < LONGEST:
            try:
                target = self._plan(state)
            except Unobserved:
                target = None
        if target is None:
            status = answer(self.target._record_, State(0.0, *self._nothing))
        else:
            status = answer(target._record_, state)
            if not self._chained:
                self._join()
        if status == BAD_SAMPLE:
            self._refuse_misfit(state)
        return self._command

    def _answer(self, target: Records[Any], state: State) -> int:
        """Everything after the gait's targets, in one kernel; returns the status of the tick."""
        return self._step(self._record_, target, *self._measured(state), *self._parts)

    def _answer_in_python(self, target: Records[Any], state: State) -> int:
        """Everything after the gait's targets, where a part of it is Python; returns the status of
        the tick.
        """
        raise NotImplementedError

    def telemetry(self) -> Mapping[str, ArrayLike]:
        """Signals of the last tick, by name: those of the controller, then those of its gait."""
        of_target = {"x_r": self.target.body[:6], "stance": self.target.stance}
        return {**of_target, **self._signals, **self.gait.telemetry()}

    def describe(self) -> Mapping[str, Any]:
        """Gait and parameters."""
        return {"gait": dict(self.gait.describe()), "control": asdict(self.parameters)}

    def calls(self, state: State) -> tuple[Call, ...] | None:
        """The kernels of a tick, for a loop in C (:mod:`harpy_pin.simulation.ticks`); None where
        Python takes part.

        Args:
            state: arrays of the measured state, which stay where they are.
        """
        calls = None if self._in_python else self._kernels(state)
        return None if calls is None else (*calls, Call(sample_fits, self._record_, expected=True))

    def _kernels(self, state: State) -> tuple[Call, ...] | None:
        """The kernels of gait and controller; None where one of them does more, as a class of the
        user's may.
        """
        calls = self.gait.calls(state)
        if calls is None or not type(self).__module__.startswith("harpy_pin."):
            return None
        measured = self._measured(state)
        return *calls, Call(
            self._step, self._record_, self.target._record_, *measured, *self._parts
        )

    def _join(self) -> None:
        """Join the kernels of gait and controller, so that one crossing from Python calls all of
        them.
        """
        self._chained = True
        if not self._in_python:
            self._chain = self._joined()

    def _joined(self) -> Chain | None:
        """The kernels of gait and controller in one; None where that cannot be."""
        state = State(0.0, *self._sample)
        calls = self._kernels(state)
        if calls is None:
            return None
        measured = dict(zip(self.measured, self._measured(state), strict=True))
        others = [
            getattr(state, name)
            for name in ("foot_position", "foot_velocity")
            if name not in measured
        ]
        if any(one is array for call in calls for one in call.arguments for array in others):
            return None  # the gait takes more of a state than the controller does
        return Chain(calls, measured, longest=LONGEST)

    def _refuse_misfit(self, state: State) -> None:
        """Raise where a sample was no bad one, but one of another robot, or the gait's targets are
        no numbers.
        """
        if self._verdict == MISFIT:
            as_state(state, self.robot)
            turns = all(isfinite(x) for x in self.target.body) and bool(self.target.heading[0])
            message = (
                "the gait turns, and this controller faces x"
                if turns
                else "the gait's targets are no numbers"
            )
            raise InputError(message, name="gait", value=self.gait)


@kernel
def sample_fits(r: TickRecord) -> bool:
    """Whether the last sample and targets were of the robot's sizes, and the targets numbers."""
    return r.verdict != MISFIT
