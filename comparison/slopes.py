"""Where robots stand on slopes: pitch by friction, beside what statics allows (:mod:`comparison.statics`).

Harpy under every kind of controller, and walking under the condensed one; Go2 and G1, which have no thrusters, under
that one, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from comparison.campaign.store import kept_rows
from comparison.measure.walking import Progress, Rows, grouped, walk_as_far_as_it_goes
from comparison.statics import static_bound
from comparison.tables import Cell, Table
from harpy_pin import Ground, Plane, Scenario, Stand, Straight, checks, load_robot, measure
from harpy_pin.simulation.resting import walking_stiffness

__all__ = ["SlopeSettings", "how_it_stands", "slope_tables", "stand_on_slopes"]


@dataclass(frozen=True)
class Walker:
    """Who is on the slope.

    Attributes:
        name: in tables.
        controller: of the scenario.
        robot: of the catalogue, or Harpy.
        speed: along x, m/s; zero stands.
        heading: direction in which the ground rises, rad.
    """

    name: str
    controller: dict[str, Any] = field(default_factory=lambda: {"name": "condensed"})
    robot: str = "harpy"
    speed: float = 0.0
    heading: float = 0.0


def _governed(governor: str, **more: bool) -> dict[str, Any]:
    return {"name": "governed", "governor": governor, "limits": True, **more}


SPEED = 0.3
WALKERS: dict[str, Walker] = {
    "no_thrust": Walker("joint PID, no thrust", _governed("none", thrust=False)),
    "paper": Walker("paper's governor", _governed("paper")),
    "filter": Walker("contact-force filter", _governed("filter")),
    "condensed": Walker("condensed WBC"),
    "wbc": Walker("whole-body QP", {"name": "wbc"}),
    "up": Walker("walking uphill", speed=SPEED),
    "down": Walker("walking downhill", speed=SPEED, heading=math.pi),
    "across": Walker("walking across", speed=SPEED, heading=0.5 * math.pi),
    "go2": Walker("Go2", robot="go2"),
    "g1": Walker("G1", robot="g1"),
}
"""By short name; those that walk do so at 0.3 m/s under the condensed controller."""
HELD = 5.0
"""Slip up to which a robot stands or walks, mm: of all feet together, and of one that walks in a step."""
USUAL = 30.0
"""Angle up to which a robot should stand wherever statics allow it, degrees."""


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


def _stand(job: dict[str, Any]) -> dict[str, Any]:
    degrees, friction, duration = (job[name] for name in ("degrees", "friction", "duration"))
    who = WALKERS[job["walker"]]
    without_thrust, least_thrust = static_bound(degrees, friction, who.robot)
    given: dict[str, Any] = {"gait": Straight(speed=who.speed)}
    points, stiffness = 1, Ground.stiffness
    if who.robot != "harpy":
        robot = load_robot(who.robot)
        points, stiffness = len(robot.feet) // len(robot.corners), walking_stiffness(robot)
        given = {"robot": who.robot, "gait": Stand()}
    ground = Ground(mu_s=friction, terrain=Plane(slope=np.radians(degrees), heading=who.heading), stiffness=stiffness)
    run = walk_as_far_as_it_goes(Scenario(**given, controller=who.controller, ground=ground, duration=duration))
    thrust = np.linalg.norm(run["thrust"], axis=2).sum(axis=1)
    slip = 1e3 * float(run["slip_path"][-1].sum()) / points  # of a sole the mean of its corners
    return {
        **job,
        "fell": run.ending != "completed",
        "slip_mm": float(measure(run).slip_mm_per_step) if who.speed else slip,
        "thrust_n": float(thrust[len(thrust) // 2 :].mean()) if who.robot == "harpy" else 0.0,
        "without_thrust": without_thrust,
        "least_thrust": least_thrust,
    }


def slope_tables(rows: Rows) -> list[Table]:
    """A map of each walker: its slip, mm, or that it fell; those of statics; and how many places each stands."""
    tables = []
    for robot in dict.fromkeys(WALKERS[row["walker"]].robot for row in rows):
        first = {(row["degrees"], row["friction"]): row for row in rows if WALKERS[row["walker"]].robot == robot}
        cells = [
            Cell(f"{degrees:g}°", f"{friction:g}", _whole(row["least_thrust"]))
            for (degrees, friction), row in first.items()
        ]
        note = "Least sum of the thrusts' components with which it can stand, N, by angle and friction coefficient."
        name = "Harpy" if robot == "harpy" else WALKERS[robot].name
        tables.append(Table(f"slopes_statics_{robot}", f"What statics allows: {name}", tuple(cells), note))
    sums: list[Cell] = []
    for (walker,), here in grouped(rows, "walker").items():
        name = WALKERS[walker].name
        cells = [Cell(f"{row['degrees']:g}°", f"{row['friction']:g}", _how(row)) for row in here]
        slip = "Slip in a step" if WALKERS[walker].speed else "Slip of all feet"
        note = f"{slip}, mm, by angle and friction coefficient; up to {HELD:g} mm it stands."
        tables.append(Table(f"slopes_{walker}", f"On slopes: {name}", tuple(cells), note))
        stood = [row for row in here if how_it_stands(row) == "stands"]
        possible = sum(row["least_thrust"] is not None for row in here)
        alone = sum(row["without_thrust"] for row in here)
        thrust = [row["thrust_n"] for row in stood]
        sums.append(Cell(name, "stands", f"{len(stood)} of {len(here)}"))
        usual = [row for row in here if row["degrees"] <= USUAL]
        sums.append(Cell(name, f"up to {USUAL:g}°", f"{sum(row in stood for row in usual)} of {len(usual)}"))
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
