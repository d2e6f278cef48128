"""Stages of a user's own in the tick of a whole-body controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError, shown
from harpy_pin.kernels import Kernel
from harpy_pin.model.record import make_record

Stages = tuple[Kernel[None], ...]


@dataclass(frozen=True, kw_only=True)
class Stage:
    """What a whole-body controller does besides in every tick: memory, and kernels that work on it.

    All kernels but those around the optimum take (record, target, q, v, foot_force): the
    controller's record, in which ``record.NAME`` is this memory, the gait's targets, and what was
    measured. The fields of the record are those of
    :class:`~harpy_pin.controllers.tick.TaskTickRecord`, such as ``dynamics``, ``targets``,
    ``inputs``, ``thrust`` and ``torque``.

    Attributes:
        name: of the memory.
        memory: numbers and arrays by name, as they are at first and after a reset.
        before_tasks: kernels after a good sample, before the tasks are set.
        after_tasks: kernels between the tasks and the optimum.
        after_optimum: kernels between the optimum and the command's torques.
        closing: kernels that end every tick, after bad samples, too.
        around_optimum: kernels (record, lower, upper, inputs, usable), one before each optimum and
            one after the last: with three the optimum is found twice. ``lower`` and ``upper`` are
            the limits of thrusts and torques, ``inputs`` those of the last optimum, and ``usable``
            says whether there was one. They write the command's thrusts.
        signals: what is logged, by name: a field of the memory, or a field and an index in it.

    Raises:
        InputError: a name that is no Python name, memory that is no numbers, or kernels that are
            none.
    """

    name: str
    memory: Mapping[str, ArrayLike] = field(default_factory=dict)
    before_tasks: Stages = ()
    after_tasks: Stages = ()
    after_optimum: Stages = ()
    closing: Stages = ()
    around_optimum: Stages = ()
    signals: Mapping[str, str | tuple[Any, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name.isidentifier()):
            message = f"name of a stage must be a Python name, got {shown(self.name)}"
            raise InputError(message, name="name", value=self.name)
        for phase in PHASES:
            kernels = getattr(self, phase)
            if not (
                isinstance(kernels, tuple | list) and all(isinstance(k, Kernel) for k in kernels)
            ):
                message = f"{phase} must be kernels in a tuple, got {shown(kernels)}"
                raise InputError(message, name=phase, value=kernels)
            checks.keep(self, **{phase: tuple(kernels)})
        try:
            record = make_record(None, **checks.mapping("memory", self.memory))
        except (TypeError, ValueError) as error:
            message = f"memory of a stage must be numbers and arrays: {error}"
            raise InputError(message, name="memory", value=self.memory) from None
        given = checks.mapping("signals", self.signals).items()
        places = {name: place if isinstance(place, tuple) else (place,) for name, place in given}
        for name, place in places.items():
            checks.one_of(
                f"field of the signal {shown(name)}", next(iter(place), None), self.memory
            )
        checks.keep(self, signals=places, _record=record)


PHASES = ("before_tasks", "after_tasks", "after_optimum", "closing", "around_optimum")
