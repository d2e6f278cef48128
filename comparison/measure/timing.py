"""How everything is timed, on which machine, and what is said about times: candidates take turns,
block by block.

The order is drawn anew for each block, so a drift of the machine's speed affects all candidates
alike, and none always runs after the same other one.
"""

import gc
import os
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from time import perf_counter_ns
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.log.run import describe_versions
from harpy_pin.model.robot import Robot

Laps = NDArray[np.int64]
"""Times in nanoseconds."""


@dataclass(frozen=True, kw_only=True)
class TimingSettings(checks.Checked):
    """How to time."""

    repetitions: int = checks.setting(10, checks.whole, low=1)  # of every pass
    # ticks at the start of each sequence that are replayed but not counted: the solver's cold start
    # and cold caches are
    # among them
    warm_up: int = checks.setting(50, checks.whole, low=1)
    block: int = 500  # ticks per block
    # ticks at the start of each block that are not counted: the replays before have used the caches
    settle: int = 10
    programs: int = 2000  # quadratic programs per sequence for the isolated solvers
    samples: int = 100  # solutions per sequence checked for optimality


class Timed(Protocol):
    """Something that is timed and ready to begin; it keeps its times."""

    def time_block(self, begin: int, end: int) -> None:
        """Time the pieces from ``begin`` to before ``end``."""
        ...


@dataclass(frozen=True, kw_only=True)
class Bench:
    """What every timing needs."""

    robot: Robot  # that walked
    friction: float  # coefficient that every controller assumes
    settings: TimingSettings  # how to time
    rng: np.random.Generator  # draws the order within the blocks
    on_pass: Callable[[], None] = lambda: None  # called after each pass, never while a clock runs

    def repeat(
        self,
        start: Callable[[int], Mapping[str, Any]],
        lengths: Sequence[int],
        *,
        block: int,
        end: Callable[[int, int], None] = lambda repetition, sequence: None,
    ) -> tuple[dict[str, list[Laps]], float]:
        """Time all repetitions of all sequences.

        ``start`` gives what is timed, by name, ready to begin the sequence of a number; ``end`` is
        called after each sequence with the numbers of repetition and sequence.

        Returns:
            The times that count by name, an array for each repetition, and the timer's own time,
            ns.
        """
        laps: dict[str, list[Laps]] = {}
        overheads = []
        settings = replace(self.settings, block=block)
        for repetition in range(settings.repetitions):
            parts: dict[str, list[Laps]] = {}
            for k, length in enumerate(lengths):
                timed = start(k)
                overheads.append(
                    interleave(list(timed.values()), length, block=block, rng=self.rng)
                )
                for name, timer in timed.items():
                    parts.setdefault(name, []).append(
                        timer.laps[counted(len(timer.laps), settings)]
                    )
                end(repetition, k)
            for name, found in parts.items():
                laps.setdefault(name, []).append(np.concatenate(found))
            self.on_pass()
        return laps, float(np.median(overheads))


def interleave(
    timed: Sequence[Timed], length: int, *, block: int, rng: np.random.Generator
) -> float:
    """Do one pass of every candidate over a sequence; returns the timer's own time, ns."""
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


@contextmanager
def without_gc() -> Iterator[None]:
    """Collect garbage now, and not again until the end."""
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def timer_overhead() -> float:
    """Median difference of two readings of the clock with nothing between them, ns."""
    laps, clock = np.zeros(20_000, dtype=np.int64), perf_counter_ns
    for i in range(len(laps)):
        begin = clock()
        laps[i] = clock() - begin
    return float(np.median(laps))


def summarise(laps: Sequence[Laps], overhead_ns: float = 0.0) -> dict[str, float | int]:
    """Percentiles over all repetitions, µs.

    There is an array of times for each repetition, ns. The timer's overhead is subtracted from
    every time, which never gets negative.
    """
    times = np.maximum(np.concatenate(laps) - overhead_ns, 0.0) * 1e-3
    names = ("p50_us", "p95_us", "p99_us", "p99_9_us")
    found = dict(zip(names, np.percentile(times, (50.0, 95.0, 99.0, 99.9)).tolist(), strict=True))
    return {
        **found,
        "max_us": float(times.max()),
        "mean_us": float(times.mean()),
        "samples": len(times),
    }


def summarise_repetitions(laps: Sequence[Laps], overhead_ns: float = 0.0) -> dict[str, float | int]:
    """The summary of :func:`summarise`, with the least and largest median of a repetition, µs."""
    medians = [max(float(np.median(part)) - overhead_ns, 0.0) * 1e-3 for part in laps]
    return {**summarise(laps, overhead_ns), "low_us": min(medians), "high_us": max(medians)}


def describe_machine() -> dict[str, Any]:
    """Processor, cores, operating system, and how busy the machine is already."""
    affinity, file = getattr(os, "sched_getaffinity", None), Path("/proc/cpuinfo")
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines() if file.exists() else []
    models = [
        line.partition(":")[2].strip() for line in lines if line.lower().startswith("model name")
    ]
    return {
        "cpu": models[0] if models else platform.processor() or "unknown",
        "cores": os.cpu_count(),
        "usable_cores": len(affinity(0)) if affinity is not None else os.cpu_count(),
        "os": f"{platform.system()} {platform.release()}",
        "architecture": platform.machine(),
        "load_1min": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }


def describe_all_versions() -> dict[str, str]:
    """Versions of everything that decides a number here."""
    versions = describe_versions()
    for name in ("scipy", "daqp"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions
