"""What the search makes small: falls first, then slip, then tracking."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import log1p

import numpy as np

from comparison.measure.walking import walk_as_far_as_it_goes
from harpy_pin import Scenario, measure

__all__ = ["FALL", "Outcome", "Score", "walk_scenario"]

FALL = 1000.0
"""Cost of a fall: more than the slip of all walks of a search together, so that falls come first."""

MAX_SLIP = 1000.0
"""Slip per step beyond which more of it counts no more, mm."""


@dataclass(frozen=True)
class Outcome:
    """What came of one walk.

    Attributes:
        fell: whether the robot fell, or its controller failed.
        slip: per step, mm.
        tracking: rms distance of the body from its target, mm.
    """

    fell: bool
    slip: float
    tracking: float

    @property
    def cost(self) -> float:
        """1000 for a fall; otherwise log(1 + slip / 1 mm) + tracking / 1 m.

        The logarithm lets a walk count by the factor of its slip, so that no single bad walk decides, and a decimetre
        of tracking error counts as a tenth more slip.
        """
        if self.fell:
            return FALL
        return log1p(min(self.slip, MAX_SLIP)) + min(self.tracking, MAX_SLIP) / 1000.0


@dataclass(frozen=True)
class Score:
    """What came of several walks.

    Attributes:
        walks: how many.
        falls: how many of them fell.
        slip_median: per step, mm, where a fall counts as more than any; None if half or more fell.
        tracking_median: of the walks that did not fall, mm; None if all fell.
        cost: sum over all walks.
    """

    walks: int
    falls: int
    slip_median: float | None
    tracking_median: float | None
    cost: float

    @classmethod
    def of(cls, outcomes: Iterable[Outcome]) -> Score:
        """The score of walks."""
        found = list(outcomes)
        slip = float(np.median([np.inf if one.fell else one.slip for one in found]))
        tracking = [one.tracking for one in found if not one.fell]
        return cls(
            walks=len(found),
            falls=sum(one.fell for one in found),
            slip_median=slip if np.isfinite(slip) else None,
            tracking_median=float(np.median(tracking)) if tracking else None,
            cost=float(sum(one.cost for one in found)),
        )


def walk_scenario(scenario: Scenario) -> Outcome:
    """Walk, and measure."""
    run = walk_as_far_as_it_goes(scenario)
    measures = measure(run)
    return Outcome(run.ending != "completed", measures.slip_mm_per_step, measures.tracking_rms_mm)
