"""All cases: peers and our own controllers on the same program of the same states, checked first,
then timed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from comparison.measure.timing import TimingSettings, describe_all_versions, describe_machine
from comparison.measure.walking import stage
from comparison.peers.cases import cases
from comparison.peers.environment import NOT_INSTALLED
from comparison.peers.measure_peer import PROCESSORS, TOLERANCE, Row, measure_ours, measure_peer
from comparison.peers.peer_problem import Case, PeerProblem, make_problem
from comparison.tables import Cell, Table, percentiles
from harpy_pin.files import finite
from harpy_pin.gaits.fitting import GRAVITY

RECORDING = 3.0
"""Length of a recording, s."""
QUICK_RECORDING = 0.7
QUICK_CASES = ("solo12, stands", "solo12, walks")


def compare_peers(
    progress: Callable[[str, int, int], None],
    friction: float,
    *,
    duration: float,
    timing: TimingSettings,
    folder: Path,
    only: tuple[str, ...] | None = None,
) -> dict[str, Any]:
    """Record the states of every case, then check and time every peer and our own controllers on
    them.

    The duration of a recording is in s; the friction is that of Harpy's ground; ``folder`` has the
    peers' environments; ``only`` names cases, all by default. Progress is never called while a
    clock runs.

    Returns:
        ``machine``, ``versions`` and ``peers``, of which ``cases`` has for each what was posed, and
        of every contender either a ``reason`` why it has no times, or its differences from our
        solutions and its times. Ready for JSON.
    """
    machine, repetitions = describe_machine(), min(timing.repetitions, 6)
    made = cases(friction=friction, duration=duration, warm_up=timing.warm_up)
    chosen = {name: make for name, make in made.items() if only is None or name in only}
    found = {}
    for name, make in chosen.items():
        step = stage(progress, name, 1)
        with TemporaryDirectory() as scratch:
            case = make()
            problem = make_problem(case, Path(scratch) / "robot.urdf")
            found[name] = _describe(case, problem) | {
                "contenders": _measure(case, problem, folder, repetitions)
            }
        step()
    peers = {"repetitions": repetitions, "tolerance": dict(TOLERANCE), "cases": found}
    document: dict[str, Any] = finite(
        {"peers": peers, "machine": machine, "versions": describe_all_versions()}
    )
    return document


def _describe(case: Case, problem: PeerProblem) -> dict[str, Any]:
    """What was posed, over the ticks that count."""
    counts, robot, expected = problem.counted > 0.0, case.gait.robot, problem.expected
    torque, held = np.abs(expected.torque[counts]), problem.held[counts] > 0.0
    slack = problem.settings["mu"] * expected.force[..., 2] - np.abs(expected.force[..., :2]).max(
        axis=-1
    )
    load = expected.force[counts][..., 2].sum(axis=1) / (robot.mass * GRAVITY)
    return {
        "joints": len(robot.joints),
        "contact_points": len(robot.feet),
        "ticks": int(np.count_nonzero(counts)),
        "unsolved_by_us": int(np.count_nonzero(~expected.solved)),
        "contact_changes": int(
            np.count_nonzero((np.diff(held.astype(int), axis=0) != 0).any(axis=1))
        ),
        "load_median": float(np.median(load)),
        "load_least": float(load.min()),
        "friction_active": float((slack[counts][held] < _ACTIVE).mean()),
        "torque_active": int(
            (torque > np.array(problem.settings["torque_limit"]) - _ACTIVE).any(axis=1).sum()
        ),
    }


_ACTIVE = 1e-6
"""Distance from a limit at which it counts as reached, N and N·m."""


_EQUALITIES = {"equalities eliminated": True, "equalities kept": False}
"""placo solves either program, and either may be the faster one."""
_EVERY = 20
"""Planar contacts are checked at every so many ticks."""


def _rows(problem: PeerProblem) -> dict[str, Row]:
    """How peers are asked, by the names of their rows."""
    rows = {"TSID in C++": Row("TSID-C++")}
    rows |= {
        f"placo, {name}": Row("placo", {"rewrite_equalities": on})
        for name, on in _EQUALITIES.items()
    }
    if problem.settings["soles"]:
        from comparison.peers.dense_program import (
            planar_options,
            planar_solutions,
        )  # needs an extra

        planar, expected = planar_options(problem), planar_solutions(problem, every=_EVERY)
        for name, on in _EQUALITIES.items():
            rows[f"{PLANAR}, {name}"] = Row("placo", {"rewrite_equalities": on, **planar}, expected)
    return rows


PLANAR = "placo, planar contacts"
"""Begins the names of rows that have a program of their own."""


def _measure(case: Case, problem: PeerProblem, folder: Path, repetitions: int) -> dict[str, Any]:
    """An entry for every contender, peers between ours."""
    own, *wheels = PROCESSORS
    entries = measure_ours(case, problem, repetitions, own)
    entries |= {
        name: measure_peer(row, problem, folder, repetitions)
        for name, row in _rows(problem).items()
    }
    for processor in wheels:
        entries |= measure_ours(case, problem, repetitions, processor)
    return entries


def unanswered(peers: Mapping[str, Any]) -> list[str]:
    """What has no times although it is installed: one sentence each."""
    return [
        f"{case}, {name}: {entry['reason']}"
        for case, found in peers["cases"].items()
        for name, entry in found["contenders"].items()
        if entry["reason"] not in ("", NOT_INSTALLED)
    ]


UNITS = {"acceleration": "m/s², rad/s²", "torque": "N·m", "force": "N", "thrust": "N"}
_WHERE = {"tick": "from Python", "inside": "inside C"}
_KEPT = ("p50", "p99", "max")
_POSED = {
    "joints": "joints",
    "contact_points": "contact points",
    "ticks": "ticks",
    "contact_changes": "contact changes",
    "load_median": "load over weight, median",
    "load_least": "least",
    "friction_active": "points on their cone, share",
    "torque_active": "ticks at a torque limit",
    "unsolved_by_us": "not solved by us",
}


def peer_tables(peers: Mapping[str, Any]) -> list[Table]:
    """Medians of all cases, the times of each, differences, what was posed, and versions."""
    found = peers["cases"]
    tables = [_medians(peers), *(_times(name, case) for name, case in found.items())]
    tables += [_differences(peers), _posed(found), _versions(found)]
    return [table for table in tables if table.cells]


def _users_tick(entry: Mapping[str, Any]) -> dict[str, Any] | None:
    """Times of a tick as a user has it: called from Python where that is how it is called."""
    times = entry.get("times", {})
    found: dict[str, Any] | None = times.get("tick", times.get("inside"))
    return found


def _medians(peers: Mapping[str, Any]) -> Table:
    cells = []
    for case, found in peers["cases"].items():
        for name, entry in found["contenders"].items():
            times = _users_tick(entry)
            if times is not None:
                cells.append(
                    Cell(case, name, times["p50_us"], "µs", times["low_us"], times["high_us"])
                )
    note = (
        "TSID inside C++, all others called from Python. In brackets: least and largest median of "
        "a repetition. A walk "
        "goes through touchdown and lift-off. Our tick includes the gait, a peer's is given "
        "targets. Torque limits are "
        "rows of everybody's program. Ours is compiled for this processor, and as in wheels; peers "
        "are their wheels."
    )
    return Table("peers", "Peers: complete tick of the same program, p50, µs", tuple(cells), note)


def _times(case: str, found: Mapping[str, Any]) -> Table:
    cells: list[Cell] = []
    for name, entry in found["contenders"].items():
        if entry["reason"]:
            cells.append(Cell(name, "no times", entry["reason"]))
        for what, times in entry.get("times", {}).items():
            kept = [cell for cell in percentiles(name, times) if cell.column in _KEPT]
            cells += [cell._replace(column=f"{_WHERE[what]}, {cell.column}") for cell in kept]
    note = (
        "Inside C: ours without the call from Python, the gait included; TSID's driver, which is "
        "C++ throughout; "
        "placo's two calls, update_kinematics and solve, without what Python sets before them."
    )
    name = case.replace(",", "").replace(" ", "_")
    return Table(f"peers_{name}", f"Peers, {case}: complete tick, µs", tuple(cells), note)


def _differences(peers: Mapping[str, Any]) -> Table:
    cells: list[Cell] = []
    for case, found in peers["cases"].items():
        for name, entry in found["contenders"].items():
            if "compared" not in entry:
                continue
            row = f"{case}: {name}"
            cells += [
                Cell(row, "ticks", entry["compared"]),
                Cell(row, "differing", entry["differing"]),
            ]
            cells += [
                Cell(row, f"{q}, largest", entry["difference_max"].get(q), UNITS[q])
                for q in TOLERANCE
            ]
            if "apart" in entry:
                cells.append(Cell(row, "torque, median from ours", entry["apart"]["median"], "N·m"))
    limits = ", ".join(
        f"{name} {value:g} {UNITS[name]}" for name, value in peers["tolerance"].items()
    )
    note = (
        f"Times count only if no tick differs by more than: {limits}. placo's planar contact poses "
        f"another program, in "
        "which no bound holds the moment about the normal, and all three moments have one weight; "
        "it is compared with "
        "that one's solutions, and its distance from ours is told besides."
    )
    return Table(
        "peers_check",
        "Peers: differences from our solution of the same program",
        tuple(cells),
        note,
    )


def _posed(found: Mapping[str, Any]) -> Table:
    cells = [
        Cell(name, heading, case[key])
        for name, case in found.items()
        for key, heading in _POSED.items()
    ]
    return Table("peers_posed", "Peers: what was posed, over the ticks that count", tuple(cells))


def _versions(found: Mapping[str, Any]) -> Table:
    versions: dict[tuple[str, str], str] = {}
    for case in found.values():
        for name, entry in case["contenders"].items():
            versions |= {
                (name, package): version for package, version in entry.get("versions", {}).items()
            }
    cells = tuple(Cell(name, package, version) for (name, package), version in versions.items())
    return Table("peers_versions", "Peers: versions", cells)
