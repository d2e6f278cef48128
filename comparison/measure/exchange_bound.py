"""An upper end of a tick on a microcontroller: the bound on exchanges times the dearest exchange.

A search ends after so many systems of the reused active set, or after four exchanges for each row
of the dual method (:mod:`harpy_pin.wbc.condensed.active_set`), and the whole-body QP asks the
reused set once more with what the dual method found. A system is dearest with as many active rows
as unknowns and without a zero; an exchange of the dual method is dearest at one of its sizes, and
either adds a row or drops the first. These are counted one by one.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from harpy_pin.errors import HarpyError
from harpy_pin.export.board import CHIPS, Chip, build, run
from harpy_pin.export.code import initial_values
from harpy_pin.export.mathematics import PORTABLE
from harpy_pin.kernels import kernel
from harpy_pin.kernels.types import INTEGER, REAL, Struct
from harpy_pin.kernels.unit import Unit
from harpy_pin.model.cholesky import factorise
from harpy_pin.model.record import Record, make_record
from harpy_pin.model.state import Vector
from harpy_pin.wbc.active_set_warm_start import EXCHANGES_PER_ROW
from harpy_pin.wbc.condensed.active_set import (
    SearchRecord,
    _bring_in,
    _choose,
    _correct,
    _most_violated,
    _solve_active,
    _start,
    row_value,
)
from harpy_pin.wbc.program import worst_violation

_MAIN = Path(__file__).with_suffix(".c")
"""Calls the pieces by these names, and prints what each took; ``RESET`` gives the state its first
values.
"""
_DEFINED = ("SYSTEM", "FRAME", "EXCHANGE", "VARIABLES", "RESET")


class BoundRecord(SearchRecord):
    """A search, and what its pieces compute."""

    z: Vector  # (n,) variables
    worst: float  # largest violation


@kernel
def _system(r: BoundRecord) -> None:
    """One round of the reused active set."""
    count = _choose(r.exchange)
    _solve_active(r.program, r.exchange, count, r.z)
    _correct(r.program, r.exchange, count, r.z)


@kernel
def _frame(r: BoundRecord) -> None:
    """What a search does once: factors, the start of the dual method, the violation of what was
    found.
    """
    factorise(r.program.hessian, r.exchange.factor)
    factorise(r.program.hessian, r.exchange.factor)
    _start(r.program, r.dual, r.z)
    r.worst = worst_violation(r.program, r.z)


@kernel
def _exchange(r: BoundRecord, size: int, drops: int, sign: float) -> int:
    """One round of the dual method with so many active rows, with the search for the most violated
    one.
    """
    w, p = r.dual, r.program
    for a in range(size):
        w.multiplier[a] = 1e9
        w.chosen[a] = a
    if drops:
        w.multiplier[0] = 0.0
    row, side = _most_violated(p, w, r.z)
    slack = row_value(p, row, r.z) - row_value(p, row, r.z)
    for i in range(r.z.shape[0]):
        w.normal[i] = sign * p.inequality[p.lower.shape[0] - 1, i]
    outcome, _, _ = _bring_in(w, p.lower.shape[0] - 1, size, 0, slack - 1.0 - abs(side), 0, r.z)
    return outcome


def search_bound(
    records: tuple[Record, ...], folder: Path, chip: str, *, single: bool, level: str, systems: int
) -> int:
    """Most instructions of one search.

    The records are those of the program, of the reused active set and of the dual method; the
    folder is that of an exported controller, whose board is used; ``systems`` says how many of the
    reused active set there may be.
    """
    program, exchange, dual = records
    state = _dense(
        make_record(
            BoundRecord,
            program=program,
            exchange=exchange,
            dual=dual,
            z=program["gradient"][0],
            worst=0.0,
        )
    )
    rows, variables = (int(size) for size in program["inequality"][0].shape)
    unit = Unit(single=single, prefix="bench_", own=PORTABLE if single else {})
    kind = Struct(state.dtype, "state")
    pieces = {_system: (), _frame: (), _exchange: (INTEGER, INTEGER, REAL)}
    names = [unit.function_for(piece, (kind, *given)).name for piece, given in pieces.items()]
    table, statements = initial_values(unit, state)
    values = (*names, variables, " ".join(statements))
    defined = (f"#define {n} {value}" for n, value in zip(_DEFINED, values, strict=True))
    parts = (
        unit.header(),
        "#include <stdio.h>",
        unit.types(),
        unit.code(),
        table,
        *defined,
        _MAIN.read_text("utf-8"),
    )
    found = _run("\n\n".join(parts), folder, CHIPS[chip], level)
    limit = EXCHANGES_PER_ROW * rows
    return int(found["frame"] + systems * found["system"] + limit * found["exchange"])


def _run(text: str, folder: Path, chip: Chip, level: str) -> dict[str, float]:
    """The dearest of each kind, in instructions."""
    with tempfile.TemporaryDirectory() as place:
        source = Path(place) / "bench.c"
        source.write_text(text, encoding="utf-8")
        output, code = run(
            build(folder, [source], chip, source.with_suffix(".elf"), flags=[level]), chip
        )
    if code:
        raise HarpyError(f"the count of exchanges failed on {chip.title}: {output[-200:]}")
    found: dict[str, float] = {}
    for line in output.split("\n"):
        if line:
            name, ticks = line.split()
            found[name] = max(found.get(name, 0.0), float(ticks))
    scale = 2e5 / found["loop"]
    return {name: scale * ticks for name, ticks in found.items()}


def _dense(state: Record) -> Record:
    """A program and work space without a zero, in which all that can be active is."""
    rng = np.random.default_rng(0)
    p, w, dual = (state[name][0] for name in ("program", "exchange", "dual"))
    n = p["gradient"].size
    root = rng.standard_normal((n, n))
    p["hessian"] = root @ root.T + n * np.eye(n)
    p["gradient"] = rng.standard_normal(n)
    p["inequality"] = rng.standard_normal(p["inequality"].shape)
    p["lower"], p["upper"] = -1.0, 1.0
    w["active"][:n] = 1
    w["factor"] = np.tril(rng.standard_normal((n, n))) + n * np.eye(n)
    dual["basis"] = np.linalg.qr(root)[0]
    dual["triangle"] = np.triu(rng.uniform(0.1, 1.0, (n, n))) + np.eye(n)
    dual["scale"], dual["limit"], dual["span"] = 1.0, 1, (0, n)
    state["z"][0] = rng.standard_normal(n)
    return state
