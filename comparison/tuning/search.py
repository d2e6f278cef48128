"""Proposals of a search: the published settings, random ones, then changes of the best so far in smaller steps.

The second one may be a start that is known to be good.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from comparison.tuning.variants import Point, Range, Variant

__all__ = ["RANDOM_SHARE", "propose"]

RANDOM_SHARE = 0.3
"""Share of the budget that is drawn from the whole space."""
FIRST_STEP, LAST_STEP = 0.3, 0.05
"""Standard deviation of a change at the beginning and at the end, as a share of the range's logarithm."""
CHANGED = 0.3
"""Probability with which a change of the best touches a setting."""


def propose(
    variant: Variant, index: int, budget: int, best: Point, rng: np.random.Generator, start: Point | None = None
) -> Point:
    """Settings number ``index`` of a search.

    Args:
        variant: whose settings.
        index: from 0.
        budget: how many there will be.
        best: of all before.
        rng: of this proposal.
        start: settings to try second, of any of the variant's paths; the others are at their published values.
    """
    if index == 0:
        return variant.published
    if index == 1 and start is not None:
        return {**variant.published, **start}
    if index <= RANDOM_SHARE * budget:
        return {path: _random(span, rng) for path, span in variant.space.items()}
    progress = (index - RANDOM_SHARE * budget) / max((1.0 - RANDOM_SHARE) * budget, 1.0)
    step = FIRST_STEP * (LAST_STEP / FIRST_STEP) ** progress
    paths = list(variant.space)
    touched = [path for path in paths if rng.random() < CHANGED] or [paths[int(rng.integers(len(paths)))]]
    return {**best, **{path: _changed(variant.space[path], best[path], step, rng) for path in touched}}


def _random(span: Any, rng: np.random.Generator) -> Any:
    if isinstance(span, Range):
        return float(np.exp(rng.uniform(np.log(span.low), np.log(span.high))))
    return span.values[int(rng.integers(len(span.values)))]


def _changed(span: Any, value: Any, step: float, rng: np.random.Generator) -> Any:
    if not isinstance(span, Range):
        return _random(span, rng)
    moved = value * np.exp(step * np.log(span.high / span.low) * rng.standard_normal())
    return float(np.clip(moved, span.low, span.high))
