"""From the document to the tables of the report: all numbers that HTML, CSV and figures show."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from comparison.campaign.summary import label, summary_tables
from comparison.contenders import CONTENDERS
from comparison.tables import Cell, Table

__all__ = ["CONDITIONS", "MEASURES", "PHASES", "latency_table", "pareto_table", "simulator_tables", "tables_of"]

CONDITIONS = {"": "friction", "_low_friction": "low_friction"}
"""Suffix of a condition's sections in the document, and the setting that holds its friction."""

PHASES = {
    "tick": "complete tick",
    "plan": "  plan: gait, measurement",
    "governor": "  governor",
    "actuate": "  actuate: thrust law, IK, PID",
    "kinematics": "  kinematics: gait, rigid-body terms",
    "build": "  build: tasks, arrays",
    "solve": "  solve: ProxQP, warm",
    "finish": "  finish: torques, thrusts",
    "chain": "  phases together",
    "governor_alone": "governor update alone",
    "governor_alone_violated": "the same, rows violated",
    "solve_alone": "solve alone, ProxQP, warm",
    "solve_alone_daqp": "solve alone, DAQP, warm",
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
"""What a walk is judged by, as readers see it (the unit is in the name)."""

_PERCENTILES = {"p50_us": "p50", "p95_us": "p95", "p99_us": "p99", "p99_9_us": "p99.9", "max_us": "max"}


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
        tables.append(
            _flat(document[f"checks{key}"], f"checks{key}", f"Checks of what was timed, friction {friction:g}")
        )
        activity = document[f"activity{key}"]
        tables.append(_flat(activity, f"activity{key}", f"How busy governor and solver were, friction {friction:g}"))
    if "ticks" in document:
        tables += [_ticks_table(document["ticks"]), latency_table(document)]
    if "simulator" in document:
        tables += simulator_tables(document["simulator"])
    if "campaign" in document:
        tables += summary_tables(document["campaign"])
    for key, title in (("growth", "Growth with the size of the problem"), ("peers", "Peers on the same states")):
        if key in document:
            tables += _nested(document[key], key, title)
    tables += [_flat(document[key], key, key.capitalize()) for key in ("settings", "machine", "versions")]
    return tables


def _timing_table(timing: Mapping[str, Any], name: str, friction: float) -> Table:
    cells = [
        Cell(f"{contender}: {PHASES[phase].strip()}", column, timing[contender][phase][key], "µs")
        for contender in CONTENDERS
        for phase in PHASES
        if phase in timing[contender]
        for key, column in _PERCENTILES.items()
    ]
    overhead = timing["timer_overhead_ns"]
    note = f"The timer's own {overhead:.0f} ns are subtracted from every time."
    return Table(name, f"Time per tick and phase, µs, friction {friction:g}", tuple(cells), note)


def _ratio_table(timing: Mapping[str, Any], name: str, friction: float) -> Table:
    tick, heart = timing["ratio"], timing["ratio_solve_over_governor"]
    rows = {
        "complete tick, wbc / governed": tick,
        f"solve ({heart['solver']}) / governor update, each alone": heart,
    }
    cells = [Cell(row, "ratio", r["p50"], "", r["min"], r["max"]) for row, r in rows.items()]
    note = "Ratio of medians; in brackets the least and largest of the repetitions."
    return Table(name, f"Ratios, friction {friction:g}", tuple(cells), note)


def _walk_table(walk: Mapping[str, Any], name: str, friction: float) -> Table:
    cells = [Cell(text.strip(), who, walk[who][key]) for key, text in MEASURES.items() for who in CONTENDERS]
    return Table(name, f"One undisturbed walk of each, friction {friction:g}", tuple(cells))


def _pushed_table(pushed: Mapping[str, Any], name: str, friction: float, speed: float) -> Table:
    cells = [Cell("falls", who, pushed[who]["falls"]) for who in CONTENDERS]
    for key in (key for key in MEASURES if key in pushed[CONTENDERS[0]]):
        for who in CONTENDERS:
            v = pushed[who][key]
            cells.append(Cell(MEASURES[key].strip(), who, v["median"], "", v["min"], v["max"]))
    walks = pushed[CONTENDERS[0]]["walks"]
    title = f"{walks} walks that start with a push of {speed:g} m/s, friction {friction:g}: median (range)"
    return Table(name, title, tuple(cells))


def _ticks_table(ticks: Mapping[str, Any]) -> Table:
    cells: list[Cell] = []
    for name, entry in ticks["contenders"].items():
        cells.append(Cell(label(name), "p50", entry["p50_us"], "µs", entry["low_us"], entry["high_us"]))
        cells += [Cell(label(name), text, entry[key], "µs") for key, text in _PERCENTILES.items() if key != "p50_us"]
    note = "In brackets: least and largest median of a repetition."
    return Table("ticks", f"Complete tick of everyone, µs, friction {ticks['friction']:g}", tuple(cells), note)


def simulator_tables(simulator: Mapping[str, Any]) -> list[Table]:
    """The physics step beside MuJoCo's, and the walks beside the wall clock.

    Args:
        simulator: the section of that name.
    """
    step, walks, friction = simulator["step"], simulator["walks"], simulator["friction"]
    rows = {"harpy_pin": "harpy_pin", "mujoco": f"MuJoCo {step['mujoco_version']}"}
    cells: list[Cell] = []
    for name, row in rows.items():
        entry = step[name] or {}
        cells += [Cell(row, text, entry.get(key), "µs") for key, text in _PERCENTILES.items()]
        cells.append(Cell(row, "feet in contact, mean", entry.get("feet_in_contact")))
        cells.append(Cell(row, "largest deviation in a turn", entry.get("deviation_mm"), "mm"))
    ratio = step["ratio"] or dict.fromkeys(("p50", "min", "max"))
    cells.append(Cell("harpy_pin / MuJoCo", "p50", ratio["p50"], "", ratio["min"], ratio["max"]))
    title = f"One physics step of {1e3 * step['dt_s']:g} ms, called from Python, µs, friction {friction:g}"
    steps = Table("simulator_step", title, tuple(cells), " ".join(simulator["notes"]))
    cells = []
    for name, entry in walks["contenders"].items():
        cells.append(Cell(label(name), "× real time", entry["real_time_factor"], "", entry["low"], entry["high"]))
        cells.append(Cell(label(name), "× processor time", entry["cpu_factor"]))
        cells.append(Cell(label(name), "per tick, all in", entry["us_per_tick"], "µs"))
        cells.append(Cell(label(name), "ending", entry["ending"]))
    title = f"Closed-loop walks of {walks['duration_s']:g} s on the wall clock, friction {friction:g}"
    note = "Median of the walks; in brackets the slowest and the fastest."
    return [steps, Table("simulator_walks", title, tuple(cells), note)]


def _nested(entry: Mapping[str, Any], name: str, title: str) -> list[Table]:
    """Tables of an entry of any shape: what is a table of scalars becomes one, the rest is listed."""
    if entry and all(isinstance(row, Mapping) and not any(map(_deep, row.values())) for row in entry.values()):
        cells = (Cell(str(row), str(column), v) for row, values in entry.items() for column, v in values.items())
        return [Table(name, title, tuple(cells))]
    loose = {key: value for key, value in entry.items() if not isinstance(value, Mapping)}
    tables = [_flat(loose, name, title)] if loose else []
    for key, value in entry.items():
        if isinstance(value, Mapping):
            tables += _nested(value, f"{name}_{key}", f"{title}: {key}")
    return tables


def _deep(value: Any) -> bool:
    return isinstance(value, Mapping | list | tuple)


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
    """Cost and quality side by side; a contender that lacks one of them has an empty cell.

    Args:
        document: with the sections ``ticks`` and ``campaign``.
    """
    ticks, whole = document["ticks"]["contenders"], document["campaign"]["whole"]
    cells: list[Cell] = []
    for name, entry in whole.items():
        row = label(name)
        tick = ticks.get(name)
        if tick is not None:
            cells.append(Cell(row, "tick, median", tick["p50_us"], "µs", tick["low_us"], tick["high_us"]))
            cells.append(Cell(row, "tick, p99", tick["p99_us"], "µs"))
        for column, key, unit in (("slip per step", "slip_mm_per_step", "mm"), ("falls", "falls", "")):
            v = entry[key]
            cells.append(Cell(row, column, v["value"], unit, v["low"], v["high"]))
    friction = document["ticks"]["friction"]
    return Table(
        "pareto",
        f"Cost and quality: complete tick on recorded states (friction {friction:g}), slip and falls of the campaign",
        tuple(cells),
        "In brackets: of the times, least and largest median of a repetition; else 95 % intervals.",
    )


def latency_table(document: Mapping[str, Any]) -> Table:
    """The histograms of the complete tick, bin by bin.

    Args:
        document: with the section ``ticks``.
    """
    cells: list[Cell] = []
    for name, entry in document["ticks"]["contenders"].items():
        edges, counts = entry["histogram"]["edges_us"], entry["histogram"]["counts"]
        for k, count in enumerate(counts):
            row = f"{label(name)} #{k:03d}"
            cells += [
                Cell(row, "from", edges[k], "µs"),
                Cell(row, "to", edges[k + 1], "µs"),
                Cell(row, "count", count),
            ]
    return Table("latency", "Complete tick: histogram", tuple(cells))
