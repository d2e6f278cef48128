"""The complete tick of every controller and governor, interleaved on the same states.

The states are those of walks with pushes: touchdowns, recoveries, ticks where constraints are active.
"""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter_ns
from typing import Any

import numpy as np

from comparison.contenders import CONTENDERS, FORCES, controller_part
from comparison.measure.controllers import Contender
from comparison.measure.interleave import Bench
from comparison.measure.states import StateSequence
from comparison.measure.statistics import Laps, summarise, summarise_repetitions
from comparison.measure.tick_replay import TickReplay
from harpy_pin.controllers import WholeBodyController, WholeBodyParameters
from harpy_pin.gaits import make_gait
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import State
from harpy_pin.wbc import WholeBodyLimits, installed_solvers

__all__ = ["BINS_PER_DECADE", "RATES", "histogram", "make_all", "time_ticks"]

BINS_PER_DECADE = 50
"""Bins of a histogram from 1 µs to 10 µs, and so on."""

RATES = (1, 2, 5, 10)
"""Control rates, kHz, whose periods a tick may miss."""

COLD = 200
"""Ticks right after a reset that are timed."""


def make_all(robot: Robot, friction: float) -> dict[str, Contender]:
    """Every controller and governor of the campaign, the QP in contact forces, and QPs that reuse no active set."""
    made: dict[str, Contender] = {}
    for name in CONTENDERS:
        controller = controller_part(name).make(make_gait(robot), mu=friction, period=1e-3, fitting={})
        assert isinstance(controller, Contender)
        made[name] = controller
    forces = WholeBodyParameters(formulation="contact_force", limits=WholeBodyLimits(mu=friction))
    made[FORCES] = WholeBodyController(make_gait(robot), forces)
    for solver in (name for name in ("proxqp", "daqp") if name in installed_solvers()):
        parameters = WholeBodyParameters(solver=solver, reuse=False, limits=WholeBodyLimits(mu=friction))
        made[f"wbc/{solver}"] = WholeBodyController(make_gait(robot), parameters)
    return made


def time_ticks(bench: Bench, sequences: Sequence[StateSequence]) -> dict[str, Any]:
    """Time the complete tick of every controller.

    Returns:
        For each contender percentiles, µs, the least and largest median of a repetition, how many ticks were longer
        than the periods of :data:`RATES`, the ticks right after a reset, and a histogram.
    """
    timed = {name: TickReplay(controller) for name, controller in make_all(bench.robot, bench.friction).items()}

    def start(k: int) -> dict[str, TickReplay]:
        for timer in timed.values():
            timer.start(sequences[k].states)
        return timed

    laps, overhead = bench.repeat(start, [len(sequence) for sequence in sequences], block=bench.settings.block)
    result: dict[str, Any] = {}
    for name, timer in timed.items():
        times = np.maximum(np.concatenate(laps[name])[:, 0] - overhead, 1.0) * 1e-3
        cold = summarise([_first_ticks(timer.controller, sequences[0].states)], overhead)
        result[name] = {
            **summarise_repetitions(laps[name], overhead),
            "misses": {f"{rate} kHz": int(np.count_nonzero(times > 1e3 / rate)) for rate in RATES},
            "cold_p50_us": cold["p50_us"],
            "cold_p99_us": cold["p99_us"],
            "histogram": histogram(times),
        }
    return result


def _first_ticks(controller: Contender, states: Sequence[State]) -> Laps:
    """Times of ticks right after a reset, ns: no warm start, no active set, no applied reference."""
    chosen = np.linspace(0, len(states) - 1, min(COLD, len(states))).astype(int)
    laps = np.zeros(len(chosen), dtype=np.int64)
    for k, i in enumerate(chosen):
        controller.reset()
        begin = perf_counter_ns()
        controller.step(states[i])
        laps[k] = perf_counter_ns() - begin
    return laps


def histogram(times: Any) -> dict[str, list[float]]:
    """Counts of times, µs, in bins of equal width on a logarithmic axis, from the first to the last that is not empty.

    The bins' edges are the same whatever the times are: histograms can be laid over each other.
    """
    exponents = np.floor(np.log10(times) * BINS_PER_DECADE).astype(int)
    first, last = int(exponents.min()), int(exponents.max())
    counts = np.bincount(exponents - first, minlength=last - first + 1)
    edges = 10.0 ** (np.arange(first, last + 2) / BINS_PER_DECADE)
    return {"edges_us": edges.tolist(), "counts": [int(n) for n in counts]}
