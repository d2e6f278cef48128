"""All cases: peers and our own controllers on the same program of the same states, checked first,
then timed.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.measure.timing import TimingSettings, describe_all_versions, describe_machine
from comparison.measure.walking import Rows, stage
from comparison.peers.cases import cases
from comparison.peers.environment import NOT_INSTALLED
from comparison.peers.measure_peer import PROCESSORS, TOLERANCE, Row, measure_ours, measure_peer
from comparison.peers.peer_problem import Case, PeerProblem, make_problem
from comparison.study import Value, View, shown
from comparison.tables import PERCENTILES, Cell, Table
from harpy_pin.files import finite

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
    load = expected.force[counts][..., 2].sum(axis=1) / (robot.mass * hp.model.GRAVITY)
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
_KEPT = {key: name for key, name in PERCENTILES.items() if name in ("p50", "p99", "max")}


def _time(key: str, *kinds: str) -> Value:
    """Of one contender the percentile of the first of these kinds of tick that it has."""

    def cell(rows: Rows) -> Cell | None:
        found = [rows[0]["times"][kind] for kind in kinds if kind in rows[0].get("times", {})]
        if not found:
            return None
        spread = [found[0][name] for name in ("low_us", "high_us") if key == "p50_us"]
        return Cell("", "", found[0][key], "µs", *spread)

    return cell


def _largest(quantity: str) -> Value:
    return lambda rows: rows[0]["difference_max"].get(quantity)


_LIMITS = ", ".join(f"{name} {value:g} {UNITS[name]}" for name, value in TOLERANCE.items())
_OF_CONTENDERS = (
    View(
        "peers",
        "Peers: complete tick of the same program, p50, µs",
        row="{case}",
        across="{name}",
        columns=_time("p50_us", "tick", "inside"),  # as a user has it
        note="TSID inside C++, all others called from Python. In brackets: least and largest "
        "median of a repetition. A walk goes through touchdown and lift-off. Our tick includes the "
        "gait, a peer's is given targets. Torque limits are rows of everybody's program. Ours is "
        "compiled for this processor, and as in wheels; peers are their wheels.",
        only=lambda row: bool(row.get("times")),
    ),
    View(
        lambda row: f"peers_{row['case']}".replace(",", "").replace(" ", "_"),
        "Peers, {case}: complete tick, µs",
        row="{name}",
        columns={
            **{
                f"{where}, {name}": _time(key, kind)
                for kind, where in (("tick", "from Python"), ("inside", "inside C"))
                for key, name in _KEPT.items()
            },
            "no times": lambda rows: rows[0]["reason"] or None,
        },
        note="Inside C: ours without the call from Python, the gait included; TSID's driver, which "
        "is C++ throughout; placo's two calls, update_kinematics and solve, without what Python "
        "sets before them.",
    ),
    View(
        "peers_check",
        "Peers: differences from our solution of the same program",
        row="{case}: {name}",
        columns={
            "ticks": shown("compared"),
            "differing": shown("differing"),
            **{f"{name}, largest": (_largest(name), unit) for name, unit in UNITS.items()},
            "torque, median from ours": (
                lambda rows: rows[0]["apart"]["median"] if "apart" in rows[0] else None,
                "N·m",
            ),
        },
        note=f"Times count only if no tick differs by more than: {_LIMITS}. placo's planar contact "
        "poses another program, in which no bound holds the moment about the normal, and all three "
        "moments have one weight; it is compared with that one's solutions, and its distance from "
        "ours is told besides.",
        only=lambda row: "compared" in row,
    ),
)
_POSED = View(
    "peers_posed",
    "Peers: what was posed, over the ticks that count",
    row="{case}",
    columns={
        "joints": shown("joints"),
        "contact points": shown("contact_points"),
        "ticks": shown("ticks"),
        "contact changes": shown("contact_changes"),
        "load over weight, median": shown("load_median"),
        "least": shown("load_least"),
        "points on their cone, share": shown("friction_active"),
        "ticks at a torque limit": shown("torque_active"),
        "not solved by us": shown("unsolved_by_us"),
    },
)
_VERSIONS = View(
    "peers_versions", "Peers: versions", "{name}", shown("version"), across="{package}"
)


def peer_tables(peers: Mapping[str, Any]) -> list[Table]:
    """Medians of all cases, the times of each, differences, what was posed, and versions."""
    cases = [{"case": case, **found} for case, found in peers["cases"].items()]
    rows = [
        {"case": case["case"], "name": name, **entry}
        for case in cases
        for name, entry in case["contenders"].items()
    ]
    versions = [
        {"name": row["name"], "package": package, "version": version}
        for row in rows
        for package, version in row.get("versions", {}).items()
    ]
    tables = [table for view in _OF_CONTENDERS for table in view.of(rows)]
    return [*tables, *_POSED.of(cases), *_VERSIONS.of(versions)]
