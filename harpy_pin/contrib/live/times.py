"""Times of many ticks in bounded memory, and how a walk keeps up with the clock."""

import math

import numpy as np

BIN, BINS = 100, 50_000
"""Width of a bin, ns, and how many there are: up to 5 ms."""


class TickTimes:
    """A histogram of tick times: percentiles are exact to 0.1 µs, whatever the number of ticks.

    Attributes:
        count: of ticks.
        longest: ns.
    """

    def __init__(self) -> None:
        self._bins = np.zeros(BINS + 1, dtype=np.int64)
        self.count = self.longest = 0

    def add(self, elapsed: int) -> None:
        """Count one tick of a time, ns."""
        self._bins[min(elapsed // BIN, BINS)] += 1
        self.count += 1
        self.longest = max(self.longest, elapsed)

    def percentile(self, percent: float) -> float:
        """Time that a share of the ticks did not exceed, µs: the middle of its bin; NaN without
        ticks.
        """
        if not self.count:
            return math.nan
        number = int(np.searchsorted(np.cumsum(self._bins), max(percent / 100.0 * self.count, 1.0)))
        return self.longest * 1e-3 if number == BINS else (number + 0.5) * BIN * 1e-3


class RealTimePacer:
    """How many ticks are due by the clock.

    Where ticks take longer than they may, at most ``most_late`` is made up for; the rest is lost,
    and the walk runs slower than it should.

    Args:
        period: of a tick, s of simulated time.
        most_late: s of the clock.

    Attributes:
        factor: simulated time per time that it should have taken, over the last second: 1 where the
            walk keeps up.
        lost: time of the clock that was not made up for, s.
    """

    def __init__(self, period: float, *, most_late: float = 0.1) -> None:
        self.period, self.most_late = period, most_late
        self.factor, self.lost = 1.0, 0.0
        self._due: float | None = None  # when the next tick is

    def restart(self) -> None:
        """What happened until now took no time: the next call begins anew."""
        self._due = None

    def is_due(self, now: float, pace: float) -> bool:
        """Whether a tick is due now (s), at a pace (simulated time per time of the clock); if so it
        is counted.
        """
        if self._due is None:
            self._due = self._window = now
            self._done = 0
        late = now - self._due
        if late < 0.0:
            return False
        if late > self.most_late:
            self.lost += late - self.most_late
            self._due = now - self.most_late
        self._due += self.period / pace
        self._done += 1
        span = now - self._window
        if span >= 1.0:
            self.factor = min(self._done * self.period / (pace * span), 1.0)
            self._window, self._done = now, 0
        return True

    def until_due(self, now: float) -> float:
        """Time until the next tick, s."""
        return 0.0 if self._due is None else max(self._due - now, 0.0)
