"""What the workers of all peers share: read a problem, solve it, time it, write the result.

Both are ``.npz`` files, described in :mod:`comparison.peers.peer_problem` and :mod:`comparison.peers.check`. A worker
runs this file in its own virtual environment: nothing of this library, and of no peer, is imported here.
"""

from __future__ import annotations

import gc
import json
from collections.abc import Callable, Sequence
from importlib.metadata import version
from time import perf_counter_ns
from typing import Any, Protocol

import numpy as np


class Replay(Protocol):
    """One variant of a problem, posed to a peer."""

    timed_torque: np.ndarray
    """(ticks, joints) torques of the last :meth:`replay`, N·m; NaN where the solver failed."""

    def solution(self, i: int) -> dict[str, Any] | None:
        """``acceleration``, ``torque``, ``force`` and ``thrust`` at a tick; None where the solver failed."""

    def replay(self, clocked: str) -> np.ndarray:
        """Every state in the order of time: (ticks,) times, ns.

        Timed is the ``tick``, from the state to the torques, or the ``solve``, the solver's call only.
        """


def main(
    pose: Callable[[dict[str, Any], str], Replay],
    packages: Sequence[str],
    variants: Sequence[str],
    problem_file: str,
    result_file: str,
) -> None:
    """Solve, time and write every variant that the peer can pose."""
    with np.load(problem_file) as file:
        problem: dict[str, Any] = {key: file[key] for key in file.files}
    settings = problem["settings"] = json.loads(str(problem["settings"]))
    out: dict[str, Any] = {"versions": json.dumps({name: version(name) for name in packages})}
    for variant in variants:
        peer = pose(problem, variant)
        for key, values in _solutions(peer, problem).items():
            out[f"{variant}_{key}"] = values
        gc.collect()
        gc.disable()
        for clocked in ("tick", "solve"):
            out[f"{variant}_{clocked}_ns"] = np.array([peer.replay(clocked) for _ in range(settings["repetitions"])])
        gc.enable()
        out[f"{variant}_torque"] = peer.timed_torque  # what was timed is what is checked
    laps = np.zeros(20_000, dtype=np.int64)
    for i in range(len(laps)):
        begin = perf_counter_ns()
        laps[i] = perf_counter_ns() - begin
    out["overhead_ns"] = np.median(laps)
    np.savez(result_file, **out)


def _solutions(peer: Replay, problem: dict[str, Any]) -> dict[str, np.ndarray]:
    """Solutions of all states; NaN where the solver failed."""
    (n, nv), settings = problem["v"].shape, problem["settings"]
    found = {
        "acceleration": np.full((n, nv), np.nan),
        "torque": np.full((n, nv - 6), np.nan),
        "force": np.full((n, len(settings["feet"]), 3), np.nan),
        "thrust": np.full((n, len(settings["thrusters"]), 3), np.nan),
    }
    for i in range(n):
        for key, value in (peer.solution(i) or {}).items():
            found[key][i] = np.reshape(value, found[key][i].shape)  # without thrusters a list is empty
    return found
