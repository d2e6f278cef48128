"""From the document to the tables of the report: all numbers that HTML, CSV and figures show."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from comparison.campaign.summary import summary_tables
from comparison.contenders import label
from comparison.measure.controllers import CONTENDERS
from comparison.peers.peer_tables import peer_tables
from comparison.sections.constraints import constraints_table
from comparison.sections.formulation_times import formulations_table
from comparison.sections.growth import growth_tables
from comparison.sections.simulator_speed import simulator_tables
from comparison.tables import Cell, Table, in_columns, percentiles, with_interval

__all__ = ["CONDITIONS", "MEASURES", "PHASES", "latency_table", "pareto_table", "tables_of"]

CONDITIONS = {"": "friction", "_low_friction": "low_friction"}
"""Suffix of a condition's sections in the document, and the setting that holds its friction."""

PHASES = {
    "tick": "complete tick",
    "plan": "  gait, measurement",
    "governor": "  governor",
    "actuate": "  thrust law, IK, PID",
    "kinematics": "  gait, rigid-body terms",
    "build": "  build: tasks, program",
    "solve": "  solve: active set, else ProxQP",
    "finish": "  torques, thrusts",
    "chain": "  phases together",
    "governor_alone": "governor update, isolated",
    "governor_alone_violated": "the same, rows violated",
    "solve_alone": "solve, isolated, as in the tick",
    "solve_alone_proxqp": "solve, isolated, ProxQP, warm",
    "solve_alone_daqp": "solve, isolated, DAQP",
}
"""What is timed, as readers see it."""

