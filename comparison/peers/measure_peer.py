"""One contender, a peer or ours: posed the problem, checked, and its times. Without the check no
time counts.
"""

import json
import os
import pickle
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import comparison
from comparison.measure.timing import Laps, summarise_repetitions
from comparison.peers.environment import (
    GIVEN_UP,
    PEERS,
    WorkerError,
    interpreter,
    last_line,
    run_worker,
)
from comparison.peers.our_replay import Timed, save
from comparison.peers.peer_problem import Case, Expected, PeerProblem
from harpy_pin.model.state import Vector

TOLERANCE = {"acceleration": 1e-4, "torque": 1e-3, "force": 1e-3, "thrust": 1e-3}
"""Largest accepted difference from our solution, in the unit of each quantity.

The program is strictly convex, so that its solution is one point. Solvers stop where they are right
to some 1e-8 of their own measure; torques then differ by at most 2e-4 N·m, as measured, forces by
4e-4 N.
"""

PROCESSORS = {"": {}, ", as in wheels": {"HARPY_PIN_FOR_A_WHEEL": "1"}}
"""What our kernels are compiled for, by what is added to the names of rows, and the environment
that does it.
"""


@dataclass(frozen=True)
class Answer:
    """Solutions and times."""

    quantities: dict[
        str, Vector
    ]  # shaped as those of :class:`~comparison.peers.peer_problem.Expected`, NaN: unsolved
    laps: dict[
        str, Laps
    ]  # (repetitions, ticks) of ``tick``, called from Python, and of what is ``inside`` C, ns
    overhead: Mapping[str, float]  # of their clocks, ns
    versions: dict[str, str]  # of what was run

    def entry(self, problem: PeerProblem) -> dict[str, Any]:
        """How far it is from our solutions, and its times if it is near enough."""
        entry = {**check(self.quantities, problem.expected), "versions": self.versions}
        if not entry["reason"]:
            counts = problem.counted > 0.0
            entry["times"] = {
                what: summarise_repetitions([row[counts] for row in rows], self.overhead[what])
                for what, rows in self.laps.items()
            }
        return entry


@dataclass(frozen=True)
class Row:
    """How a peer is asked."""

    peer: str  # of :data:`~comparison.peers.environment.PEERS`
    options: Mapping[str, Any] = field(default_factory=dict)  # what its worker is told besides
    # of another program, of which accelerations and torques are known
    expected: Expected | None = None


def measure_peer(row: Row, problem: PeerProblem, folder: Path, repetitions: int) -> dict[str, Any]:
    """An entry of a peer; of another program with how far its torques are ``apart`` from ours."""
    peer = PEERS[row.peer]
    try:
        with TemporaryDirectory() as scratch:
            asked, result = Path(scratch) / "problem.npz", Path(scratch) / "result.npz"
            problem.save(asked, repetitions, row.options)
            run_worker(interpreter(folder, peer.name), peer.worker, asked, result)
            answer = load_answer(result, problem)
    except WorkerError as error:
        return {"reason": str(error)}
    if row.expected is None:
        return answer.entry(problem)
    known = {name: answer.quantities[name] for name in ("acceleration", "torque")}
    apart = check({"torque": known["torque"]}, problem.expected)
    entry = replace(answer, quantities=known).entry(replace(problem, expected=row.expected))
    return entry | {
        "apart": {name: apart[f"difference_{name}"]["torque"] for name in ("median", "max")}
    }


