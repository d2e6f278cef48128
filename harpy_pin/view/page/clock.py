"""Signals of many rows as few points: the extremes of equal spans of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from harpy_pin.model.state import Vector

__all__ = ["Clock"]

MAX_SPANS = 1500
"""Most spans of a page: two points each, more than a screen has columns."""


@dataclass(frozen=True)
class Clock:
    """Equal spans of time from 0 on.

    Attributes:
        width: of a span, s.
        count: of spans.
        period: the longest time between two rows of any run, s: no span misses a row of it.
    """

    width: float
    count: int
    period: float

    @classmethod
    def of(cls, times: Sequence[Vector], *, most: int = MAX_SPANS) -> Clock:
        """The clock of runs, from the evenly spaced times of their rows, s, with so many spans at most."""
        period = max((float(t[-1]) / (len(t) - 1) for t in times if len(t) > 1), default=1.0)
        rows = round(max(float(t[-1]) for t in times) / period) + 1
        share = -(-rows // most)
        return cls(width=share * period, count=-(-rows // share), period=period)

    @property
    def points(self) -> Vector:
        """(2 count,) times of the points of thinned signals, s."""
        begin = self.width * np.arange(self.count)
        return np.stack((begin, begin + 0.5 * self.width), axis=1).ravel()

    def thin(self, time: Vector, signal: Vector) -> Vector:
        """(2 count,) smallest and largest value of each span, as they come; NaN where it has none."""
        span = np.minimum(((time + 0.5 * self.period) / self.width).astype(np.intp), self.count - 1)
        known = np.isfinite(signal)
        rows, span, signal = np.flatnonzero(known), span[known], signal[known]
        result = np.full((self.count, 2), np.nan)
        if len(rows) == 0:
            return result.ravel()
        # Sorted by value within each span: its first and its last row are the extremes.
        order = np.lexsort((signal, span))
        first = np.flatnonzero(np.diff(span[order], prepend=-1))
        last = np.append(first[1:], len(order)) - 1
        low, high = order[first], order[last]
        early, late = np.minimum(low, high), np.maximum(low, high)
        result[span[early], 0], result[span[early], 1] = signal[early], signal[late]
        return result.ravel()
