"""The tables of the peers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from comparison.peers.check import UNITS
from comparison.peers.pinocchio_terms import SOURCES
from comparison.tables import Cell, Table, percentiles

__all__ = ["peer_tables"]

_WHICH = {"max": "largest", "median": "median"}
_WHAT = {"tick": "complete tick", "solve": "solver's call only"}
_PARTS = {"terms": "terms", "condensed": "condensed WBC's tick", "qp": "WBC QP's tick"}
_NOTES = {
    "tick": "Each peer runs in its own process, called from Python (TSID-C++: without Python), on the same states in "
    "the order of time; tasks and given thrusts are made outside its clock, and it holds neither a range of the normal "
    "force nor limits of thrust, and four faces of friction. Our tick includes the gait and holds all that and eight "
    "faces; on the peers' program it holds what they hold, gait included.",
    "solve": "The calls do not span the same: placo's contains rigid-body terms and assembly, TSID's the solver's "
    "arrays and the solver, ours the solver.",
}


def peer_tables(peers: Mapping[str, Any]) -> list[Table]:
    """Times, growth, terms, differences and versions."""
    tables = [*(_times(peers, what) for what in _WHAT), _growth(peers), _terms(peers)]
    tables += [_differences(peers), _versions(peers)]
    return [table for table in tables if table.cells]


def _times(peers: Mapping[str, Any], what: str) -> Table:
    cells: list[Cell] = []
    for name, entry in peers["contenders"].items():
        if "times" not in entry:
            cells.append(Cell(name, "no times", entry["reason"]))
            continue
        for support, times in entry["times"].items():
            if what not in times:
                continue
            row, t = f"{name}: {support}", times[what]
            cells.append(Cell(row, "p50", t["p50_us"], "µs", t["low_us"], t["high_us"]))
            cells += percentiles(row, t, first="p95_us")
    note = "In brackets: least and largest median of a repetition. " + _NOTES[what]
    title = f"Peers: {_WHAT[what]} in single and double support, µs, friction {peers['friction']:g}"
    return Table(f"peers_{what}", title, tuple(cells), note)


def _growth(peers: Mapping[str, Any]) -> Table:
    cells: list[Cell] = []
    reasons = []
    for robot, entry in peers.get("growth", {}).items():
        if "contenders" not in entry:
            reasons.append(f"{robot}: {entry['reason']}")
            continue
        cells += [Cell(robot, name, entry[name]) for name in ("joints", "feet", "unsolved_by_us")]
        for name, told in entry["contenders"].items():
            if told["p50_us"] is not None:
                cells.append(Cell(robot, name, told["p50_us"], "µs"))
            if told["difference"] is not None:
                cells.append(Cell(f"{robot}: torque differs by", name, told["difference"], "N·m"))
            if told["reason"]:
                reasons.append(f"{robot}, {name}: {told['reason']}")
    note = (
        "Standing and swaying on point feet, all held, no thrusters, friction 0.5; the cost of posture is next to "
        "nothing on legs of three joints. Times count only within the same tolerance. " + "; ".join(reasons)
    )
    return Table("peers_growth", "Peers: complete tick against the number of joints, p50, µs", tuple(cells), note)


def _terms(peers: Mapping[str, Any]) -> Table:
    entry, cells = peers.get("terms"), list[Cell]()
    if entry is None:
        return Table("peers_terms", "", ())
    for name, text in SOURCES.items():
        for part, column in _PARTS.items():
            t = entry["times"][name][part]
            cells.append(Cell(text, column, t["p50_us"], "µs", t["low_us"], t["high_us"]))
    for name, contender in peers["contenders"].items():
        for support, times in contender.get("times", {}).items():
            if "terms" in times:
                t = times["terms"]
                row = f"Pinocchio inside {name}: {support}"
                cells.append(Cell(row, _PARTS["terms"], t["p50_us"], "µs", t["low_us"], t["high_us"]))
    note = (
        f"Tick: terms, program and solve, without the gait; in turns at {entry['ticks']} states, unsolved: "
        f"{entry['unsolved']}. Largest difference of a command between the two sources, N and N·m: condensed WBC "
        f"{entry['difference']['condensed']:.1g}, WBC QP {entry['difference']['qp']:.1g}."
    )
    return Table("peers_terms", "Rigid-body terms of our kernel and of Pinocchio, p50, µs", tuple(cells), note)


def _differences(peers: Mapping[str, Any]) -> Table:
    cells: list[Cell] = []
    for name, entry in peers["contenders"].items():
        if "compared" not in entry:
            if entry["reason"]:
                cells.append(Cell(name, "no result", entry["reason"]))
            continue
        for which in ("max", "median"):
            row = f"{name}: {_WHICH[which]}"
            cells += [
                Cell(row, quantity, entry[f"difference_{which}"][quantity], unit)
                for quantity, unit in UNITS.items()
                if quantity in entry[f"difference_{which}"]
            ]
        cells.append(Cell(f"{name}: largest", "ticks", entry["compared"]))
        cells.append(Cell(f"{name}: largest", "differing", entry["differing"]))
    limits = ", ".join(f"{name} {value:g} {UNITS[name]}" for name, value in peers["tolerance"].items())
    note = f"Times count only if no tick differs by more than: {limits}."
    return Table("peers_check", "Peers: differences from our solution of the same program", tuple(cells), note)


def _versions(peers: Mapping[str, Any]) -> Table:
    cells = [
        Cell(name, package, number)
        for name, entry in peers["contenders"].items()
        for package, number in entry.get("versions", {}).items()
    ]
    return Table("peers_versions", "Peers: versions", tuple(cells))
