"""How far the governor of the command moves the edge at which walks fall, and what it costs.

Its settings were chosen on walks at friction 0.03 to 0.1, 0.2, 0.25 and 0.3, at 0.3, 0.45 and 0.6 m/s, with other
starts. But for the default walk at 0.25, what is walked here is at other friction or at other speeds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from comparison.contenders import label
from comparison.measure.starts import StartsSettings, start_velocity
from comparison.measure.walking import Progress, Rows, grouped, tracked, walk_as_far_as_it_goes
from comparison.tables import Cell, Table
from harpy_pin import Disturbances, Ground, Scenario, Straight, checks, measure
from harpy_pin.log.run import Run
from harpy_pin.simulation.push import Push

__all__ = ["EdgeSettings", "edge_tables", "walk_edge"]

CONTROLLERS = ("condensed", "wbc")
_ON = {False: "off", True: "on"}
DIRECTIONS = {"ahead": (1.0, 0.0), "back": (-1.0, 0.0), "left": (0.0, 1.0), "right": (0.0, -1.0)}


@dataclass(frozen=True, kw_only=True)
class EdgeSettings(StartsSettings):
    """What is walked.

    Attributes:
        frictions: of the ground, for walks without pushes.
        speeds: of these walks, m/s.
        pushes: impulses in mid-stance, N·s, in four directions each.
        push_frictions: of the ground of walks that are pushed.
        push_time: when they begin, s: in the middle of a single support.
    """

    frictions: tuple[float, ...] = (0.25, 0.15, 0.08, 0.06, 0.04, 0.02)
    speeds: tuple[float, ...] = (0.3, 0.4, 0.55)
    starts: int = 2
    duration: float = 12.0
    pushes: tuple[float, ...] = (6.0, 8.0, 11.0, 13.0, 15.0)
    push_frictions: tuple[float, ...] = (0.35,)
    push_time: float = 1.95
    seed: int = 200

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.number("push_time", self.push_time, low=0.0)
        for name in ("frictions", "speeds", "pushes", "push_frictions"):
            for value in getattr(self, name):
                checks.number(name, value, low=0.0)

    @classmethod
    def quick(cls) -> EdgeSettings:
        """Few walks: to see whether it works."""
        return cls(frictions=(0.25, 0.04), speeds=(0.3,), starts=1, duration=5.0, pushes=(6.0,))


def walk_edge(settings: EdgeSettings, progress: Progress | None = None) -> Rows:
    """All walks, each with and without the governor, for the condensed controller and the whole-body QP.

    Returns:
        A row for each walk: what it was, and its measures.
    """
    jobs = [(case, controller, on) for case in _cases(settings) for controller in CONTROLLERS for on in (False, True)]
    return [_walked(*job) for job in tracked(jobs, progress)]


def _cases(settings: EdgeSettings) -> Iterator[dict[str, Any]]:
    """Walks without pushes, then with."""
    for friction, speed, start in product(settings.frictions, settings.speeds, range(settings.starts)):
        velocity = start_velocity(settings.jitter, settings.seed, start)
        what = {"friction": friction, "speed": speed, "push": 0.0, "direction": ""}
        yield {**what, "disturbances": Disturbances(start_velocity=velocity), "duration": settings.duration}
    for friction, impulse, (direction, (x, y)) in product(settings.push_frictions, settings.pushes, DIRECTIONS.items()):
        push = Push(settings.push_time, (impulse * x, impulse * y, 0.0))
        what = {"friction": friction, "speed": 0.3, "push": impulse, "direction": direction}
        yield {**what, "disturbances": Disturbances(pushes=(push,)), "duration": settings.push_time + 4.0}


def _walked(what: dict[str, Any], controller: str, governed: bool) -> dict[str, Any]:
    """What a walk was, and its measures; a controller that fails counts as a fall at that moment."""
    scenario = Scenario(
        gait=Straight(speed=what["speed"]),
        controller={"name": controller, "parameters": {"govern_command": governed}},
        ground=Ground(mu_s=what["friction"]),
        disturbances=what["disturbances"],
        duration=what["duration"],
    )
    run = walk_as_far_as_it_goes(scenario)
    measures = measure(run)
    return {
        **what,
        "controller": controller,
        "governed": governed,
        "fell": run.ending != "completed",
        "stumbled": measures.stumbled,
        "speed_share": measures.distance_m / measures.duration_s / what["speed"],
        "slip_mm_per_step": measures.slip_mm_per_step,
        "tracking_rms_mm": measures.tracking_rms_mm,
        "bent_share": _bent_share(run),
    }


def _bent_share(run: Run) -> float:
    """Share of the ticks in which speed was held back or footholds were shifted, by more than 1 % and 1 mm."""
    if "held_back" not in run:
        return 0.0
    return float(np.mean((run["held_back"] > 0.01) | (np.abs(run["foothold_shift"]) > 1e-3)))


def edge_tables(rows: Rows) -> list[Table]:
    """Falls, speed and slip over friction; falls over pushes."""
    quiet = [row for row in rows if row["push"] == 0.0]
    pushed = [row for row in rows if row["push"] > 0.0]
    return [_friction_table(quiet), _push_table(pushed)]


def _friction_table(rows: Rows) -> Table:
    cells = []
    for (friction, speed, controller), both in grouped(rows, "friction", "speed", "controller").items():
        place = f"μ {friction:g}, {speed:g} m/s, {label(controller)}"
        for (governed,), same in grouped(both, "governed").items():
            walks = [row for row in same if not row["fell"]]
            on = _ON[governed]
            cells.append(Cell(place, f"fell, {on}", f"{len(same) - len(walks)} of {len(same)}"))
            cells.append(Cell(place, f"speed kept, {on}", _mean("speed_share", walks)))
            cells.append(Cell(place, f"slip per step, {on}", _mean("slip_mm_per_step", walks), "mm"))
            if governed:
                cells.append(Cell(place, "ticks bent", _mean("bent_share", walks)))
    note = "Speed, slip and bent ticks are means over the walks that did not fall."
    return Table("edge_friction", "Slippery ground, without pushes", tuple(cells), note)


def _push_table(rows: Rows) -> Table:
    cells = []
    for row in rows:
        place = f"μ {row['friction']:g}, {row['push']:g} N·s, {row['direction']}"
        what = "fell" if row["fell"] else "stumbled" if row["stumbled"] else "walked on"
        cells.append(Cell(place, f"{label(row['controller'])}, {_ON[row['governed']]}", what))
    return Table("edge_pushes", "Pushes in mid-stance, at 0.3 m/s", tuple(cells))


def _mean(name: str, rows: Rows) -> float | None:
    return float(np.mean([row[name] for row in rows])) if rows else None
