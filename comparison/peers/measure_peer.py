"""One peer: posed the problem, checked, and its times. Without the check that it solved the problem no time counts."""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from comparison.measure.timing import Laps, TimingSettings, summarise_repetitions
from comparison.peers.environment import Peer, WorkerError, interpreter, run_worker
from comparison.peers.peer_problem import VARIANTS, Expected, PeerProblem
from harpy_pin.model.state import Vector

TOLERANCE = {"acceleration": 1e-4, "torque": 1e-3, "force": 1e-3, "thrust": 1e-3}
"""Largest accepted difference from our solution, in the unit of each quantity.

The program is strictly convex, so that its solution is one point; but how forces share a load weighs 1e-5 per N²,
and where two solvers stop at a gap of 1e-8 their forces may differ by some 1e-2 N in theory, by 2e-5 N as measured.
"""


@dataclass(frozen=True, kw_only=True)
class PeerSettings:
    """How much to measure: ticks of each sequence from its start, those not counted, and repetitions of the replay."""

    most: int = 4000
    warm_up: int = 50
    repetitions: int = 5

    @classmethod
    def of(cls, timing: TimingSettings) -> PeerSettings:
        """As thorough as the rest of a comparison."""
        most = max(2 * timing.programs, 2 * timing.warm_up)
        return cls(most=most, warm_up=timing.warm_up, repetitions=min(timing.repetitions, 5))


@dataclass(frozen=True)
class Answer:
    """Solutions and times of one variant of the problem.

    Attributes:
        quantities: arrays shaped as those of :class:`~comparison.peers.peer_problem.Expected`, NaN where unsolved; the
            thrusts are absent where they were given.
        laps: (repetitions, ticks) times, ns: of the complete ``tick``, perhaps of the ``solve``, the solver's call
            only.
        overhead: of the timer, ns.
        versions: of what was run.
    """

    quantities: dict[str, Vector]
    laps: dict[str, Laps]
    overhead: float
    versions: dict[str, str]

    def entry(self, problem: PeerProblem, variant: str) -> dict[str, Any]:
        """How far it is from our solutions, and its times if it is near enough."""
        entry = {**check(self.quantities, problem.expected[variant]), "versions": self.versions}
        if not entry["reason"]:
            entry["times"] = summarise_times(problem, self.laps, self.overhead)
        return entry


def measure_peer(name: str, peer: Peer, problem: PeerProblem, folder: Path, repetitions: int) -> dict[str, Any]:
    """Entries of both variants of a peer."""
    names = {variant: f"{name}, thrusts {variant}" for variant in VARIANTS}
    try:
        with TemporaryDirectory() as scratch:
            asked, result = Path(scratch) / "problem.npz", Path(scratch) / "result.npz"
            problem.save(asked, repetitions)
            run_worker(interpreter(folder, name), peer.worker, asked, result)
            answers = load_answers(result, problem)
    except WorkerError as error:
        return {key: {"reason": str(error)} for key in names.values()}
    return {key: answers[variant].entry(problem, variant) for variant, key in names.items()}


def load_answers(path: Path, problem: PeerProblem) -> dict[str, Answer]:
    """Read a worker's file: the answers by variant.

    Args:
        path: ``.npz`` with ``<variant>_<quantity>``, ``<variant>_tick_ns``, ``<variant>_solve_ns``, ``overhead_ns``,
            and ``versions`` (JSON).
        problem: that was posed; gives the shapes.

    Raises:
        WorkerError: the file is not such a file.
    """
    answers = {}
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {key: file[key] for key in file.files}
        versions = {str(name): str(value) for name, value in json.loads(str(found["versions"])).items()}
        for variant, expected in problem.expected.items():
            quantities, laps = {}, {}
            for name in [name for name in TOLERANCE if (name, variant) != ("thrust", "given")]:
                quantities[name] = np.asarray(found[f"{variant}_{name}"], dtype=np.float64)
                if quantities[name].shape != getattr(expected, name).shape:
                    raise ValueError(f"{variant}_{name} has shape {quantities[name].shape}")
            for name in ("tick", "solve"):
                value = np.asarray(found[f"{variant}_{name}_ns"])
                if value.ndim != 2 or value.shape[1] != len(expected.solved) or value.dtype.kind not in "iu":
                    raise ValueError(f"{variant}_{name}_ns is no table of integer times, one column per tick")
                laps[name] = value.astype(np.int64)
            answers[variant] = Answer(quantities, laps, float(found["overhead_ns"]), versions)
    except (OSError, ValueError, KeyError, EOFError, AttributeError, TypeError, zipfile.BadZipFile) as error:
        raise WorkerError(f"its result cannot be read: {error}") from error
    return answers


def check(quantities: dict[str, Vector], expected: Expected) -> dict[str, Any]:
    """Compare an answer with our solutions, at every tick that our own solver solved.

    Returns:
        ``reason`` why it is not ours, empty if it is; ticks ``compared`` and ``differing``, those among them that the
        peer did not solve; largest difference and median of the ticks' largest differences by quantity.
    """
    ticks = expected.solved
    compared = int(np.count_nonzero(ticks))
    largest: dict[str, float] = {}
    median: dict[str, float] = {}
    found = {"compared": compared, "differing": 0, "difference_max": largest, "difference_median": median}
    if compared == 0:
        return {"reason": "our own solver solved nothing to compare with", **found}
    wrong, unsolved = np.zeros(compared, dtype=np.bool_), np.zeros(compared, dtype=np.bool_)
    for name, value in quantities.items():
        if value.size == 0:
            continue  # a robot without thrusters
        each = np.abs(value - getattr(expected, name))[ticks].reshape(compared, -1).max(axis=1)
        finite = each[np.isfinite(each)]
        largest[name] = float(finite.max()) if len(finite) else float("nan")
        median[name] = float(np.median(finite)) if len(finite) else float("nan")
        unsolved |= ~np.isfinite(each)
        wrong |= ~(each <= TOLERANCE[name])
    differing, lost = int(np.count_nonzero(wrong)), int(np.count_nonzero(unsolved))
    reason = f"not comparable: {differing} of {compared} ticks differ from our solution" if differing else ""
    reason += f", {lost} of them unsolved" if lost else ""
    return {"reason": reason, **found, "differing": differing}


def summarise_times(problem: PeerProblem, laps: dict[str, Laps], overhead: float) -> dict[str, Any]:
    """Summaries by support and by what was timed, with the least and largest median of a repetition."""
    result: dict[str, Any] = {}
    for support, mask in problem.supports.items():
        chosen = mask & (problem.counted > 0.0)
        if chosen.any():
            result[support] = {
                what: summarise_repetitions([row[chosen] for row in rows], overhead) for what, rows in laps.items()
            }
    return result
