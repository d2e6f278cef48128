"""Ticks of controllers on one record, which holds all that they know: the form in which they are
exported.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from harpy_pin.controllers.governed_tick import actuate, steps_of
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.state import Vector

_STEPS = steps_of(actuate)
_PAPER, _CONTACT = _STEPS["paper"], _STEPS["filter"]


@kernel
def paper_step(
    r: Any,
    target: GaitTargetRecord,
    q: Vector,
    v: Vector,
    foot_position: Vector,
    foot_force: Vector,
) -> int:
    """The tick with the paper's governor."""
    return _PAPER(r.control, target, q, v, foot_position, foot_force, r.governor, r.rows)


@kernel
def contact_step(
    r: Any,
    target: GaitTargetRecord,
    q: Vector,
    v: Vector,
    foot_position: Vector,
    foot_force: Vector,
) -> int:
    """The tick with the contact-force filter."""
    return _CONTACT(
        r.control, target, q, v, foot_position, foot_force, r.dynamics, r.terms, r.governor
    )


@cache
def program_step(tick: Kernel[int]) -> Kernel[int]:
    """A tick of the whole-body QP."""

    @kernel
    def qp_step(r: Any, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector) -> int:
        """A tick of the whole-body QP; returns its status."""
        return tick(
            r.control, target, q, v, foot_force, r.problem, r.terms, r.program, r.search, r.dual
        )

    return qp_step
