"""The metrics: what is said about a set of times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Laps", "ratio_of_medians", "summarise", "summarise_repetitions"]

Laps = NDArray[np.int64]
"""Times in nanoseconds."""


def summarise(laps: Sequence[Laps], overhead_ns: float = 0.0) -> dict[str, float | int]:
    """Percentiles over all repetitions, µs.

    Laps have an array of times for each repetition, ns. The timer's overhead is subtracted from every time, which never
    gets negative.
    """
    times = np.maximum(np.concatenate(laps) - overhead_ns, 0.0) * 1e-3
    p50, p95, p99, p999 = np.percentile(times, (50.0, 95.0, 99.0, 99.9))
    return {
        "p50_us": float(p50),
        "p95_us": float(p95),
        "p99_us": float(p99),
        "p99_9_us": float(p999),
        "max_us": float(times.max()),
        "mean_us": float(times.mean()),
        "samples": len(times),
    }


def summarise_repetitions(laps: Sequence[Laps], overhead_ns: float = 0.0) -> dict[str, float | int]:
    """The summary of :func:`summarise`, with the least and largest median of a repetition, µs."""
    medians = [max(float(np.median(part)) - overhead_ns, 0.0) * 1e-3 for part in laps]
    return {**summarise(laps, overhead_ns), "low_us": min(medians), "high_us": max(medians)}


def ratio_of_medians(slow: Sequence[Laps], fast: Sequence[Laps], overhead_ns: float = 0.0) -> dict[str, Any]:
    """Ratio of two medians within each repetition, and the median of these ratios.

    Within a repetition the machine's speed is nearly the same for both; a ratio of medians over all repetitions
    (``pooled``) compares times of different speeds where a machine changes it.

    Both have an array of times for each repetition, ns, taken side by side; the timer's overhead is subtracted from
    every time.
    """

    def median(times: Laps) -> float:
        return max(float(np.median(times)) - overhead_ns, 1.0)

    each = [median(a) / median(b) for a, b in zip(slow, fast, strict=True)]
    whole = median(np.concatenate(slow)) / median(np.concatenate(fast))
    return {"p50": float(np.median(each)), "min": min(each), "max": max(each), "pooled": whole, "repetitions": each}