MEASURES = {
    "fell": "fell",
    "distance_m": "distance, m",
    "slip_mm_per_step": "slip, mm per step",
    "late_slip_mm_per_step": "  after the first 50 ms",
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
    """Every table of the report, in its order; sections that the document lacks are left out."""
    tables: list[Table] = []
    if "ticks" in document and "campaign" in document:
        tables.append(pareto_table(document))
    for key, name in CONDITIONS.items():
        friction = document["settings"][name]
        tables.append(_timing_table(document[f"timing{key}"], f"timing{key}", friction))
        tables.append(_ratio_table(document[f"timing{key}"], f"ratios{key}", friction))
        tables.append(_walk_table(document[f"walk{key}"], f"walk{key}", friction))
        if document["settings"]["pushes"]:
            speed = document["settings"]["push_speed"]
            tables.append(_pushed_table(document[f"walk_pushed{key}"], f"walk_pushed{key}", friction, speed))
        titles = {"checks": "Checks of what was timed", "activity": "Activity of governor and solver"}
        tables += [
            _flat(document[f"{part}{key}"], f"{part}{key}", f"{title}, friction {friction:g}")
            for part, title in titles.items()
        ]
    if "ticks" in document:
        tables += [_ticks_table(document["ticks"]), _misses_table(document["ticks"]), latency_table(document)]
    low = document["settings"]["low_friction"]
    if "constraints" in document:
        tables.append(constraints_table(document["constraints"], low))
    if "formulations" in document:
        tables.append(formulations_table(document["formulations"], low))
    if "campaign" in document:
        tables += summary_tables(document["campaign"])
    if "growth" in document:
        tables += growth_tables(document["growth"])
    if "simulator" in document:
        tables += simulator_tables(document["simulator"])
    if "peers" in document:
        tables += peer_tables(document["peers"])
    tables += [_flat(document[key], key, key.capitalize()) for key in ("settings", "machine", "versions")]
    return tables


def _timing_table(timing: Mapping[str, Any], name: str, friction: float) -> Table:
    cells = [
        cell
        for contender in CONTENDERS
        for phase in PHASES
        if phase in timing[contender]
        for cell in percentiles(f"{contender}: {PHASES[phase].strip()}", timing[contender][phase])
    ]
    overhead = timing["timer_overhead_ns"]
    note = f"The timer's own {overhead:.0f} ns are subtracted from every time."
    return Table(name, f"Time per tick and phase, µs, friction {friction:g}", tuple(cells), note)


def _ratio_table(timing: Mapping[str, Any], name: str, friction: float) -> Table:
    rows = {
        "complete tick, wbc / governed": timing["ratio"],
        **{
            f"{PHASES[entry['phase']]} / governor update": entry
            for entry in (timing["ratio_solve_over_governor"], timing["ratio_library_over_governor"])
        },
    }
    cells = [Cell(row, "ratio", r["p50"], "", r["min"], r["max"]) for row, r in rows.items()]
    note = "Ratio of medians; in brackets the least and largest of the repetitions."
    return Table(name, f"Ratios, friction {friction:g}", tuple(cells), note)


def _walk_table(walk: Mapping[str, Any], name: str, friction: float) -> Table:
    cells = [Cell(text.strip(), who, walk[who][key]) for key, text in MEASURES.items() for who in CONTENDERS]
    return Table(name, f"One undisturbed walk of each, friction {friction:g}", tuple(cells))


def _pushed_table(pushed: Mapping[str, Any], name: str, friction: float, speed: float) -> Table:
    cells = [Cell("falls", who, pushed[who]["falls"]) for who in CONTENDERS]
    for key in (key for key in MEASURES if key in pushed["wbc"]):
        for who in CONTENDERS:
            v = pushed[who][key]
            cells.append(Cell(MEASURES[key].strip(), who, v["median"], "", v["min"], v["max"]))
    walks = next(iter(pushed.values()))["walks"]
    title = f"{walks} walks that start with a push of {speed:g} m/s, friction {friction:g}: median (range)"
    return Table(name, title, tuple(cells))


def _ticks_table(ticks: Mapping[str, Any]) -> Table:
    cells: list[Cell] = []
    for name, entry in ticks["contenders"].items():
        cells.append(Cell(label(name), "p50", entry["p50_us"], "µs", entry["low_us"], entry["high_us"]))
        cells += percentiles(label(name), entry, first="p95_us")
    note = "In brackets: least and largest median of a repetition."
    title = f"Complete tick of every controller, µs, friction {ticks['friction']:g}, pushes of {ticks['impulse']:g} N·s"
    return Table("ticks", title, tuple(cells), note)


def _misses_table(ticks: Mapping[str, Any]) -> Table:
    cells: list[Cell] = []
    for name, entry in ticks["contenders"].items():
        row = label(name)
        cells.append(Cell(row, "ticks", entry["samples"]))
        cells += [Cell(row, f"missed, {rate}", count) for rate, count in entry["misses"].items()]
        cells += in_columns(row, entry, {f"cold_{p}_us": (f"after a reset, {p}", "µs") for p in ("p50", "p99")})
    note = (
        "How many ticks took longer than the period of a control rate; no core is reserved and Python is not real-time."
    )
    return Table("misses", f"Deadlines and cold ticks, friction {ticks['friction']:g}", tuple(cells), note)


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
        row = label(name)
        tick = ticks.get(name)
        if tick is not None:
            cells.append(Cell(row, "tick, median", tick["p50_us"], "µs", tick["low_us"], tick["high_us"]))
            cells.append(Cell(row, "tick, p99", tick["p99_us"], "µs"))
        for column, key, unit in (("slip per step", "slip_mm_per_step", "mm"), ("falls", "falls", "")):
            cells.append(with_interval(row, column, entry[key], unit))
    friction = document["ticks"]["friction"]
    return Table(
        "pareto",
        f"Cost and quality: complete tick on recorded states (friction {friction:g}), slip and falls of the campaign",
        tuple(cells),
        "In brackets: of the times, least and largest median of a repetition; else 95 % intervals.",
    )


def latency_table(document: Mapping[str, Any]) -> Table:
    """The histograms of the complete tick, bin by bin."""
    cells: list[Cell] = []
    for name, entry in document["ticks"]["contenders"].items():
        edges, counts = entry["histogram"]["edges_us"], entry["histogram"]["counts"]
        for k, count in enumerate(counts):
            row = f"{label(name)} #{k:03d}"
            cells += [Cell(row, "from", edges[k], "µs"), Cell(row, "to", edges[k + 1], "µs"), Cell(row, "count", count)]
    return Table("latency", "Complete tick: histogram", tuple(cells))
