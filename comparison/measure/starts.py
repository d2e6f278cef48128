"""Studies whose walks have several starts, which differ in the velocity that they begin with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harpy_pin import checks

__all__ = ["StartsSettings", "start_velocity"]


@dataclass(frozen=True, kw_only=True)
class StartsSettings:
    """Settings of such a study.

    Attributes:
        starts: how many starts each walk has.
        jitter: standard deviation of the starting velocity along x and y, m/s.
        duration: of a walk, s.
        seed: of the starts.
    """

    starts: int = 1
    jitter: float = 0.02
    duration: float = 6.0
    seed: int = 0

    def __post_init__(self) -> None:
        checks.whole("starts", self.starts, low=1)
        checks.number("jitter", self.jitter, low=0.0)
        checks.number("duration", self.duration, low=0.1)
        checks.whole("seed", self.seed)


def start_velocity(jitter: float, seed: int, start: int) -> tuple[float, ...]:
    """Velocity of the body with which a walk begins."""
    x, y = jitter * np.random.default_rng([seed, start]).standard_normal(2)
    return (float(x), float(y), 0.0, 0.0, 0.0, 0.0)
