"""A controller and a simulator in closed loop, tick by tick, and how the run ended."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter_ns
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin.errors import InputError, RunFileError, reason
from harpy_pin.files import Shield, check_writable, replaceable
from harpy_pin.log.journal import Journal
from harpy_pin.log.recorder import BLOCK, Recorder
from harpy_pin.log.run import Run, describe_versions
from harpy_pin.log.run_file import FORMAT
from harpy_pin.model.robot import Robot
from harpy_pin.model.source import plain_source
from harpy_pin.model.state import Command, State
from harpy_pin.simulation.push import Push
from harpy_pin.simulation.sensors import Sensors
from harpy_pin.simulation.step import VERDICTS

if TYPE_CHECKING:
    from harpy_pin.simulation.plant import Plant
    from harpy_pin.simulation.sensing import EstimatedState

REPORT = 100
"""Ticks in Python between two reports of progress."""


@runtime_checkable
class Controller(Protocol):
    """Anything with ``step(state) -> Command``.

    Members that are used where they are there:

    - ``period``: time between ticks, s (1 ms where there is none);
    - ``reset()``: forget the past, that is integrals, applied references and warm starts;
    - ``telemetry() -> Mapping[str, ArrayLike]``: signals of the last tick to log, the same names
      and shapes each tick;
    - ``describe() -> Mapping[str, Any]``: parameters, for the log's metadata.

    All controllers of this library have all four.
    """

    def step(self, state: State) -> Command:
        """Command of one tick; its arrays may be overwritten by the next.

        Args:
            state: what was measured; its arrays belong to the caller, and are overwritten by the
                next tick.
        """
        ...


class RunLog:
    """The rows of a run: on disk while it goes on where they have a file, and the whole log at its
    end.

    Args:
        plant: that runs.
        save: file of the log; in memory without one.
        describe: metadata of a run by its ending.
        block: rows that are written at a time.

    Attributes:
        recorder: takes the rows.

    Raises:
        RunFileError: the file cannot be written.
    """

    def __init__(
        self,
        plant: Plant,
        save: str | Path | None,
        describe: Callable[[str], dict[str, Any]],
        *,
        block: int = BLOCK,
    ) -> None:
        self._plant, self._save, self._describe = plant, save, describe
        self._journal: Journal | None = None
        if save is not None:
            check_writable(save)
            if replaceable(save):
                self._journal = Journal(save, {**describe("unfinished"), "format": FORMAT})
        self.recorder = Recorder(self._journal, block=block)

    def close(self, ending: str) -> Run:
        """The run, written in its place; a file is left as it is where nothing was logged.

        Raises:
            RunFileError: it cannot be written. The error has the run, and says where its rows are.
        """
        metadata, journal = self._describe(ending), self._journal
        if len(self.recorder) == 0:
            signals = self._plant.signals
            run = Run({name: np.zeros((0, *one.shape)) for name, one in signals.items()}, metadata)
        else:
            self.recorder.flush()
            if journal is not None:
                journal.end({**metadata, "format": FORMAT})
            run = Run(self.recorder.take(), metadata)
            try:
                if self._save is not None:
                    run.save(self._save)
            except RunFileError as error:
                kept = ""
                if journal is not None:
                    journal.close()
                    kept = f"; its rows are in '{journal.path}'"
                    if journal.error is not None:
                        kept = f"; '{journal.path}' holds its beginning"
                raise RunFileError(f"{error}{kept}", path=self._save, run=run) from error
        if journal is not None:
            journal.remove()
        return run


@dataclass
class ClosedLoop:
    """A closed loop, and how far it came: :attr:`ending` and :attr:`failure` are kept whatever ends
    it.

    Attributes that :meth:`harpy_pin.simulation.plant.Plant.run` does not have:
        ticks: at most.
        substeps: physics steps of a tick.
        ending: see :attr:`harpy_pin.log.run.Run.ending`.
        failure: what the controller raised.
    """

    simulator: Plant
    controller: Controller
    recorder: Recorder
    ticks: int
    period: float
    substeps: int
    on_tick: Callable[[State], None] | None
    on_piece: Callable[[float], None] | None
    pushes: Sequence[Push]
    sensors: Sensors | EstimatedState | None
    ending: str = "completed"
    failure: Exception | None = None

    def run(self, shield: Shield) -> None:
        """Walk tick by tick until the last one, a fall, or a controller that fails; no signal cuts
        a row in two.
        """
        simulator, tick, compiled = self.simulator, 0, None
        simulator.counts[:] = 0
        height = float(simulator.q[2]) - simulator.ground_below
        start, fall_height = simulator.t, 0.6 * height if height > 0.0 else -math.inf
        self._telemetry = self._signals if hasattr(self.sensors, "signals") else self._of_controller
        while tick < self.ticks and self.ending == "completed":
            if compiled is not None:
                with shield.whole():
                    done, ending = compiled.run(tick, self.ticks, self.pushes)
                tick += done
                if self.on_piece is not None:
                    self.on_piece(simulator.t)
                if ending >= 0:
                    self.ending = VERDICTS[ending]
                    continue
            simulator.t = start + tick * self.period
            command = self._control(shield)
            if command is None:
                return
            with shield.whole():
                simulator.advance(command, self.pushes, steps=self.substeps)
                self.ending = simulator.verdict(fall_height)
            if self.ending != "completed":
                return
            if tick == 0 and self.on_tick is None and self.sensors is None:
                rules = {"start": start, "period": self.period, "fall_height": fall_height}
                compiled = simulator.compile_loop(
                    self.controller, self.recorder, substeps=self.substeps, **rules
                )
            tick += 1
            if self.on_piece is not None and tick % REPORT == 1:
                self.on_piece(simulator.t)

    def _of_controller(self) -> Mapping[str, ArrayLike]:
        """Signals of the controller."""
        signals: Mapping[str, ArrayLike] = getattr(self.controller, "telemetry", dict)()
        return signals

    def _signals(self) -> Mapping[str, ArrayLike]:
        """Signals of the controller and of the sensors."""
        return {**self._of_controller(), **getattr(self.sensors, "signals", {})}

    def _control(self, shield: Shield) -> Command | None:
        """The command at the present state, logged; None where the controller failed."""
        state = self.simulator.state
        try:
            if self.on_tick is not None:
                self.on_tick(state)
            measured = state if self.sensors is None else self.sensors.measure(state)
            begin = perf_counter_ns()
            command = self.controller.step(measured)
            elapsed = perf_counter_ns() - begin
            if not isinstance(command, Command):
                raise InputError(
                    f"step() must return a Command, got {type(command).__name__}", name="command"
                )
            command = self.simulator.checked(command)
            with shield.whole():
                self.simulator.log(self.recorder, command, elapsed, self._telemetry)
        except Exception as error:
            self.ending, self.failure = f"controller failed: {reason(error)}", error
            return None
        return command


def run_metadata(
    simulator: Plant, controller: Controller, ending: str, period: float, pushes: Sequence[Push]
) -> dict[str, Any]:
    """How the run came about and how it ended."""
    return {
        "ending": ending,
        "end_time": simulator.t,
        "control_period": period,
        "dt": simulator.dt,
        "gravity": simulator.gravity.tolist(),
        "plant": dict(simulator.describe()),
        "ground": simulator.ground.to_dict(),
        **about(simulator.robot, controller),
        "torque_limit": plain_source(
            simulator.robot.torque_limit * min(simulator.actuators.torque_share or 1.0, 1.0)
        ),
        "pushes": [asdict(push) for push in pushes],
        "contact_sweeps_max": int(simulator.counts[0]),
        "contact_unconverged": int(simulator.counts[1]),
        **({"thrusts_projected": int(simulator.counts[2])} if simulator.robot.rotors else {}),
    }


def about(robot: Robot, controller: Any) -> dict[str, Any]:
    """What a log says of robot and controller."""
    return {
        "robot": robot.name,
        **({} if robot.label or not robot.source else {"robot_source": plain_source(robot.source)}),
        "mass": robot.mass,
        "feet": list(robot.feet),
        "thrusters": list(robot.thrusters),
        "torque_limit": plain_source(robot.torque_limit),
        "controller": type(controller).__name__,
        "parameters": dict(getattr(controller, "describe", dict)()),
        "versions": describe_versions(),
    }
