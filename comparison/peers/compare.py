"""All peers on recorded states and on standing robots: checked first, then timed, beside our own controllers.

The robots of the table of growth stand and sway on points, as the peers' contacts are, a humanoid on its two ankles,
without thrusters. The condensed WBC takes no point foot at the end of six joints.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from comparison.measure.timing import TimingSettings, describe_all_versions, describe_machine
from comparison.measure.walking import StateSequence, make_contender, record_states, recorded_walk, stage, sway
from comparison.peers.environment import PEERS
from comparison.peers.measure_peer import (
    OURS,
    TOLERANCE,
    Ours,
    WholeBody,
    measure_peer,
    peers_parameters,
    summarise_times,
    the_peers_program,
    time_inside_c,
)
from comparison.peers.peer_problem import PeerProblem, make_problem
from comparison.tables import Cell, Table, percentiles
from harpy_pin.controllers import CondensedController, WholeBodyController
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.files import finite
from harpy_pin.gaits import Gait, Standing
from harpy_pin.model.robot import load_harpy, load_robot
from harpy_pin.wbc import WholeBodyWeights

RECORDED = ("governed", "wbc")
"""Whose walks give the states."""


def compare_peers(
    progress: Callable[[str, int, int], None],
    friction: float,
    duration: float,
    *,
    timing: TimingSettings,
    folder: Path,
    growth: Sequence[str],
) -> dict[str, Any]:
    """Walk, then check and time every peer and our own controllers on the states.

    The duration of a walk is in s; ``folder`` has the peers' environments; ``growth`` are the robots of the table
    of growth. Progress is never called while a clock runs.

    Returns:
        ``machine``, ``versions`` and ``peers``, of which ``contenders`` has for each either a ``reason`` why it has no
        times, or the differences from our solutions and the times of ``tick`` and ``solve`` in single and double
        support. Ready for JSON.
    """
    machine, robot, sequences = describe_machine(), load_harpy(), []
    step = stage(progress, "walking", len(RECORDED))
    for name in RECORDED:
        run = recorded_walk(name, friction=friction, duration=duration)
        sequences.append(record_states(name, run, least=timing.warm_up + 50))
        step()
    step = stage(progress, "peers", len(PEERS) + 3)
    most, repetitions = 2 * max(timing.programs, timing.warm_up), min(timing.repetitions, 5)
    problem = make_problem(robot, sequences, friction=friction, warm_up=timing.warm_up, most=most)
    makers: dict[str, Callable[[], WholeBody]] = {
        OURS: lambda: make_contender("wbc", robot, friction),
        f"{OURS}, the peers' program, WBC QP": lambda: WholeBodyController(*the_peers_program(robot, friction)),
        f"{OURS}, the peers' program, condensed WBC": lambda: CondensedController(*the_peers_program(robot, friction)),
    }
    mine = {name: Ours(make, sequences, most) for name, make in makers.items()}
    # Ours before and after the others: a drift of the machine's speed shows in the spread of its medians.
    before = (repetitions + 1) // 2
    for controller in mine.values():
        controller.replay(before)
    step()
    others: dict[str, Any] = {}
    for name, peer in PEERS.items():
        others |= measure_peer(name, peer, problem, folder, repetitions)
        step()
    for controller in mine.values():
        controller.replay(repetitions - before)
    step()
    ours = mine.pop(OURS)
    inside_c, times = time_inside_c(friction, duration), summarise_times(problem, ours.times(), ours.overhead)
    contenders: dict[str, Any] = {
        f"{OURS}, condensed WBC inside C, a walk of its own": {"reason": "", "times": inside_c},
        OURS: {"reason": "", "times": times},
        **{name: controller.entry(problem) for name, controller in mine.items()},
        **others,
    }
    peers = {
        "friction": friction,
        "ticks": len(problem),
        "unsolved_by_us": {name: int(np.count_nonzero(~e.solved)) for name, e in problem.expected.items()},
        "repetitions": repetitions,
        "tolerance": dict(TOLERANCE),
        "contenders": contenders,
        "growth": {
            name: _growth_of(name, folder, warm_up=timing.warm_up, most=most // 5, repetitions=repetitions)
            for name in growth
        },
    }
    step()
    document: dict[str, Any] = finite({"peers": peers, "machine": machine, "versions": describe_all_versions()})
    return document


SHORT_LEGS = WholeBodyWeights(body=1e3, orientation=1e2, swing=5e3, arms=1e3, thrust=5.0, force=1e-2)
"""For legs of three joints: the default weights times 1,000 but that of the legs' posture, 1e-6.

