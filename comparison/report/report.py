"""The report: every table of the comparison, and all its numbers as JSON and CSV."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from comparison.campaign.summary import summary_tables
from comparison.contenders import label
from comparison.report.answer import answer_of
from comparison.sections.ticks import formulations_table, simulator_table, ticks_table
from comparison.sections.timing import timing_table
from comparison.tables import Cell, Table, in_columns, to_csv
from harpy_pin.files import OwnFolder, json_text

MEASURES = {
    "fell": "fell",
    "distance_m": "distance, m",
    "slip_mm_per_step": "slip, mm per step",
    "late_slip_mm_per_step": "after the first 50 ms",
    "sliding": "sliding, share of contact",
    "low_force": "normal force < 20 N, share",
    "no_contact": "no contact, share",
    "tracking_rms_mm": "body from target, rms mm",
    "thrust_rms_n": "thrust, rms N",
    "thrust_max_n": "largest thrust, N",
    "torque_max_nm": "largest torque, N·m",
    "pitch_max_rad": "largest pitch, rad",
    "solver_failures": "failed solves",
}
"""Measures of a walk, as readers see them (the unit is in the name)."""


def tables_of(document: Mapping[str, Any]) -> list[Table]:
    """Every table of the report, in its order."""
    friction, walk = document["settings"]["friction"], document["walk"]
    cells = (
        Cell(text, label(who), of[measure])
        for measure, text in MEASURES.items()
        for who, of in walk.items()
    )
    return [
        answer_of(document).table(),
        pareto_table(document),
        timing_table(document["timing"], friction),
        Table("walk", f"One undisturbed walk of each, friction {friction:g}", tuple(cells)),
        _flat(document["checks"], "checks", "Checks of what was timed"),
        _flat(document["activity"], "activity", "Activity of governor and solver"),
        ticks_table(document["ticks"]),
        formulations_table(document["formulations"], friction),
        *summary_tables(document["campaign"]),
        simulator_table(document["simulator"]),
        *(
            _flat(document[key], key, key.capitalize())
            for key in ("settings", "machine", "versions")
        ),
    ]


def _flat(entry: Mapping[str, Any], name: str, title: str) -> Table:
    """Any nested entry as one column of values; the way to a value is its row."""
    cells: list[Cell] = []

    def visit(value: Any, way: str) -> None:
        if isinstance(value, Mapping):
            for key, part in value.items():
                visit(part, f"{way} / {key}" if way else str(key))
        elif isinstance(value, list | tuple):
            for i, part in enumerate(value):
                visit(part, f"{way} [{i}]")
        else:
            cells.append(Cell(way, "value", value))

    visit(entry, "")
    return Table(name, title, tuple(cells))


def pareto_table(document: Mapping[str, Any]) -> Table:
    """Cost and quality side by side; where a contender lacks one of them the cell is empty."""
    ticks, whole = document["ticks"]["contenders"], document["campaign"]["whole"]
    cells: list[Cell] = []
    for name, entry in whole.items():
        row, tick = label(name), ticks.get(name)
        if tick is not None:
            cells.append(
                Cell(row, "tick, median", tick["p50_us"], "µs", tick["low_us"], tick["high_us"])
            )
            cells.append(Cell(row, "tick, p99", tick["p99_us"], "µs"))
        cells += in_columns(
            row, entry, {"slip_mm_per_step": ("slip per step", "mm"), "falls": ("falls", "")}
        )
    where = f"complete tick on recorded states (friction {document['ticks']['friction']:g})"
    title = f"Cost and quality: {where}, slip and falls of the campaign"
    note = (
        "In brackets: of the times, least and largest median of a repetition; else 95 % intervals."
    )
    return Table("pareto", title, tuple(cells), note)


def write_report(folder: OwnFolder, document: Mapping[str, Any]) -> None:
    """Write ``results.json``, and ``results.csv`` with every number of the tables."""
    tables = to_csv(tables_of(document))
    folder.write({"results.json": json_text(document), "results.csv": tables})
