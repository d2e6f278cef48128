"""Ticks of controllers on one record, which holds all that they know: the form in which they are
exported.
"""

from __future__ import annotations

from functools import cache

from harpy_pin.controllers.governed_tick import STEPS, ControlRecord
from harpy_pin.controllers.whole_body_tick import WholeBodyTickRecord
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.governors.contact_force_kernels import ContactForceFilterRecord
from harpy_pin.governors.erg import ErgRecord
from harpy_pin.governors.rows import ForceRowsRecord
from harpy_pin.kernels import Kernel, kernel
from harpy_pin.model.contact_map import ContactMapRecord
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.record import RecordOf
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set import ActiveSetRecord, DualRecord, ProgramRecord
from harpy_pin.wbc.problem import FormulationRecord

_PAPER, _CONTACT = STEPS["paper"], STEPS["filter"]


class PaperTickRecord(RecordOf):
    """The controller with the paper's reference governor."""

    control: ControlRecord  # gains, references and the command
    governor: ErgRecord  # of the reference
    rows: ForceRowsRecord  # its constraints


class FilterTickRecord(RecordOf):
    """The controller in front of the contact-force filter."""

    control: ControlRecord  # gains, references and the command
    dynamics: DynamicsRecord  # terms of the equations of motion
    terms: ContactMapRecord  # how thrusts and torques change the contact forces
    governor: ContactForceFilterRecord  # the filter


class ProgramTickRecord(RecordOf):
    """The whole-body QP with its program and this library's own search."""

    control: WholeBodyTickRecord  # tasks, solution and command
    problem: FormulationRecord  # what the formulation knows
    terms: ContactMapRecord  # what the formulation keeps of the last state
    program: ProgramRecord  # the quadratic program
    search: ActiveSetRecord  # the last active set and its exchange
    dual: DualRecord  # the dual method, which starts without active constraints


@kernel
def paper_step(
    r: PaperTickRecord,
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
    r: FilterTickRecord,
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
    def qp_step(
        r: ProgramTickRecord, target: GaitTargetRecord, q: Vector, v: Vector, foot_force: Vector
    ) -> int:
        """A tick of the whole-body QP; returns its status."""
        return tick(
            r.control, target, q, v, foot_force, r.problem, r.terms, r.program, r.search, r.dual
        )

    return qp_step