def load_answer(path: Path, problem: PeerProblem) -> Answer:
    """Read a worker's file.

    Args:
        path: ``.npz`` with the quantities, ``tick_ns`` or ``inside_ns`` or both, ``overhead_ns``,
            and ``versions`` (JSON).
        problem: that was posed; gives the shapes.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {key: file[key] for key in file.files}
        versions = {
            str(name): str(value) for name, value in json.loads(str(found["versions"])).items()
        }
        quantities = {
            name: np.asarray(found[name], np.float64).reshape(getattr(problem.expected, name).shape)
            for name in TOLERANCE
        }
        laps = {
            what: found[f"{what}_ns"].reshape(-1, len(problem)).astype(np.int64, casting="safe")
            for what in ("tick", "inside")
            if f"{what}_ns" in found
        }
        if not laps:
            raise ValueError("there are no times")
        overhead = dict.fromkeys(laps, float(found["overhead_ns"]))
    except (
        OSError,
        ValueError,
        KeyError,
        EOFError,
        AttributeError,
        TypeError,
        zipfile.BadZipFile,
    ) as error:
        raise WorkerError(f"its result cannot be read: {error}") from error
    return Answer(quantities, laps, overhead, versions)


def check(quantities: dict[str, Vector], expected: Expected) -> dict[str, Any]:
    """Compare an answer with our solutions, at every tick that our own solver solved.

    Returns:
        ``reason`` why it is not ours, empty if it is; ticks ``compared`` and ``differing``, those
        among them that the peer did not solve; largest difference and median of the ticks' largest
        differences by quantity.
    """
    ticks = expected.solved
    compared = int(np.count_nonzero(ticks))
    largest: dict[str, float] = {}
    median: dict[str, float] = {}
    found = {
        "compared": compared,
        "differing": 0,
        "difference_max": largest,
        "difference_median": median,
    }
    if compared == 0:
        return {"reason": "our own solver solved nothing to compare with", **found}
    wrong, unsolved = np.zeros(compared, dtype=np.bool_), np.zeros(compared, dtype=np.bool_)
    for name, value in quantities.items():
        if value.size == 0:
            continue  # a robot without thrusters
        each = np.abs(value - getattr(expected, name))[ticks].reshape(compared, -1).max(axis=1)
        finite = each[np.isfinite(each)] if np.isfinite(each).any() else np.array([np.nan])
        largest[name], median[name] = float(finite.max()), float(np.median(finite))
        unsolved |= ~np.isfinite(each)
        wrong |= ~(each <= TOLERANCE[name])
    differing, lost = int(np.count_nonzero(wrong)), int(np.count_nonzero(unsolved))
    reason = (
        f"not comparable: {differing} of {compared} ticks differ from our solution"
        if differing
        else ""
    )
    reason += f", {lost} of them unsolved" if lost else ""
    return {"reason": reason, **found, "differing": differing}


def measure_ours(
    case: Case, problem: PeerProblem, repetitions: int, processor: str
) -> dict[str, dict[str, Any]]:
    """An entry for each of our controllers, compiled for one of :data:`PROCESSORS`."""
    with TemporaryDirectory() as scratch:
        asked, result = Path(scratch) / "case", Path(scratch) / "result"
        save(asked, case, repetitions)
        home = str(Path(comparison.__file__).parents[1])
        found = (
            os.environ
            | PROCESSORS[processor]
            | {"PYTHONPATH": os.pathsep.join([home, *filter(None, sys.path)])}
        )
        run = "import sys; from comparison.peers.our_replay import main; main(*sys.argv[1:])"
        command = [sys.executable, "-c", run, str(asked), str(result)]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=GIVEN_UP, env=found
            )
        except subprocess.TimeoutExpired:
            return {case.name: {"reason": f"no result after {GIVEN_UP:g} s"}}
        if done.returncode != 0:
            return {case.name: {"reason": last_line(done.stderr)}}
        timed: dict[str, Timed] = pickle.loads(result.read_bytes())
    joints = problem.expected.torque.shape[1]
    entries = {}
    for name, times in timed.items():
        thrust = times.commands[:, joints:].reshape(len(times.commands), -1, 3)
        quantities = {"torque": times.commands[:, :joints], "thrust": thrust}
        entries[f"{name}{processor}"] = Answer(
            quantities, times.laps, times.overhead, times.versions
        ).entry(problem)
    return entries
