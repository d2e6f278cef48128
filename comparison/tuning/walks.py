"""Walks that train and walks that judge, and what counts: falls first, then slip, then tracking.

They are of the wide campaign's distribution, from seeds of their own.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import log1p

import numpy as np

from comparison.campaign.plan import Task, plan
from comparison.campaign.settings import JOINT_DAMPING, CampaignSettings
from comparison.campaign.walks import scenario
from comparison.measure.walking import walk_as_far_as_it_goes
from harpy_pin import Scenario, measure
from harpy_pin.scenario import Compliant, ControllerPart

TRAINING_SEED, JUDGING_SEED = 61211, 86028
"""Seeds of the walks; the wide campaign has another one, 40427."""

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
        return FALL if self.fell else log1p(min(self.slip, MAX_SLIP)) + min(self.tracking, MAX_SLIP) / 1000.0


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


def training_tasks(count: int, duration: float, joint_damping: float = JOINT_DAMPING) -> list[Task]:
    """Walks to search on, all in the library's own engine; MuJoCo is kept for judging."""
    return [replace(task, plant=Compliant.name) for task in _tasks(count, duration, joint_damping, TRAINING_SEED)]


def judging_tasks(count: int, duration: float, joint_damping: float = JOINT_DAMPING) -> list[Task]:
    """Walks that judge what the search found, in both engines."""
    return _tasks(count, duration, joint_damping, JUDGING_SEED)


def _tasks(count: int, duration: float, joint_damping: float, seed: int) -> list[Task]:
    alone = {"contenders": ("governed/none",), "joint_dampings": (joint_damping,)}
    return plan(CampaignSettings.wide(walks=count, duration=duration, seed=seed, **alone))


def scenario_with(task: Task, controller: ControllerPart) -> Scenario:
    """The scenario of a task, walked by another controller with the task's error of friction."""
    drawn = scenario(task)
    return replace(drawn, controller=replace(controller, mu=drawn.mu))
