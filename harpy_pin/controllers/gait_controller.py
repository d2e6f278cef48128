"""What the controllers of this package share: one tick, which takes states of any form, and answers
bad samples.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from math import isfinite
from operator import attrgetter
from threading import RLock
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin.controllers.parameters import GovernedParameters, WholeBodyParameters
from harpy_pin.controllers.tick import BAD_SAMPLE, NO_OPTIMUM, TickRecord
from harpy_pin.errors import InputError
from harpy_pin.gaits.gait import LONGEST, Gait, GaitTarget, Unobserved, check_target, own_target
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.kernels.calls import Call, Chain
from harpy_pin.model.entry import MISFIT, as_state
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.record import Records, field
from harpy_pin.model.state import Command, State, Vector

Tick = Callable[[State], int | None]
"""A tick, or a part of it, in C: its status, or None where Python has to go on."""
_FEET = ("foot_position", "foot_velocity")


def _python(state: State) -> None:
    """The tick that C knows nothing of."""


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

    measured: ClassVar[tuple[str, ...]] = ("q", "v", "foot_force")
    """Measurements of a state, in the order of the kernel's arguments."""
    _rebuilt: ClassVar[tuple[str, ...]] = (
        *("_step", "_parts", "_entry", "_joined", "_accept", "_lock"),
    )
    _measured: ClassVar[attrgetter[tuple[Vector, ...]]] = attrgetter(*measured)
    _step: Kernel[int]  # of a tick up to what is Python: record, targets, sample, further parts
    _parts: tuple[NDArray[Any], ...] = ()
    _in_python = False  # whether Python goes on after that kernel
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
        self._nothing = self._measured(State(0.0, np.full(q.shape, np.nan), *self._sample[1:]))
        self._rebuild()

    @abstractmethod
    def _rebuild(self) -> None:
        """Choose the kernel of the tick, :attr:`_step`."""
        self._lock = RLock()
        self._entry: Tick = _python  # of a state in one crossing from Python: the whole tick,
        self._joined: Tick = _python  # gait and kernel,
        self._accept: Tick = _python  # or only the sample, whose types and shapes are checked

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
        status = self._entry(state)
        if status is None:  # it is not as C takes it, or Python takes part
            with self._lock:
                self._entry = _python  # so that other threads wait here
                try:
                    status = self._tick(state)
                finally:
                    self._entry = _python if self._in_python else self._joined
        if status >= NO_OPTIMUM:
            self._tell(status, state)
        return self._command

    def _tick(self, state: State) -> int:
        """One tick, a stage after the other: the sample, the gait, then everything else."""
        status = self._joined(state)
        if status is None and self._accept(state) is None:
            state = as_state(state, self.robot)
            status = self._joined(state)
        if status is None:
            sample = self._plan(state)
            status = self._step(self._record_, self.target._record_, *sample, *self._parts)
            if self._accept is _python and sample is not self._nothing:  # the gait has begun
                self._join()
        return self._go_on(status, state) if self._in_python else status

    def _plan(self, state: State) -> tuple[Vector, ...]:
        """Targets of the gait in Python; the sample, which is no numbers where it has none.

        A time at which no gait has targets is answered as a bad sample; so is all before a gait has
        seen a good one.
        """
        if -LONGEST < state.t < LONGEST:
            with suppress(Unobserved):
                self.gait.observe(state)
                target = self.gait.update(state.t)
                if target is not self.target:
                    self.target = check_target(target, self.robot)
                return self._measured(state)
        return self._nothing

    def _go_on(self, status: int, state: State) -> int:
        """What is Python's of a tick, after its kernel; returns the status of the tick."""
        raise NotImplementedError

    def _join(self) -> None:
        """Join gait and kernel, so that one crossing from Python calls both."""
        state = State(0.0, *self._sample)
        memory = {name: getattr(state, name) for name in (*self.measured, *_FEET)}
        self._accept = Chain((), memory, longest=LONGEST)
        calls = self._calls(state)
        others = [memory.pop(name) for name in _FEET if name not in self.measured]
        if calls is not None and not any(  # else the gait takes more of a state than the controller
            one is array for call in calls for one in call.arguments for array in others
        ):
            self._joined = Chain(calls, memory, longest=LONGEST)

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
        calls = None if self._in_python else self._calls(state)
        return None if calls is None else (*calls, Call(sample_fits, self._record_, expected=True))

    def _calls(self, state: State) -> tuple[Call, ...] | None:
        """Gait and kernel; None where one of them does more, as a class of the user's may."""
        calls = self.gait.calls(state)
        if calls is None or not type(self).__module__.startswith("harpy_pin."):
            return None
        record, target = self._record_, self.target._record_
        return *calls, Call(self._step, record, target, *self._measured(state), *self._parts)

    def _tell(self, status: int, state: State) -> None:
        """Say what the user can do about a tick without an optimum."""
        if status == BAD_SAMPLE:
            self._refuse_misfit(state)

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