The condensed WBC has no cost of posture there, and its torques differ in proportion to that cost's share: by up to
0.06 N·m on Go2 with the default weights, by 7e-5 with these."""

LONG_LEGS = WholeBodyWeights(posture=1e-2)
"""On two points the ankles are free, and only the cost of posture decides their accelerations."""

ROBOTS: dict[str, tuple[WholeBodyWeights, tuple[str, ...]]] = {
    "bolt": (SHORT_LEGS, ()),
    "solo12": (SHORT_LEGS, ()),
    "go2": (SHORT_LEGS, ()),
    "g1": (LONG_LEGS, ("left_ankle_roll_link", "right_ankle_roll_link")),
    "talos": (LONG_LEGS, ("leg_left_6_link", "leg_right_6_link")),
}
"""By name: weights, and the links that stand on the ground as points; none where the robot's own feet are points."""

_FRICTION = 0.5
_SWAYS = 800
"""States of a robot: two periods."""
_PERIOD = 0.4
_AMPLITUDE = 0.02
"""Standard deviation over the directions of the sway, m and rad."""


def standing_problem(
    name: str, folder: Path, *, warm_up: int, most: int = _SWAYS
) -> tuple[PeerProblem, Callable[[], Gait], StateSequence]:
    """A robot that stands and sways: the problem, what makes its gait, and its states.

    Args:
        name: of the robot.
        folder: for a copy of its URDF without meshes, which placo would load.
        warm_up: ticks that are not counted.
        most: ticks.
    """
    robot, posture = load_robot(name), None
    weights, feet = ROBOTS[name]
    if feet:
        posture = Standing(robot).initial_state()[0][7:]
        robot = load_robot(robot.urdf, feet=feet)
    rest, force = Standing(robot, posture).initial_state()[0], np.zeros((len(robot.feet), 3))
    force[:, 2] = robot.mass * 9.81 / len(robot.feet)
    amplitude, rate = _AMPLITUDE * np.random.default_rng(0).standard_normal(robot.model.nv), 2.0 * np.pi / _PERIOD
    sequence = StateSequence(
        name, tuple(sway(robot, rest, amplitude, 0.001 * rate * np.arange(most, dtype=np.float64), rate, force))
    )
    how: dict[str, Any] = {"friction": _FRICTION, "warm_up": warm_up, "most": most, "weights": weights}
    problem = make_problem(robot, [sequence], gait=Standing(robot, posture), **how)
    tree, urdf = ElementTree.parse(str(robot.urdf)), folder / f"{name}.urdf"
    for link in tree.getroot().iter("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    tree.write(urdf)
    problem = replace(problem, settings={**problem.settings, "urdf": str(urdf)})
    return problem, partial(Standing, robot, posture), sequence


def _growth_of(robot: str, folder: Path, *, warm_up: int, most: int, repetitions: int) -> dict[str, Any]:
    """A tick of everybody on one of :data:`ROBOTS`; a reason where there is none."""
    with TemporaryDirectory() as scratch:
        try:
            problem, gait, sequence = standing_problem(robot, Path(scratch), warm_up=warm_up, most=most)
        except HarpyError as error:
            return {"reason": str(error).splitlines()[0]}
        entries: dict[str, Any] = {}
        parameters = peers_parameters(_FRICTION, ROBOTS[robot][0])
        for name, kind in (("WBC QP", WholeBodyController), ("condensed WBC", CondensedController)):

            def make(kind: type[WholeBody] = kind) -> WholeBody:
                return kind(gait(), parameters)

            try:
                ours = Ours(make, [sequence], len(sequence))
                ours.replay(repetitions)
                entries[f"{OURS}, {name}"] = ours.entry(problem)
            except InputError as error:
                entries[f"{OURS}, {name}"] = {"reason": str(error).splitlines()[0]}
        for name, peer in PEERS.items():
            # Without thrusters both variants pose the same program.
            entries[name] = measure_peer(name, peer, problem, folder, repetitions)[f"{name}, thrusts decided"]
    return {
        "joints": problem.expected["decided"].torque.shape[1],
        "feet": len(problem.settings["feet"]),
        "ticks": len(problem),
        "unsolved_by_us": int(np.count_nonzero(~problem.expected["decided"].solved)),
        "contenders": {name: _summary(entry) for name, entry in entries.items()},
    }


def _summary(entry: Mapping[str, Any]) -> dict[str, Any]:
    """What the table says of a contender: its median tick, µs, or why there is none."""
    times = next(iter(entry.get("times", {}).values()), None)
    return {
        "reason": entry["reason"],
        "p50_us": None if times is None else times["tick"]["p50_us"],
        "difference": entry.get("difference_max", {}).get("torque"),
    }


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


def _times(peers: Mapping[str, Any], what: str) -> Table:
    text, note = _TIMES[what]
    cells: list[Cell] = []
    for name, entry in peers["contenders"].items():
        if "times" not in entry:
            cells.append(Cell(name, "no times", entry["reason"]))
        for support, times in entry.get("times", {}).items():
            cells += percentiles(f"{name}: {support}", times[what]) if what in times else []
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
