"""The search for the gains of the joint PD controller: ``python -m comparison.joint_pd go2`` writes
them for a robot.

Every robot has gains of its own, found on walks apart from those that judge: the same kinds, drawn
from another seed. The search begins with those found before, and the better ones stay. The
whole-body controllers have one set of settings for all robots, and none was searched.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from math import inf, log1p

import numpy as np

from comparison.contenders import Point, Range, Variant
from comparison.joint_pd.controller import GAINS_FILE, JointPDGains, found_gains
from comparison.studies.walking import PD_ROBOTS, job_of, walked
from comparison.tuning.tune import propose

SPACE = {
    **{"stance_p": Range(0.1, 10.0), "stance_d": Range(0.07, 10.0)},
    **{"swing_p": Range(0.1, 10.0), "swing_d": Range(0.07, 10.0), "follow": Range(0.1, 2.0)},
}
"""Gains as multiples of the default ones."""
BUDGET = 60
"""Gains that are tried for a robot."""
SEED = 1
"""Of the walks of the search, and of what is tried."""
KINDS = ("random", "pushed", "random, noise and delay")
WALKS = (*zip(KINDS, (0, 2, 1), strict=True), *zip(KINDS, (2, 5, 3), strict=True))
"""Of the search, by kind and number."""
KEPT_WALKS = tuple((what, number) for what in KINDS for number in range(12))
KEPT_SEED = 2000
"""Of walks that the search does not see: what it found is kept if it costs less there than what was
found before.
"""
DURATION = 5.0
"""Of each, s."""
FALL = 1000.0
"""Cost of a fall at the start; at the end it is half of that."""


def search_gains(
    cost: Callable[[JointPDGains, float], float],
    seed: int = SEED,
    *,
    start: JointPDGains | None = None,
) -> tuple[JointPDGains, float]:
    """The best gains within the budget, and their cost."""
    default = asdict(JointPDGains())
    best = {name: getattr(start or JointPDGains(), name) / default[name] for name in SPACE}
    variant, rng, least = Variant("joint PD", {}, SPACE), np.random.default_rng(seed), np.inf
    for index in range(BUDGET):
        point = best if index == 0 else propose(variant, index, BUDGET, best, rng)
        found = cost(_gains(point), least)
        if found < least:
            best, least = dict(point), found
    return _gains(best), least


def _gains(point: Point) -> JointPDGains:
    """The gains of a point of the space."""
    return JointPDGains(
        **{name: factor * getattr(JointPDGains(), name) for name, factor in point.items()}
    )


def cost(
    robot: str,
    gains: JointPDGains,
    most: float = inf,
    *,
    walks: tuple[tuple[str, int], ...] = WALKS,
    seed: int = SEED,
) -> float:
    """What gains cost: falls first, the earlier the more; then the logarithm of slip."""
    total = 0.0
    for what, number in walks:
        row = walked(
            job_of(robot, what, DURATION, seed, controller="joint_pd", number=number), gains
        )
        total += (
            FALL * (1.0 - 0.5 * row["stood_s"] / DURATION)
            if row["fell"]
            else log1p(row["slip_mm_per_step"])
        )
        if total > most:
            break
    return total


def main(robots: list[str]) -> None:
    """Search, and write what was found after every robot."""
    for robot in robots or PD_ROBOTS:
        before = found_gains().get(robot)
        start = None if before is None else JointPDGains(**before["gains"])
        best, least = search_gains(partial(cost, robot), start=start)
        check = partial(cost, robot, walks=KEPT_WALKS, seed=KEPT_SEED)
        if start is not None and check(start) <= check(best):
            best, least = start, cost(robot, start)
        document = json.loads(GAINS_FILE.read_text(encoding="utf-8")) if GAINS_FILE.exists() else {}
        document[robot] = {"gains": asdict(best), "cost": least}
        GAINS_FILE.write_text(
            json.dumps(dict(sorted(document.items())), indent=1) + "\n", encoding="utf-8"
        )
        print(robot, f"cost {least:.2f}", best, flush=True)
    found_gains.cache_clear()


if __name__ == "__main__":
    main(sys.argv[1:])
