"""What each controller achieved in closed loop."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from comparison.measure.controllers import CONTENDERS
from comparison.measure.states import draw_push, walk
from harpy_pin.log.measures import measure
from harpy_pin.log.run import Run

__all__ = ["SPREAD", "achieved", "pushed", "walk_all"]

SPREAD = ("distance_m", "slip_mm_per_step", "late_slip_mm_per_step", "sliding", "low_force", "no_contact")
"""Measures whose spread over pushed walks is reported."""


def walk_all(*, friction: float, duration: float, on_walk: Callable[[], None] = lambda: None) -> dict[str, Run]:
    """One undisturbed walk of each contender.

    The controllers know the ground's friction; the duration is in s.
    """
    runs: dict[str, Run] = {}
    for name in CONTENDERS:
        runs[name] = walk(name, friction=friction, duration=duration)
        on_walk()
    return runs


def achieved(runs: Mapping[str, Run]) -> dict[str, dict[str, Any]]:
    """Measures of each contender's walk (see :class:`harpy_pin.Measures` for names and units)."""
    return {name: dict(measure(run).as_dict()) for name, run in runs.items()}


def pushed(
    *, friction: float, duration: float, speed: float, seeds: Sequence[int], on_walk: Callable[[], None] = lambda: None
) -> dict[str, dict[str, Any]]:
    """Walks that start with a push in a random direction, the same for every contender.

    The controllers know the ground's friction; the duration is in s, the push's speed in m/s. There is a walk of each
    contender per seed.

    Returns:
        For each contender the number of walks and falls, and median, least and largest value of the measures
        :data:`SPREAD` over the walks.
    """
    result: dict[str, dict[str, Any]] = {}
    for name in CONTENDERS:
        rows = []
        for seed in seeds:
            push = draw_push(np.random.default_rng(seed), speed)
            rows.append(measure(walk(name, friction=friction, duration=duration, push=push)))
            on_walk()
        result[name] = {"walks": len(rows), "falls": sum(row.fell for row in rows)}
        for key in SPREAD:
            values = [float(getattr(row, key)) for row in rows]
            result[name][key] = {"median": float(np.median(values)), "min": min(values), "max": max(values)}
    return result
