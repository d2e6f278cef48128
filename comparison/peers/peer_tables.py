"""The tables of the peers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from comparison.tables import Cell, Table, percentiles

UNITS = {"acceleration": "m/s², rad/s²", "torque": "N·m", "force": "N", "thrust": "N"}
_WHICH = {"max": "largest", "median": "median"}
_COUNTS = {"ticks": "compared", "differing": "differing"}
_TIMES = {
    "tick": (
        "complete tick",
        "Each peer runs in its own process, called from Python (TSID-C++: without Python), on the same states in "
        "the order of time; tasks and given thrusts are made outside its clock, and it holds neither a range of the "
        "normal force nor limits of thrust, and four faces of friction. Our tick includes the gait and holds all that "
        "and eight faces; on the peers' program it holds what they hold, gait included.",
    ),
    "solve": (
        "solver's call only",
        "The calls do not span the same: placo's contains rigid-body terms and assembly, TSID's the solver's "
        "arrays and the solver, ours the solver.",
    ),
}


def peer_tables(peers: Mapping[str, Any]) -> list[Table]:
    """Times, growth, differences and versions."""
    contenders = peers["contenders"]
    versions = (Cell(n, *item) for n, entry in contenders.items() for item in entry.get("versions", {}).items())
    tables = [*(_times(peers, what) for what in _TIMES), _growth(peers), _differences(peers)]
    tables.append(Table("peers_versions", "Peers: versions", tuple(versions)))
    return [table for table in tables if table.cells]


def _p50(row: str, column: str, times: Mapping[str, Any]) -> Cell:
    """A median between those of the repetitions."""
    return Cell(row, column, times["p50_us"], "µs", times["low_us"], times["high_us"])


def _times(peers: Mapping[str, Any], what: str) -> Table:
    text, note = _TIMES[what]
    cells: list[Cell] = []
    for name, entry in peers["contenders"].items():
        if "times" not in entry:
            cells.append(Cell(name, "no times", entry["reason"]))
        for support, times in entry.get("times", {}).items():
            if what in times:
                row = f"{name}: {support}"
                cells += [_p50(row, "p50", times[what]), *percentiles(row, times[what], first="p95_us")]
    title = f"Peers: {text} in single and double support, µs, friction {peers['friction']:g}"
    note = f"In brackets: least and largest median of a repetition. {note}"
    return Table(f"peers_{what}", title, tuple(cells), note)


def _growth(peers: Mapping[str, Any]) -> Table:
    cells: list[Cell] = []
    reasons = []
    for robot, entry in peers.get("growth", {}).items():
        if "contenders" not in entry:
            reasons.append(f"{robot}: {entry['reason']}")
            continue
        cells += [Cell(robot, name, entry[name]) for name in ("joints", "feet", "unsolved_by_us")]
        for name, found in entry["contenders"].items():
            if found["p50_us"] is not None:
                cells.append(Cell(robot, name, found["p50_us"], "µs"))
            if found["difference"] is not None:
                cells.append(Cell(f"{robot}: torque differs by", name, found["difference"], "N·m"))
            if found["reason"]:
                reasons.append(f"{robot}, {name}: {found['reason']}")
    note = (
        "Standing and swaying on point feet, all held, no thrusters, friction 0.5; the cost of posture is next to "
        "nothing on legs of three joints. Times count only within the same tolerance. " + "; ".join(reasons)
    )
    return Table("peers_growth", "Peers: complete tick against the number of joints, p50, µs", tuple(cells), note)


def _differences(peers: Mapping[str, Any]) -> Table:
    cells: list[Cell] = []
    for name, entry in peers["contenders"].items():
        if "compared" not in entry:
            if entry["reason"]:
                cells.append(Cell(name, "no result", entry["reason"]))
            continue
        for which, text in _WHICH.items():
            found = entry[f"difference_{which}"]
            cells += [Cell(f"{name}: {text}", q, found[q], unit) for q, unit in UNITS.items() if q in found]
        cells += [Cell(f"{name}: largest", column, entry[key]) for column, key in _COUNTS.items()]
    limits = ", ".join(f"{name} {value:g} {UNITS[name]}" for name, value in peers["tolerance"].items())
    note = f"Times count only if no tick differs by more than: {limits}."
    return Table("peers_check", "Peers: differences from our solution of the same program", tuple(cells), note)
