"""The measures of runs beside each other, and which run is best at each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harpy_pin.log.measures import Measures, measure
from harpy_pin.log.optional import tick_times
from harpy_pin.log.run import Run

__all__ = ["Score", "scoreboard"]


@dataclass(frozen=True)
class Score:
    """One measure of all runs.

    Attributes:
        label: with its unit.
        values: of each run, as text.
        best: numbers of the runs that are best at it; none where all are alike, or no run walked to its end.
    """

    label: str
    values: tuple[str, ...]
    best: tuple[int, ...]


_ROWS = (
    ("slip, mm per step", "slip_mm_per_step", "{:.1f}"),
    ("contact time sliding, %", "sliding", "{:.1%}"),
    ("distance from the target, mm rms", "tracking_rms_mm", "{:.1f}"),
    ("thrust, N rms", "thrust_rms_n", "{:.1f}"),
    ("thrusters at 1 kW for 18 N, W", "thrust_power_w", "{:.0f}"),
    ("joints, W", "joint_power_w", "{:.0f}"),
    ("largest torque, N·m", "torque_max_nm", "{:.1f}"),
    ("largest tilt, rad", "tilt_max_rad", "{:.2f}"),
)


def scoreboard(runs: Sequence[Run]) -> list[Score]:
    """Measures of runs; less is better in all of them, and a run that fell or stumbled is best at none.

    Args:
        runs: finite rows, at least two of each.
    """
    measures = [measure(run) for run in runs]
    walked = [not (m.fell or m.stumbled) and m.ending == "completed" for m in measures]
    endings = tuple(_ending(m) for m in measures)
    scores = [Score("ending", endings, tuple(k for k, on in enumerate(walked) if on) if not all(walked) else ())]
    for label, name, form in _ROWS:
        values = [float(getattr(m, name)) for m in measures]
        if not any(np.isfinite(values)):
            continue
        texts = tuple(form.format(value).rstrip("%") if np.isfinite(value) else "–" for value in values)
        scores.append(Score(label, texts, _best(values, texts, walked)))
    ticks = [_tick(run) for run in runs]
    if any(np.isfinite(ticks)):
        texts = tuple(f"{tick:.0f}" if np.isfinite(tick) else "–" for tick in ticks)
        scores.append(Score("tick, µs median", texts, _best(ticks, texts, walked)))
    return scores


def _best(values: Sequence[float], texts: Sequence[str], walked: Sequence[bool]) -> tuple[int, ...]:
    """Runs with the smallest value, as it is printed; none where all are alike."""
    able = [k for k, on in enumerate(walked) if on and np.isfinite(values[k])]
    if not able or len(set(texts)) == 1:
        return ()
    least = texts[min(able, key=lambda k: values[k])]
    return tuple(k for k in able if texts[k] == least)


def _ending(measures: Measures) -> str:
    """How a run ended, and when if it was early."""
    if measures.ending == "completed":
        return "stumbled" if measures.stumbled else "walked to the end"
    return f"{measures.ending} at {measures.duration_s:.2f} s"


def _tick(run: Run) -> float:
    """Median time of a tick, µs; NaN where it was not logged."""
    times = tick_times(run)
    return float("nan") if times is None else float(np.median(times))
