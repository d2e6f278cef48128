"""Many ticks of a closed loop in one compiled call, where Python has nothing to say between them.

A gait and a controller of this library say how a tick of theirs is computed (:class:`CompiledTick`); the simulator then
runs until the log has a piece full. Every number of the log is the one that the loop in Python gives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter_ns
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled import BACKEND, kernel
from harpy_pin.model.entry import GOOD
from harpy_pin.model.record import Records
from harpy_pin.model.state import Vector
from harpy_pin.simulation.physics import MISFIT_COMMAND, physics_steps
from harpy_pin.simulation.push import Push
from harpy_pin.simulation.terrain.surface import surface_height
from harpy_pin.simulation.upright import upright

if TYPE_CHECKING:
    from harpy_pin.log.recorder import Recorder
    from harpy_pin.model.dynamics import DynamicsRecord
    from harpy_pin.simulation.ground import GroundRecord
    from harpy_pin.simulation.simulator import Simulator
    from harpy_pin.simulation.step import StepRecord

__all__ = ["CompiledLoop", "CompiledTick", "fits", "note_array", "note_nothing"]

PLANT_SIGNALS = (
    "t",
    "q",
    "v",
    "foot_position",
    "foot_velocity",
    "foot_force",
    "slip_path",
    "slip_net",
    "torque",
    "thrust",
    "tick_ns",
)
"""In the order in which :func:`_note_plant` writes them."""
PlantParts = tuple[
    Records["DynamicsRecord"], Records["GroundRecord"], Records["StepRecord"], Vector, Vector, Vector, Vector
]
"""The plant's records, then q, v, torque and thrust."""
HANDED_OVER = -1
"""Ending of a piece whose next tick is Python's: the gait or the controller does not answer as usual."""


@dataclass(frozen=True)
class CompiledTick:
    """What a gait or a controller does in a tick, for compiled code.

    Attributes:
        act: kernel ``act(t, parts)`` of a gait, which returns whether t is a time of it; of a controller
            ``act(parts, q, v, foot_force)``, which returns what the state is (:mod:`harpy_pin.model.entry`).
        note: kernel ``note(parts, row, places, s)``: writes its signals into a row of the log and returns how many
            signals the row has now.
        parts: records and arrays, a tuple.
        signals: names of what ``note`` writes, in its order.
        observe: of a gait that takes the measured state: kernel ``observe(parts, q, v, foot_force)``, called before
            ``act``.
    """

    act: Any
    note: Any
    parts: tuple[Any, ...]
    signals: tuple[str, ...] = ()
    observe: Any = None


class CompiledLoop:
    """A controller and a simulator in one compiled loop.

    Args:
        simulator: the library's own.
        gait: of the controller.
        controller: as it says itself.
        command: (torque, thrust) that the controller writes.
        recorder: of the log; has its first row.
        rules: time of the first tick and period, s, and the body's height below which it has fallen, m.
        substeps: physics steps of a tick.
    """

    def __init__(
        self,
        simulator: Simulator,
        gait: CompiledTick,
        controller: CompiledTick,
        command: tuple[Any, Any],
        recorder: Recorder,
        *,
        rules: tuple[float, float, float],
        substeps: int,
    ) -> None:
        self._simulator, self._recorder, self._rules, self._substeps = simulator, recorder, rules, substeps
        records = (simulator.dynamics.record, simulator._ground, simulator.step_record)
        self._plant = (*records, simulator.q, simulator.v, *command)
        observe = observe_nothing if gait.observe is None else gait.observe
        self._gait = (observe, gait.act, gait.note, gait.parts)
        self._controller = (controller.act, controller.note, controller.parts)
        spans = recorder.layout.spans
        names = (*PLANT_SIGNALS, *controller.signals, *gait.signals)
        self._places = np.array([spans[name][0] for name in names])
        self._compiling = run_ticks.prepare(0, *self._arguments(1))

    def ready(self, *, wait: bool = False) -> bool:
        """Whether it is compiled; a run goes on in Python until then.

        Args:
            wait: until it is.
        """
        if wait:
            self._compiling.result()
        return self._compiling.done()

    def _arguments(self, rows: int) -> tuple[Any, ...]:
        """Of :func:`run_ticks`, but for the first; no pushes yet."""
        push, table = np.zeros((rows * self._substeps, 3)), np.empty((rows, self._recorder.layout.width))
        return (self._substeps, self._rules, self._gait, self._controller, self._plant, push, self._places, table)

    def run(self, tick: int, ticks: int, pushes: Sequence[Push]) -> tuple[int, int]:
        """Ticks until the piece of the log is full.

        Args:
            tick: the next one.
            ticks: of the whole run.
            pushes: forces on the body.

        Returns:
            How many were done, and how it stands: 0, 1 and 2 as :func:`~harpy_pin.simulation.upright.upright` says, or
            ``HANDED_OVER``.
        """
        simulator, recorder, substeps = self._simulator, self._recorder, self._substeps
        start, period, _ = self._rules
        count = min(ticks - tick, recorder.room)
        arguments = self._arguments(count)
        push, rows = arguments[5], arguments[7]
        for n in range(count) if pushes else ():
            simulator.t = start + (tick + n) * period
            push[n * substeps : (n + 1) * substeps] = simulator._push_forces(pushes, substeps)
        done, ending, simulator.sweeps = run_ticks(tick, *arguments)
        recorder.append_table(rows[:done])
        if done:
            simulator.t = start + (tick + done - 1) * period + substeps * simulator.dt
        return done, ending


