"""The tick of a controller: a list of stages.

A stage is a kernel. It takes an element of the controller's record, the gait's targets and what was
measured, and writes into the record. What not every tick has (an estimate, thrusts that lag, a law
of the motors) is a further part of the record, and stages that work on it. One kernel calls all
stages one after the other (:func:`tick_of`).

A sample or targets that are not finite are answered by the last command, which fades after
``HOLD_TICKS`` ticks. All arrays are as in :class:`harpy_pin.model.state.State`.
"""

from __future__ import annotations

from functools import cache

from harpy_pin.controllers.stage import Stages
from harpy_pin.controllers.tasks import TasksRecord, measured_terms
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.entry import FADE, GOOD, HOLD_TICKS
from harpy_pin.model.record import ZERO, RecordOf, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import write_thrusts

BAD_SAMPLE = 16
"""Status: the state or the targets are not finite, or the gait turns and the controller cannot."""
FALLBACK = 8
"""Status: the program has no solution, or none was found: the last command is held, then the
posture.
"""
NO_OPTIMUM = 4
"""Least status of a tick that has no optimum."""
VIOLATED = 1
"""Status: the governor's constraint does not hold with the command given."""


class TickRecord(RecordOf):
    """What every tick keeps."""

    verdict: int = ZERO  # what the last sample was, see :mod:`harpy_pin.model.entry`
    bad_samples: int = ZERO  # how many were bad since the last reset
    bad_in_a_row: int = ZERO  # how many of the last samples were bad
    torque: Vector = sized("joints")  # (joints,) of the command, N·m
    thrust: Vector = sized("thrusters", 3)  # (thrusters, 3) of the command, world axes, N


@kernel
def fading(r: TickRecord) -> float:
    """Count bad samples by the verdict; returns the factor on the last command."""
    if r.verdict == GOOD:
        r.bad_in_a_row = 0
    else:
        r.bad_samples += 1
        r.bad_in_a_row += 1
    return FADE if r.bad_in_a_row > HOLD_TICKS else 1.0


class TaskTickRecord(TasksRecord, TickRecord):
    """A whole-body controller."""

    # (thrust variables + joints,) [u; τ] of the last tick, N and N·m
    inputs: Vector = sized("thrusts + joints")
    status: int = ZERO  # of the last tick
    apart: int  # 1 where thrusts of the command are other numbers than those of the inputs


@kernel
def take_sample(
    r: TaskTickRecord, g: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The first stage of a tick: the sample and the targets are checked, once."""
    r.verdict = measured_terms(r, g, q, v, foot_force)
    r.status = 0 if r.verdict == GOOD else BAD_SAMPLE


@kernel
def write_thrust(
    r: TaskTickRecord, g: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The thrusts of the inputs; no stage where thrusts lag."""
    write_thrusts(r.dynamics, r.inputs, r.thrust)


@kernel
def write_torque(
    r: TaskTickRecord, g: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
) -> None:
    """The torques of the inputs; after a bad sample the last command, which fades."""
    first = r.inputs.shape[0] - r.torque.shape[0]
    factor = fading(r)
    if r.verdict != GOOD:
        r.inputs[first if r.apart else 0 :] *= factor
        r.thrust *= factor
    r.torque[:] = r.inputs[first:]


@cache
def tick_of(opening: Stages, stages: Stages, closing: Stages) -> Kernel[int]:
    """One kernel that goes through the stages that open every tick, those of a tick whose sample is
    good, and those that close every tick; it returns the status.
    """

    # v is as long as the bias forces, and forces have the shape of the targets of the feet
    @kernel(v="r.dynamics.bias", foot_force="r.targets.feet")
    def tick(
        r: TaskTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
    ) -> int:
        for stage in opening:
            stage(r, target, q, v, foot_force)
        for stage in stages:
            if r.verdict == GOOD:
                stage(r, target, q, v, foot_force)
        for stage in closing:
            stage(r, target, q, v, foot_force)
        return r.status

    return tick
