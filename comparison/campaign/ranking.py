"""Who is ahead of whom in a campaign, where that is more than chance or the resolution of the measure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binomtest, quantile_test

from harpy_pin.model.state import Vector

__all__ = [
    "RESOLUTION_MM",
    "RESOLUTION_SHARE",
    "falls_less",
    "ranked_engines",
    "slip_interval",
    "slip_median",
    "slips_less",
]

RESOLUTION_MM, RESOLUTION_SHARE = 0.02, 0.1
"""What slip per step must differ by, mm and as a share of the larger, to be a difference (docs/simulation.md)."""

SIGNIFICANCE = 0.05


def slip_median(part: pd.DataFrame, measure: str = "slip_mm_per_step") -> float:
    """Median slip per step, mm, where a fall counts as more slip than any; infinite if half of the walks fell."""
    slip = _slips(part, measure)
    return float(np.median(slip)) if len(slip) else float("nan")


def slip_interval(part: pd.DataFrame) -> list[float | str] | None:
    """The 95 % interval of :func:`slip_median` that order statistics give, mm; ``fell`` is an end that is a fall.

    There is none for fewer than six walks.
    """
    slip = _slips(part, "slip_mm_per_step")
    if len(slip) == 0:
        return None
    ends = quantile_test(slip, p=0.5).confidence_interval(0.95)
    if np.isnan(ends.low) or np.isnan(ends.high):
        return None
    return ["fell" if np.isinf(end) else float(end) for end in (ends.low, ends.high)]


def _slips(part: pd.DataFrame, measure: str) -> Vector:
    """Slip of every walk; infinite where it fell."""
    slip: Vector = part[measure].astype(float).where(~part.fell.astype(bool), np.inf).dropna().to_numpy(dtype=float)
    return slip


def slips_less(a: float, b: float) -> bool:
    """Whether slip ``a`` is less than ``b`` by more than the measure can tell apart, both in mm per step."""
    if not np.isfinite(a):
        return False
    return bool(np.isinf(b)) or b - a > max(RESOLUTION_MM, RESOLUTION_SHARE * b)


def falls_less(a: pd.DataFrame, b: pd.DataFrame) -> bool:
    """Whether ``a`` fell in fewer of the scenarios that both walked, by the exact sign test (McNemar's) at 5 %."""
    pairs = a.set_index("seed").fell.to_frame("a").join(b.set_index("seed").fell.rename("b"), how="inner")
    pairs = pairs.astype(bool)
    only_a, only_b = int((pairs.a & ~pairs.b).sum()), int((pairs.b & ~pairs.a).sum())
    if only_a >= only_b:
        return False
    return bool(binomtest(only_a, only_a + only_b).pvalue < SIGNIFICANCE)


def ranked_engines(frame: pd.DataFrame, names: Sequence[str]) -> dict[str, dict[str, dict[str, Any]]]:
    """Falls and slip of every contender in every engine, with ranks.

    A rank is one more than the number of contenders that are ahead: those that nothing sets apart share it.

    Returns:
        By engine and contender: ``walks``, ``fell``, ``falls_rank``, ``slip_median_mm`` (None where half or
        more fell) and ``slip_rank``; ranks are None where nothing was walked.
    """
    engines: dict[str, dict[str, dict[str, Any]]] = {}
    for plant in sorted(frame.plant.unique()):
        parts = {name: frame[(frame.plant == plant) & (frame.contender == name)] for name in names}
        slips = {name: slip_median(part) for name, part in parts.items()}
        engines[plant] = {
            name: {
                "walks": len(part),
                "fell": int(part.fell.sum()),
                "falls_rank": 1 + sum(falls_less(other, part) for other in parts.values()) if len(part) else None,
                "slip_median_mm": slips[name] if np.isfinite(slips[name]) else None,
                "slip_rank": 1 + sum(slips_less(other, slips[name]) for other in slips.values()) if len(part) else None,
            }
            for name, part in parts.items()
        }
    return engines
