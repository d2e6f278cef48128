"""The tick of a whole-body controller as a list of stages, and those that every such tick has.

A stage is a kernel. It takes an element of the controller's record, the gait's targets and what was
measured, and writes into the record. What not every tick has (an estimate, thrusts that lag, a law
of the motors) is a further part of the record, and stages that work on it. One kernel calls all
stages one after the other (:func:`tick_of`).
"""

from __future__ import annotations

from functools import cache

from harpy_pin.controllers.tasks import TasksRecord, measured_terms
from harpy_pin.controllers.tick import BAD_SAMPLE, TickRecord, fading
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.entry import GOOD
from harpy_pin.model.record import ZERO, sized
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import write_thrusts


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
    """The thrusts of the inputs, where these are those of the command."""
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


Stages = tuple[Kernel[None], ...]


@cache
def tick_of(opening: Stages, stages: Stages, closing: Stages) -> Kernel[int]:
    """One kernel that goes through the stages that open every tick, those of a tick whose sample is
    good, and those that close every tick; it returns the status.
    """

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
