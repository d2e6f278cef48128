"""A controller and a simulator in closed loop, tick by tick, and how the run ended."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter_ns
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from harpy_pin import checks
from harpy_pin.compiled import kernel
from harpy_pin.errors import ControlError, InputError, Interrupted, RunFileError, reason
from harpy_pin.files import Shield, check_writable, replaceable
from harpy_pin.log.journal import Journal
from harpy_pin.log.recorder import BLOCK, Recorder
from harpy_pin.log.run import Run, describe_versions
from harpy_pin.log.run_file import FORMAT, MAX_STEP
from harpy_pin.model.entry import is_finite
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.simulation.push import Push, check_pushes
from harpy_pin.simulation.sensors import Sensors
from harpy_pin.simulation.step import VERDICTS

if TYPE_CHECKING:
    from harpy_pin.simulation.plant import Plant

__all__ = ["Controller", "keep_run", "prepare_loop", "run_closed_loop", "run_metadata"]

TOLD = 100
"""Ticks in Python after which progress is told."""
FLOAT64 = np.dtype(np.float64)


@runtime_checkable
class Controller(Protocol):
    """Anything with ``step(state) -> Command``.

    Members that are used where they are there:

    - ``period``: time between ticks, s (1 ms where there is none);
    - ``reset()``: forget the past, that is integrals, applied references and warm starts;
    - ``telemetry() -> Mapping[str, ArrayLike]``: signals of the last tick to log, the same names and shapes each tick;
    - ``describe() -> Mapping[str, Any]``: parameters, for the log's metadata.

    All controllers of this library have all four.
    """

    def step(self, state: State) -> Command:
        """Command of one tick; its arrays may be overwritten by the next.

        Args:
            state: what was measured; its arrays belong to the caller, and are overwritten by the next tick.
        """
        ...


def run_closed_loop(
    simulator: Plant,
    controller: Controller,
    duration: float,
    *,
    control_period: float | None,
    metadata: Mapping[str, object] | None,
    on_tick: Callable[[State], None] | None,
    on_piece: Callable[[float], None] | None,
    pushes: Sequence[Push],
    sensors: Sensors | None,
    save: str | Path | None,
) -> Run:
    """What :meth:`harpy_pin.simulation.plant.Plant.run` does, with the same arguments and errors."""
    duration = checks.number("duration", duration, low=0.0, strict=True)
    period = getattr(controller, "period", 1e-3) if control_period is None else control_period
    period = checks.number("control_period", period, low=0.0, high=MAX_STEP, strict=True)
    substeps = checks.multiple("control_period", period, "physics step", simulator.dt)
    ticks = checks.ticks(duration, period)
    check_pushes(pushes, simulator.t, simulator.t + ticks * period)
    checks.function("on_tick", on_tick, 1)
    checks.function("on_piece", on_piece, 1)
    metadata = {} if metadata is None else checks.mapping("metadata", metadata)

    def describe(ending: str) -> dict[str, Any]:
        return {**metadata, **run_metadata(simulator, controller, ending, period, pushes)}

    journal = None
    if save is not None:
        check_writable(save)
        if replaceable(save):
            journal = Journal(save, {**describe("unfinished"), "format": FORMAT})
    recorder = Recorder(journal, block=min(max(round(1.0 / period), 1), BLOCK))
    loop = _Loop(simulator, controller, recorder, ticks, period, substeps, on_tick, on_piece, pushes, sensors)
    with Shield() as shield:
        try:
            loop.run(shield)
        except KeyboardInterrupt:
            loop.ending = "interrupted"
        finally:
            shield.saving = True
            recorder.flush()
        run, unsaved = keep_run(simulator, recorder, describe(loop.ending), journal, save)
        interrupted = loop.ending == "interrupted" or shield.late is not None
        shield.late = None
    lost = "" if unsaved is None else f"; {unsaved}"
    if interrupted:
        raise Interrupted(f"interrupted at t = {simulator.t:.3f} s{lost}", run=run) from unsaved
    if loop.failure is not None:
        message = f"at t = {simulator.t:.3f} s the {loop.ending}{lost}"
        raise ControlError(message, time=simulator.t, run=run) from loop.failure
    if unsaved is not None:
        raise unsaved
    return run


def prepare_loop(robot: Robot) -> None:
    """Begin to compile the kernels of the loop for a robot."""
    _finite.prepare(np.zeros(len(robot.joints)), np.zeros((len(robot.thrusters), 3)))


def keep_run(
    plant: Plant, recorder: Recorder, metadata: dict[str, Any], journal: Journal | None, save: str | Path | None
) -> tuple[Run, RunFileError | None]:
    """The run, and why it could not be written if it was to be. A file is left as it is where nothing was logged."""
    if len(recorder) == 0:
        if journal is not None:
            journal.remove()
        return Run({name: np.zeros((0, *array.shape)) for name, array in plant.signals.items()}, metadata), None
    recorder.flush()
    if journal is not None:
        journal.end({**metadata, "format": FORMAT})
    run, unsaved = Run(recorder.take(), metadata), None
    try:
        if save is not None:
            run.save(save)
    except RunFileError as error:
        kept = ""
        if journal is not None:
            where = f"'{journal.path}'"
            kept = f"; its rows are in {where}" if journal.error is None else f"; {where} holds its beginning"
            journal.close()
        unsaved = RunFileError(f"{error}{kept}", path=save)
        unsaved.run = run
    else:
        if journal is not None:
            journal.remove()
    return run, unsaved


@dataclass
class _Loop:
    """A closed loop, and how far it came: :attr:`ending` and :attr:`failure` are kept whatever ends it.

    Attributes:
        simulator: whose state goes on.
        controller: that is run.
        recorder: of the log.
        ticks: at most.
        period: between ticks, s.
        substeps: physics steps of a tick.
        on_tick: as of :meth:`harpy_pin.simulation.plant.Plant.run`, likewise on_piece, pushes and sensors.
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
    sensors: Sensors | None
    ending: str = "completed"
    failure: Exception | None = None

    def run(self, shield: Shield) -> None:
        """Walk tick by tick until the last one, a fall, or a controller that fails; no signal cuts a row in two."""
        simulator, tick, compiled = self.simulator, 0, None
        simulator.counts[:] = 0
        height = float(simulator.q[2]) - simulator.ground_below
        start, fall_height = simulator.t, 0.6 * height if height > 0.0 else -math.inf
        self._telemetry = getattr(self.controller, "telemetry", None)
        self._shapes = ((len(simulator.robot.joints),), (len(simulator.robot.thrusters), 3))
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
                compiled = simulator.compile_loop(self.controller, self.recorder, substeps=self.substeps, **rules)
            tick += 1
            if self.on_piece is not None and tick % TOLD == 1:
                self.on_piece(simulator.t)

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
            command = _checked(command, self._shapes)
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
    describe = getattr(controller, "describe", None)
    robot = simulator.robot
    return {
        "ending": ending,
        "end_time": simulator.t,
        "control_period": period,
        "dt": simulator.dt,
        "gravity": simulator.gravity.tolist(),
        "plant": dict(simulator.describe()),
        "ground": simulator.ground.to_dict(),
        "robot": robot.name,
        "mass": robot.mass,
        "feet": list(robot.feet),
        "thrusters": list(robot.thrusters),
        "pushes": [asdict(push) for push in pushes],
        "contact_sweeps_max": int(simulator.counts[0]),
        "contact_unconverged": int(simulator.counts[1]),
        **({"thrusts_projected": int(simulator.counts[2])} if robot.rotors else {}),
        "controller": type(controller).__name__,
        "parameters": dict(describe()) if describe is not None else {},
        "versions": describe_versions(),
    }


def _checked(command: Command, shapes: tuple[tuple[int], tuple[int, int]]) -> Command:
    """A command as float64 arrays; raises unless it has the right shapes and finite entries."""
    if not isinstance(command, Command):
        raise InputError(f"step() must return a Command, got {type(command).__name__}", name="command")
    torque, thrust = command.torque, command.thrust
    if (
        getattr(torque, "dtype", None) is FLOAT64
        and getattr(thrust, "dtype", None) is FLOAT64
        and (torque.shape, thrust.shape) == shapes
        and _finite(torque, thrust)
    ):
        return command
    return Command(
        checks.vector("command.torque", torque, shapes[0]), checks.vector("command.thrust", thrust, shapes[1])
    )


@kernel
def _finite(torque: Vector, thrust: Vector) -> bool:
    """Whether every entry is finite."""
    total = 0.0
    for i in range(torque.shape[0]):
        total += abs(torque[i])
    for k in range(thrust.shape[0]):
        for i in range(3):
            total += abs(thrust[k, i])
    return is_finite(total)
