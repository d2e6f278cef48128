"""``python -m comparison.joint_pd go2 bolt``: search these robots' gains, from those found before; write the better."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from functools import partial
from math import inf, log1p

from comparison.joint_pd.controller import JointPDGains
from comparison.joint_pd.search import GAINS_FILE, SEED, found_gains, search_gains
from comparison.walking import PD_ROBOTS, WalkingWalk, walked

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
        job = WalkingWalk(robot=robot, what=what, controller="joint_pd", number=number, duration=DURATION, seed=seed)
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
