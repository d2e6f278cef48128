"""The search for the gains of the joint PD controller: ``python -m comparison.joint_pd go2`` writes them for a robot.

Every robot has gains of its own, found on walks apart from those that judge: the same kinds, drawn from another seed.
The whole-body controllers have one set of settings for all robots, and none was searched.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from comparison.joint_pd.controller import JointPDGains

__all__ = ["BUDGET", "GAINS_FILE", "SEED", "SPACE", "found_gains", "search_gains"]

GAINS_FILE = Path(__file__).with_name("gains.json")
"""What the command wrote: gains by robot, and what they came to."""
SPACE = {
    "stance_p": (0.2, 20.0),
    "stance_d": (0.02, 3.0),
    "swing_p": (0.2, 20.0),
    "swing_d": (0.02, 3.0),
    "follow": (0.05, 1.0),
}
"""Ranges of the gains, searched in the logarithm."""
BUDGET = 60
"""Gains that are tried for a robot."""
DRAWN = 20
"""Of them, drawn from the whole space; the others change the best so far."""
FIRST_STEP, LAST_STEP = 0.25, 0.03
"""Standard deviation of a change at the beginning and at the end, as a share of the range's logarithm."""
SEED = 1
"""Of the walks of the search, and of what is tried."""


def search_gains(
    cost: Callable[[JointPDGains, float], float], seed: int = SEED, *, start: JointPDGains | None = None
) -> tuple[JointPDGains, float]:
    """The best gains within the budget, and their cost.

    Args:
        cost: of gains; it may stop where it exceeds the given one.
        seed: of what is tried.
        start: what is tried first; by default the default gains.
    """
    rng = np.random.default_rng(seed)
    best = JointPDGains() if start is None else start
    least = cost(best, np.inf)
    for index in range(1, BUDGET):
        gains = _changed(best, index, rng)
        found = cost(gains, least)
        if found < least:
            best, least = gains, found
    return best, least


def _changed(best: JointPDGains, index: int, rng: np.random.Generator) -> JointPDGains:
    """Gains number ``index`` of a search."""
    values: dict[str, float] = asdict(best)
    progress = max(index - DRAWN, 0) / (BUDGET - DRAWN)
    step = FIRST_STEP * (LAST_STEP / FIRST_STEP) ** progress
    touched = [field.name for field in fields(best) if rng.random() < 0.5] or [str(rng.choice(list(SPACE)))]
    for name in SPACE if index <= DRAWN else touched:
        low, high = np.log(SPACE[name])
        at = rng.uniform(low, high) if index <= DRAWN else np.log(values[name]) + step * (high - low) * rng.normal()
        values[name] = float(np.exp(np.clip(at, low, high)))
    return JointPDGains(**values)


@cache
def found_gains() -> dict[str, Any]:
    """The file's document: what was found, by robot."""
    if not GAINS_FILE.exists():
        return {}
    document: dict[str, Any] = json.loads(GAINS_FILE.read_text(encoding="utf-8"))
    return document
