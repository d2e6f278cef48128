"""One peer: posed the problem, checked, and its times."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparison.measure.interleave import TimingSettings
from comparison.measure.statistics import Laps, summarise_repetitions
from comparison.peers.check import Answer, check, load_answers
from comparison.peers.environment import Peer, interpreter
from comparison.peers.peer_problem import PeerProblem
from comparison.peers.worker import WorkerError, run_worker

__all__ = ["PeerSettings", "measure_peer", "summarise_times"]


@dataclass(frozen=True, kw_only=True)
class PeerSettings:
    """How much to measure.

    Attributes:
        most: ticks of each sequence, from its start.
        warm_up: ticks of each sequence that are not counted.
        repetitions: of every replay.
    """

    most: int = 4000
    warm_up: int = 50
    repetitions: int = 5

    @classmethod
    def of(cls, timing: TimingSettings) -> PeerSettings:
        """As thorough as the rest of a comparison."""
        return cls(
            most=max(2 * timing.programs, 2 * timing.warm_up),
            warm_up=timing.warm_up,
            repetitions=min(timing.repetitions, 5),
        )


def measure_peer(name: str, peer: Peer, problem: PeerProblem, folder: Path, repetitions: int) -> dict[str, Any]:
    """Entries of all variants of a peer."""
    entries: dict[str, Any] = {}
    try:
        answers = _answers(name, peer, problem, folder, repetitions)
    except WorkerError as error:
        return {f"{name}, thrusts {v}": {"reason": peer.variants[v] or str(error)} for v in peer.variants}
    for variant, impossible in peer.variants.items():
        key = f"{name}, thrusts {variant}"
        answer = answers.get(variant)
        if answer is None:
            entries[key] = {"reason": impossible or "its result lacks this variant"}
            continue
        verdict = check(answer, problem.expected[variant])
        entries[key] = {**asdict(verdict), "versions": answer.versions}
        if verdict.passed:
            entries[key]["times"] = summarise_times(problem, answer.tick, answer.solve, answer.overhead, answer.terms)
    return entries


def _answers(name: str, peer: Peer, problem: PeerProblem, folder: Path, repetitions: int) -> dict[str, Answer]:
    with TemporaryDirectory() as scratch:
        asked, result = Path(scratch) / "problem.npz", Path(scratch) / "result.npz"
        problem.save(asked, repetitions)
        run_worker(interpreter(folder, name), peer.worker, asked, result)
        return load_answers(result, problem)


def summarise_times(
    problem: PeerProblem, tick: Laps, solve: Laps | None, overhead: float, terms: Laps | None = None
) -> dict[str, Any]:
    """Summaries by support and by what was timed, with the least and largest median of a repetition."""
    counted: NDArray[np.bool_] = problem.counted > 0.0
    result: dict[str, Any] = {}
    for support, mask in problem.supports.items():
        chosen = mask & counted
        if not chosen.any():
            continue
        result[support] = {}
        for what, laps in (("tick", tick), ("solve", solve), ("terms", terms)):
            if laps is None:
                continue
            result[support][what] = summarise_repetitions([row[chosen] for row in laps], overhead)
    return result