def fits(recorder: Recorder, gait: CompiledTick, controller: CompiledTick) -> bool:
    """Whether a log has just the signals that the compiled loop writes."""
    names = (*PLANT_SIGNALS, *controller.signals, *gait.signals)
    return BACKEND == "c" and set(names) == set(recorder.layout.shapes) and not recorder.layout.flags


@kernel(release=True)
def run_ticks(
    first: int,
    substeps: int,
    rules: tuple[float, float, float],
    gait: tuple[Any, ...],
    controller: tuple[Any, ...],
    plant: PlantParts,
    push: Vector,
    places: NDArray[np.int64],
    rows: Vector,
) -> tuple[int, int, int]:
    """A tick for each row; returns how many were done, how the robot stands, and the sweeps of the last contact."""
    start, period, fall_height = rules
    observe, plan, note_gait, gait_parts = gait
    act, note_controller, controller_parts = controller
    dynamics, ground, step, q, v, torque, thrust = plant
    d, s, sweeps = dynamics[0], step[0], 0
    foot_force = s.force.reshape((d.foot_position.shape[0], 3))
    for n in range(rows.shape[0]):
        t = start + (first + n) * period
        begin = perf_counter_ns()
        observe(gait_parts, q, v, foot_force)
        if not plan(t, gait_parts):
            return n, HANDED_OVER, sweeps
        if act(controller_parts, q, v, foot_force) != GOOD:
            return n, HANDED_OVER, sweeps
        elapsed = perf_counter_ns() - begin
        row = rows[n]
        signals = _note_plant(t, elapsed, plant, row, places)
        signals = note_controller(controller_parts, row, places, signals)
        note_gait(gait_parts, row, places, signals)
        forces = push[n * substeps : (n + 1) * substeps]
        sweeps = physics_steps(d, ground[0], s, q, v, torque, thrust, forces)
        if sweeps == MISFIT_COMMAND:
            return n, HANDED_OVER, sweeps
        ending = upright(q, v, fall_height + surface_height(ground[0].terrain, q[0], q[1]))
        if ending != 0:
            return n + 1, ending, sweeps
    return rows.shape[0], 0, sweeps


@kernel
def _note_plant(t: float, elapsed: int, plant: PlantParts, row: Vector, places: NDArray[np.int64]) -> int:
    """The state, the command and the time that it took; returns how many signals that is."""
    dynamics, _, step, q, v, torque, thrust = plant
    d, s = dynamics[0], step[0]
    row[places[0]] = t
    note_array(q, row, places[1])
    note_array(v, row, places[2])
    note_array(d.foot_position.reshape(d.foot_position.size), row, places[3])
    note_array(d.foot_velocity.reshape(d.foot_velocity.size), row, places[4])
    note_array(s.force, row, places[5])
    note_array(s.slip.path, row, places[6])
    note_array(s.slip.net, row, places[7])
    note_array(torque, row, places[8])
    note_array(thrust.reshape(thrust.size), row, places[9])
    row[places[10]] = elapsed
    return 11


@kernel
def note_array(values: Vector, row: Vector, place: int) -> None:
    """Write an array into a row of the log."""
    for i in range(values.shape[0]):
        row[place + i] = values[i]


@kernel
def note_nothing(parts: tuple[Any, ...], row: Vector, places: NDArray[np.int64], s: int) -> int:
    """What a gait without signals writes."""
    return s


@kernel
def observe_nothing(parts: tuple[Any, ...], q: Vector, v: Vector, foot_force: Vector) -> None:
    """What a gait that goes by time alone does with the measured state."""
