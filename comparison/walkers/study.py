"""What is walked beside the condensed WBC: Go1 by a policy, on a course, by random commands, on slippery ground and
pushed; and Talos by placo's pattern generator."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from comparison.campaign.store import kept_rows
from comparison.measure.walking import Progress, Rows, grouped
from comparison.tables import Cell, Table
from comparison.walkers.policy import package_in
from comparison.walkers.soles import SolesWalk, soles_walked, soles_walks
from comparison.walkers.walk import PLANTS, WALKERS, Command, WalkersWalk, walked
from comparison.walking import DRAWN, SIDES, course
from comparison.walking_summary import slip_and_falls
from harpy_pin import checks

__all__ = ["RANGE", "WalkersSettings", "walk_walkers", "walkers_tables"]

RANGE = (1.5, 0.8, 1.2)
"""Of the commands under which the policy was trained: forward, sideways, m/s, turning, rad/s."""
CHANGES = (1.0, 4.0)
"""Between random commands, s."""
PUSHED = 0.6
"""Impulse over mass of a push, m/s."""
SLOW = 0.5
"""Velocity forward on slippery ground and under pushes, m/s."""


@dataclass(frozen=True, kw_only=True)
class WalkersSettings:
    """What is walked.

    Attributes:
        walks: random sequences of commands, of Go1.
        pushes: walks of each robot with a push from each of eight sides.
        course: seconds of the course.
        duration: of the other walks, s.
        seed: of all that is drawn.
    """

    walks: int = 20
    pushes: int = 1
    course: float = 20.0
    duration: float = 8.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("walks", "pushes", "seed"):
            checks.whole(name, getattr(self, name))
        checks.number("course", self.course, low=1.0)
        checks.number("duration", self.duration, low=3.0)

    @classmethod
    def quick(cls) -> WalkersSettings:
        """One short walk of each kind: to see whether it works."""
        return cls(walks=1, pushes=0, course=2.0, duration=3.0)


def walk_walkers(settings: WalkersSettings, progress: Progress | None, path: Path | None, folder: Path) -> Rows:
    """All walks.

    Args:
        settings: what is walked.
        progress: told after every walk.
        path: where finished walks are kept.
        folder: of the peers' environments.

    Returns:
        A row for each walk: what it was, and its measures.

    Raises:
        InputError: the policy is not installed.
        WorkerError: it does not run.
    """
    package_in(folder)
    soles = soles_walks(pushes=settings.pushes, duration=settings.duration - 2.0, seed=settings.seed)
    jobs = {str(job): job for job in (*_jobs(settings), *soles)}
    return kept_rows(jobs, partial(_walked, folder=folder), progress, path)


def _walked(job: WalkersWalk | SolesWalk, folder: Path) -> dict[str, Any]:
    """The row of one walk."""
    return soles_walked(job, folder) if isinstance(job, SolesWalk) else walked(job, folder)


def _jobs(s: WalkersSettings) -> list[WalkersWalk]:
    """Go1's walks, the same for every walker in both plants."""
    return [
        WalkersWalk(walker=walker, plant=plant, **walk) for walk in _walks(s) for plant in PLANTS for walker in WALKERS
    ]


def _walks(s: WalkersSettings) -> Iterator[dict[str, Any]]:
    forward = ((0.5, SLOW, 0.0, 0.0),)
    for what, friction in (("course", 0.8), ("course, friction 0.3", 0.3)):
        rows = course(RANGE[0])
        yield {"what": f"go1, {what}", "number": 0, "friction": friction, "commands": rows, "duration": s.course}
    yield {"what": "go1, friction 0.1", "number": 0, "friction": 0.1, "commands": forward, "duration": s.duration}
    for number in range(s.walks):
        rng = np.random.default_rng([s.seed, number])
        friction, rows = float(rng.uniform(*DRAWN)), tuple(_sequence(rng, s.duration))
        yield {"what": "go1, random", "number": number, "friction": friction, "commands": rows, "duration": s.duration}
    for number in range(SIDES * s.pushes):
        angle = 2.0 * np.pi * number / SIDES
        time = float(np.random.default_rng([s.seed, number]).uniform(2.5, 3.5))
        push = (time, float(PUSHED * np.cos(angle)), float(PUSHED * np.sin(angle)))
        yield {
            "what": "go1, pushed", "number": number, "friction": 0.6, "commands": forward, "push": push,
            "duration": s.duration,
        }  # fmt: skip


def _sequence(rng: np.random.Generator, duration: float) -> Iterator[Command]:
    t = 0.5
    while t < duration - 1.0:
        x, y, w = rng.uniform(-1.0, 1.0, 3) * RANGE
        yield t, float(x), float(y), float(w)
        t += float(rng.uniform(*CHANGES))


COLUMNS = {
    "slip_mm_per_step": ("slip", "mm"),
    "steps_per_s": ("steps", "1/s"),
    "off_path_mm": ("off path", "mm"),
    "error_m_s": ("error", "m/s"),
    "settled_error_m_s": ("settled", "m/s"),
    "settled_turn_error_rad_s": ("turning", "rad/s"),
    "joint_power_w": ("power", "W"),
    "cost_of_transport": ("cost of transport", ""),
    "call_us": ("call", "µs"),
}
"""Heading and unit of each measure."""


def walkers_tables(rows: Rows) -> list[Table]:
    """Every walker's measures, a table for each kind of walk and plant."""
    note = (
        "Medians over the walks that did not fall. Slip: path of what touches the ground, of all feet or corners, per "
        "step. Off path: rms of the centre of mass, from what was planned. Error: of the velocity, rms, against the "
        "command as given; settled, and of turning: from 2 s after a new command on. Power without braking. Joint "
        "friction: estimated, because the controller's model lacks it. Call: thread time of the network alone, "
        "every 20 ms; of the controller with its gait, every step."
    )
    tables = []
    for (what, plant), same in grouped(rows, "what", "plant").items():
        cells = []
        for (walker,), walks in grouped(same, "walker").items():
            cells.append(Cell(walker, "fell", f"{sum(row['fell'] for row in walks)} of {len(walks)}"))
            for key, (column, unit) in COLUMNS.items():
                found = [row[key] for row in walks if not row["fell"] and row.get(key) is not None]
                if key in walks[0]:
                    cells.append(Cell(walker, column, float(np.median(found)) if found else None, unit))
        name = re.sub(r"\W+", "_", f"walkers_{what}_{plant}")
        tables.append(Table(name, f"{what}, {plant}", tuple(cells), note))
    return tables + [_slips(robot, rows) for robot in ("go1", "talos")]


def _slips(robot: str, rows: Rows) -> Table:
    """A row for each walker of a robot: slip and falls in all plants."""
    cells = []
    own = [row for row in rows if row["what"].startswith(robot)]
    for (walker,), walks in grouped(own, "walker").items():
        for (what,), same in grouped(walks, "what").items():
            told = [slip_and_falls(in_plant) for in_plant in grouped(same, "plant").values()]
            cells.append(Cell(walker, what.removeprefix(f"{robot}, "), " / ".join(told)))
    note = "Slip, mm per step, medians over the walks, and how many fall; of one plant after the other."
    return Table(f"walkers_{robot}", f"Walks of {robot.capitalize()}", tuple(cells), note)
