"""Interleaved timing: all candidates run block by block, in an order drawn anew for each block.

So a drift of the machine's speed affects all of them alike, and none always runs after the same other one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from comparison.measure.statistics import Laps
from comparison.measure.tick_replay import timer_overhead, without_gc
from harpy_pin.model.robot import Robot

__all__ = ["Bench", "Timed", "TimingSettings", "counted", "interleave"]


@dataclass(frozen=True, kw_only=True)
class TimingSettings:
    """How to time.

    Attributes:
        repetitions: of every pass.
        warm_up: ticks at the start of each sequence that are replayed but not counted: the solver's cold start and
            cold caches are among them.
        block: ticks per block.
        settle: ticks at the start of each block that are not counted: the replays before have used the caches.
        programs: quadratic programs per sequence for the isolated solvers.
        samples: solutions per sequence checked for optimality.
    """

    repetitions: int = 10
    warm_up: int = 50
    block: int = 500
    settle: int = 10
    programs: int = 2000
    samples: int = 100


@dataclass(frozen=True, kw_only=True)
class Bench:
    """What every timing needs.

    Attributes:
        robot: that walked.
        friction: coefficient that every controller assumes.
        settings: how to time.
        rng: draws the order within the blocks.
        on_pass: called after each pass, never while a clock runs.
    """

    robot: Robot
    friction: float
    settings: TimingSettings
    rng: np.random.Generator
    on_pass: Callable[[], None] = lambda: None

    def repeat(
        self,
        start: Callable[[int], Mapping[str, Any]],
        lengths: Sequence[int],
        *,
        block: int,
        end: Callable[[int, int], None] = lambda repetition, sequence: None,
    ) -> tuple[dict[str, list[Laps]], float]:
        """All repetitions of all sequences.

        Args:
            start: gives what is timed, by name, ready to begin the sequence of a number; its times are its ``laps``.
            lengths: of the sequences.
            block: pieces per block.
            end: called after each sequence with the numbers of repetition and sequence.

        Returns:
            The times that count by name, an array for each repetition, and the timer's own time, ns.
        """
        laps: dict[str, list[Laps]] = {}
        overheads = []
        settings = replace(self.settings, block=block)
        for repetition in range(settings.repetitions):
            parts: dict[str, list[Laps]] = {}
            for k, length in enumerate(lengths):
                timed = start(k)
                overheads.append(interleave(list(timed.values()), length, block=block, rng=self.rng))
                for name, timer in timed.items():
                    parts.setdefault(name, []).append(timer.laps[counted(len(timer.laps), settings)])
                end(repetition, k)
            for name, found in parts.items():
                laps.setdefault(name, []).append(np.concatenate(found))
            self.on_pass()
        return laps, float(np.median(overheads))


class Timed(Protocol):
    """Something that is timed, ready to begin."""

    def time_block(self, begin: int, end: int) -> None:
        """Time the pieces from ``begin`` to before ``end``."""
        ...


def interleave(timed: Sequence[Timed], length: int, *, block: int, rng: np.random.Generator) -> float:
    """One pass of every candidate over a sequence.

    All are started, and keep their times.

    Returns:
        The timer's own time, ns.
    """
    with without_gc():
        overhead = timer_overhead()
        for begin in range(0, length, block):
            for k in rng.permutation(len(timed)):
                timed[int(k)].time_block(begin, begin + block)
    return overhead


def counted(length: int, settings: TimingSettings) -> NDArray[np.bool_]:
    """Which pieces of a pass count: neither the warm-up nor the first of each block."""
    piece = np.arange(length)
    return (piece >= settings.warm_up) & (piece % settings.block >= settings.settle)
