"""The complete tick of every controller and governor there is, in turns on the same states: medians and histograms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from comparison.campaign.plan import contenders
from comparison.replay import TickReplay, timer_overhead, without_gc
from comparison.states import StateSequence
from comparison.statistics import Laps, summarise
from comparison.timing import TimingSettings
from harpy_pin.control import make_controller
from harpy_pin.gait import make_gait
from harpy_pin.robot import Robot

__all__ = ["BINS_PER_DECADE", "histogram", "time_ticks"]

BINS_PER_DECADE = 50
"""Bins of a histogram from 1 µs to 10 µs, and so on."""


def time_ticks(
    robot: Robot,
    sequences: Sequence[StateSequence],
    *,
    friction: float,
    settings: TimingSettings,
    rng: np.random.Generator,
    on_pass: Callable[[], None] = lambda: None,
) -> dict[str, Any]:
    """Time the complete tick of everyone.

    Args:
        robot: who walked.
        sequences: the states, the same for everyone.
        friction: coefficient that the controllers assume.
        settings: how to time (its ``programs`` and ``samples`` are not used).
        rng: draws the order of turns.
        on_pass: called after each pass, never during one.

    Returns:
        For each contender percentiles, µs, the least and largest median of a repetition, and a histogram.
    """
    players = {}
    for controller, governor in contenders():
        made = make_controller(controller, make_gait(robot), mu=friction, governor=governor or "none")
        players[f"{controller}/{governor}" if governor else controller] = TickReplay(made)
    names = list(players)
    laps: dict[str, list[Laps]] = {name: [] for name in names}
    overheads = []
    for _ in range(settings.repetitions):
        taken: dict[str, list[Laps]] = {name: [] for name in names}
        for sequence in sequences:
            for player in players.values():
                player.start(sequence.states)
            with without_gc():
                overheads.append(timer_overhead())
                for begin in range(0, len(sequence), settings.block):
                    for k in rng.permutation(len(names)):
                        players[names[int(k)]].play(begin, begin + settings.block)
            tick = np.arange(len(sequence))
            counted = (tick >= settings.warm_up) & (tick % settings.block >= settings.settle)
            for name, player in players.items():
                taken[name].append(player.laps[counted, 0])
        for name in names:
            laps[name].append(np.concatenate(taken[name]))
        on_pass()
    overhead = float(np.median(overheads))
    result: dict[str, Any] = {}
    for name in names:
        medians = [max(float(np.median(part)) - overhead, 0.0) * 1e-3 for part in laps[name]]
        result[name] = {
            **summarise(laps[name], overhead),
            "low_us": min(medians),
            "high_us": max(medians),
            "histogram": histogram(np.maximum(np.concatenate(laps[name]) - overhead, 1.0) * 1e-3),
        }
    return result


def histogram(times: Any) -> dict[str, list[float]]:
    """Counts of times, µs, in bins of equal width on a logarithmic axis, from the first to the last that is not empty.

    The bins' edges are the same whatever the times are: histograms can be laid over each other.
    """
    exponents = np.floor(np.log10(times) * BINS_PER_DECADE).astype(int)
    first, last = int(exponents.min()), int(exponents.max())
    counts = np.bincount(exponents - first, minlength=last - first + 1)
    edges = 10.0 ** (np.arange(first, last + 2) / BINS_PER_DECADE)
    return {"edges_us": edges.tolist(), "counts": [int(n) for n in counts]}
