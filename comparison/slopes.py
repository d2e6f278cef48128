"""Where robots stand on slopes: pitch by friction, beside what statics allows (:mod:`comparison.statics`).

Harpy under every kind of controller, and Go2 and G1, which have no thrusters, under the condensed one.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from comparison.campaign.store import kept_rows
from comparison.measure.walking import Progress, Rows, grouped, walk_as_far_as_it_goes
from comparison.statics import static_bound
from comparison.tables import Cell, Table
from harpy_pin import Ground, Scenario, Stand, Straight, checks, load_robot
from harpy_pin.simulation.resting import walking_stiffness

__all__ = ["ROBOTS", "SlopeSettings", "how_it_stands", "slope_tables", "stand_on_slopes"]

WALKERS: dict[str, tuple[str, dict[str, Any]]] = {
    "no_thrust": ("joint PID, no thrust", {"name": "governed", "governor": "none", "thrust": False, "limits": True}),
    "paper": ("paper's governor", {"name": "governed", "governor": "paper", "limits": True}),
    "filter": ("contact-force filter", {"name": "governed", "governor": "filter", "limits": True}),
    "condensed": ("condensed WBC", {"name": "condensed"}),
    "wbc": ("whole-body QP", {"name": "wbc"}),
    "go2": ("Go2", {"name": "condensed"}),
    "g1": ("G1", {"name": "condensed"}),
}
"""Name in tables and controller of a scenario."""
ROBOTS = ("go2", "g1")
"""Walkers that are robots of the catalogue; the others are Harpy."""
HELD = 5.0
"""Slip of all feet together up to which a robot stands, mm."""


@dataclass(frozen=True, kw_only=True)
class SlopeSettings:
    """What is stood on.

    Attributes:
        degrees: angles by which the ground rises along x, degrees.
        frictions: static friction coefficients, which the controllers know.
        walkers: of :data:`WALKERS`.
        duration: s.
    """

    degrees: tuple[float, ...] = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0)
    frictions: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
    walkers: tuple[str, ...] = tuple(WALKERS)
    duration: float = 3.0

    def __post_init__(self) -> None:
        checks.number("duration", self.duration, low=0.1)
        for walker in self.walkers:
            checks.one_of("walker", walker, WALKERS)

    @classmethod
    def quick(cls) -> SlopeSettings:
        """Few slopes and frictions: to see whether it works."""
        return cls(degrees=(0.0, 15.0, 30.0), frictions=(0.2, 0.8), walkers=("paper", "condensed"), duration=1.0)


def stand_on_slopes(settings: SlopeSettings, progress: Progress | None = None, path: Path | None = None) -> Rows:
    """A row for each angle, friction and controller: the bound, how it ended, slip and thrust."""
    jobs = [
        {"walker": walker, "degrees": degrees, "friction": friction, "duration": settings.duration}
        for walker, degrees, friction in product(settings.walkers, settings.degrees, settings.frictions)
    ]
    return kept_rows({str(job): job for job in jobs}, _stand, progress, path)


def _robot(walker: str) -> str:
    return walker if walker in ROBOTS else "harpy"


def _stand(job: dict[str, Any]) -> dict[str, Any]:
    degrees, friction, walker, duration = (job[name] for name in ("degrees", "friction", "walker", "duration"))
    without_thrust, least_thrust = static_bound(degrees, friction, _robot(walker))
    controller, ground = WALKERS[walker][1], Ground(mu_s=friction, slope=np.radians(degrees))
    points = 1
    if walker in ROBOTS:
        robot = load_robot(walker)
        points = len(robot.feet) // len(robot.corners)
        ground = Ground(mu_s=friction, slope=np.radians(degrees), stiffness=walking_stiffness(robot))
        scenario = Scenario(robot=walker, controller=controller, gait=Stand(), ground=ground, duration=duration)
    else:
        scenario = Scenario(controller=controller, gait=Straight(speed=0.0), ground=ground, duration=duration)
    run = walk_as_far_as_it_goes(scenario)
    thrust = np.linalg.norm(run["thrust"], axis=2).sum(axis=1)
    return {
        **job,
        "fell": run.ending != "completed",
        "slip_mm": 1e3 * float(run["slip_path"][-1].sum()) / points,  # of a sole the mean of its corners
        "thrust_n": float(thrust[len(thrust) // 2 :].mean()) if walker not in ROBOTS else 0.0,
        "without_thrust": without_thrust,
        "least_thrust": least_thrust,
    }


def slope_tables(rows: Rows) -> list[Table]:
    """A map of each walker: its slip, mm, or that it fell; those of statics; and how many places each stands."""
    tables = []
    for robot in dict.fromkeys(_robot(row["walker"]) for row in rows):
        first = {(row["degrees"], row["friction"]): row for row in rows if _robot(row["walker"]) == robot}
        cells = [
            Cell(f"{degrees:g}°", f"{friction:g}", _whole(row["least_thrust"]))
            for (degrees, friction), row in first.items()
        ]
        note = "Least sum of the thrusts' components with which it can stand, N, by angle and friction coefficient."
        name = "Harpy" if robot == "harpy" else WALKERS[robot][0]
        tables.append(Table(f"slopes_statics_{robot}", f"What statics allows: {name}", tuple(cells), note))
    sums: list[Cell] = []
    for (walker,), here in grouped(rows, "walker").items():
        name = WALKERS[walker][0]
        cells = [Cell(f"{row['degrees']:g}°", f"{row['friction']:g}", _how(row)) for row in here]
        note = f"Slip of all feet, mm, by angle and friction coefficient; up to {HELD:g} mm it stands."
        tables.append(Table(f"slopes_{walker}", f"Standing on slopes: {name}", tuple(cells), note))
        stood = [row for row in here if how_it_stands(row) == "stands"]
        possible = sum(row["least_thrust"] is not None for row in here)
        alone = sum(row["without_thrust"] for row in here)
        thrust = [row["thrust_n"] for row in stood]
        sums.append(Cell(name, "stands", f"{len(stood)} of {len(here)}"))
        sums.append(Cell(name, "statics allow", possible))
        sums.append(Cell(name, "without thrust", alone))
        sums.append(Cell(name, "mean thrust", float(np.mean(thrust)) if thrust else None, "N"))
    note = "Mean thrust is the sum of both thrusts in the last half, where it stands."
    return [*tables, Table("slopes", "Where robots stand on slopes", tuple(sums), note)]


def how_it_stands(row: dict[str, Any]) -> str:
    """Whether it ``stands``, ``slides`` or ``falls``."""
    if row["fell"]:
        return "falls"
    return "stands" if row["slip_mm"] <= HELD else "slides"


def _how(row: dict[str, Any]) -> str:
    return "falls" if row["fell"] else _whole(row["slip_mm"])


def _whole(value: float | None) -> str:
    return "–" if value is None else f"{value:.0f}"
