"""The search for the gains of the joint PD controller: ``python -m comparison.joint_pd go2`` writes them for a robot.

Every robot has gains of its own, found on walks apart from those that judge: the same kinds, drawn from another seed.
The search begins with those found before, and the better ones stay. The whole-body controllers have one set of settings
for all robots, and none was searched.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import asdict, fields
from functools import partial
from math import inf, log1p

import numpy as np

from comparison.joint_pd.controller import GAINS_FILE, JointPDGains, found_gains
from comparison.studies.walking import PD_ROBOTS, job_of, walked

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
WALKS = (
    ("random", 0),
    ("pushed", 2),
    ("random, noise and delay", 1),
    ("random", 2),
    ("pushed", 5),
    ("random, noise and delay", 3),
)
"""Of the search, by kind and number."""
KEPT_WALKS = tuple((what, number) for what in ("random", "pushed", "random, noise and delay") for number in range(12))
KEPT_SEED = 2000
"""Of walks that the search does not see: what it found is kept if it costs less there than what was found before."""
DURATION = 5.0
"""Of each, s."""
FALL = 1000.0
"""Cost of a fall at the start; at the end it is half of that."""


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


def cost(
    robot: str, gains: JointPDGains, most: float = inf, *, walks: tuple[tuple[str, int], ...] = WALKS, seed: int = SEED
) -> float:
    """What gains cost: falls first, the earlier the more; then the logarithm of slip.

    Args:
        robot: its name.
        gains: to be tried.
        most: cost at which no more is walked.
        walks: by kind and number.
        seed: of the walks.
    """
    total = 0.0
    for what, number in walks:
        job = job_of(robot, what, DURATION, seed, controller="joint_pd", number=number)
        row = walked(job, gains)
        total += FALL * (1.0 - 0.5 * row["stood_s"] / DURATION) if row["fell"] else log1p(row["slip_mm_per_step"])
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
        GAINS_FILE.write_text(json.dumps(dict(sorted(document.items())), indent=1) + "\n", encoding="utf-8")
        print(robot, f"cost {least:.2f}", best, flush=True)
    found_gains.cache_clear()


if __name__ == "__main__":
    main(sys.argv[1:])
