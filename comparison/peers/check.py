"""What a worker returns, and the check that it solved the given problem; without that no time counts."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from comparison.measure.statistics import Laps
from comparison.peers.peer_problem import Expected, PeerProblem
from comparison.peers.worker import WorkerError
from harpy_pin.model.state import Vector

__all__ = ["TOLERANCE", "UNITS", "Answer", "Verdict", "check", "load_answers"]

TOLERANCE = {"acceleration": 1e-4, "torque": 1e-3, "force": 1e-3, "thrust": 1e-3}
"""Largest accepted difference from our solution, in the unit of each quantity.

The program is strictly convex, so that its solution is one point; but how forces share a load weighs 1e-5 per N²,
and where two solvers stop at a gap of 1e-8 their forces may differ by some 1e-2 N in theory, by 2e-5 N as measured.
"""

UNITS = {"acceleration": "m/s², rad/s²", "torque": "N·m", "force": "N", "thrust": "N"}


@dataclass(frozen=True)
class Answer:
    """Solutions and times of one variant of the problem.

    Attributes:
        quantities: arrays shaped as those of :class:`~comparison.peers.peer_problem.Expected`, NaN where unsolved; the
            thrusts are absent where they were given.
        tick: (repetitions, ticks) times of the complete tick, ns.
        solve: (repetitions, ticks) times of the solver's call only, ns.
        overhead: of the timer, ns.
        versions: of what was run.
        terms: (repetitions, ticks) times of Pinocchio's rigid-body terms alone, ns, where the peer measured them.
    """

    quantities: dict[str, Vector]
    tick: Laps
    solve: Laps
    overhead: float
    versions: dict[str, str]
    terms: Laps | None = None


@dataclass(frozen=True)
class Verdict:
    """Whether an answer equals our solution.

    Attributes:
        reason: why it is not; empty if it is.
        compared: ticks compared.
        differing: ticks beyond the tolerance, or unsolved by the peer.
        difference_max: largest difference by quantity.
        difference_median: median over the ticks of their largest difference, by quantity.
    """

    reason: str
    compared: int
    differing: int
    difference_max: dict[str, float]
    difference_median: dict[str, float]

    @property
    def passed(self) -> bool:
        """Whether every tick is within the tolerance."""
        return not self.reason


def load_answers(path: Path, problem: PeerProblem) -> dict[str, Answer]:
    """Read a worker's file.

    Args:
        path: ``.npz`` with ``<variant>_<quantity>``, ``<variant>_tick_ns``, ``<variant>_solve_ns``, ``overhead_ns``,
            perhaps ``<variant>_terms_ns``, and ``versions`` (JSON).
        problem: that was posed; gives the shapes.

    Returns:
        The answers by variant; those the peer did not pose are absent.

    Raises:
        WorkerError: the file is not such a file.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {key: file[key] for key in file.files}
        versions = {str(name): str(value) for name, value in json.loads(str(found["versions"])).items()}
        overhead = float(found["overhead_ns"])
        answers = {}
        for variant, expected in problem.expected.items():
            if f"{variant}_tick_ns" in found:
                answers[variant] = _answer(found, variant, expected, overhead, versions)
    except (OSError, ValueError, KeyError, EOFError, AttributeError, TypeError, zipfile.BadZipFile) as error:
        raise WorkerError(f"its result cannot be read: {error}") from error
    if not answers:
        raise WorkerError("its result holds no answer")
    return answers


def _answer(
    found: Mapping[str, Any], variant: str, expected: Expected, overhead: float, versions: dict[str, str]
) -> Answer:
    quantities = {}
    for name in TOLERANCE:
        if name == "thrust" and variant == "given":
            continue
        shape = getattr(expected, name).shape
        value = np.asarray(found[f"{variant}_{name}"], dtype=np.float64)
        if value.shape != shape:
            raise ValueError(f"{variant}_{name} has shape {value.shape}, expected {shape}")
        quantities[name] = value
    laps = {}
    for name in ("tick", "solve", *(["terms"] if f"{variant}_terms_ns" in found else [])):
        value = np.asarray(found[f"{variant}_{name}_ns"])
        if value.ndim != 2 or value.shape[1] != len(expected.solved) or value.dtype.kind not in "iu":
            raise ValueError(f"{variant}_{name}_ns is no table of integer times, one column per tick")
        laps[name] = value.astype(np.int64)
    return Answer(quantities, laps["tick"], laps["solve"], overhead, versions, laps.get("terms"))


def check(answer: Answer, expected: Expected) -> Verdict:
    """Compare an answer with our solutions, at every tick that our own solver solved.

    A tick that the peer did not solve counts as differing.
    """
    ticks = expected.solved
    compared = int(np.count_nonzero(ticks))
    if compared == 0:
        return Verdict("our own solver solved nothing to compare with", 0, 0, {}, {})
    wrong = np.zeros(compared, dtype=np.bool_)
    unsolved = np.zeros(compared, dtype=np.bool_)
    largest, median = {}, {}
    for name, value in answer.quantities.items():
        if value.size == 0:
            continue  # a robot without thrusters
        each = np.abs(value - getattr(expected, name))[ticks].reshape(compared, -1).max(axis=1)
        finite = each[np.isfinite(each)]
        largest[name] = float(finite.max()) if len(finite) else float("nan")
        median[name] = float(np.median(finite)) if len(finite) else float("nan")
        unsolved |= ~np.isfinite(each)
        wrong |= ~(each <= TOLERANCE[name])
    differing = int(np.count_nonzero(wrong))
    reason = ""
    if differing:
        reason = f"not comparable: {differing} of {compared} ticks differ from our solution"
        lost = int(np.count_nonzero(unsolved))
        if lost:
            reason += f", {lost} of them unsolved"
    return Verdict(reason, compared, differing, largest, median)
