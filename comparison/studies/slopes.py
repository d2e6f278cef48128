"""Where robots stand on slopes: pitch by friction, beside what statics allows (:mod:`comparison.statics`).

Harpy under every kind of controller, and walking under the condensed one; Go2 and G1, which have no thrusters, under
that one, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from comparison.measure.walking import Rows, grouped, walk_as_far_as_it_goes
from comparison.studies.statics import static_bound
from comparison.study import Job, Study, crossed, mean, tabulated
from comparison.tables import Table
from harpy_pin import Ground, Scenario, Straight, load_robot, measure
from harpy_pin.ground import Plane
from harpy_pin.ground.ground import walking_stiffness
from harpy_pin.scenario import Stand

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


def _drawn(rows: Rows) -> Figure:
    from comparison.report.slopes_figure import slopes_figure  # which reads how it stands

    return slopes_figure(rows)


def _jobs(s: Any) -> Iterator[Job]:
    for walker, degrees, friction in product(s.walkers, s.degrees, s.frictions):
        yield {"walker": walker, "degrees": degrees, "friction": friction, "duration": s.duration}


def _measured(job: Job) -> dict[str, Any]:
    """The bound, how it ended, slip and thrust."""
    degrees, friction, who = job["degrees"], job["friction"], WALKERS[job["walker"]]
    without_thrust, least_thrust = static_bound(degrees, friction, who.robot)
    given: dict[str, Any] = {"gait": Straight(speed=who.speed)}
    points, stiffness = 1, Ground.stiffness
    if who.robot != "harpy":
        robot = load_robot(who.robot)
        points, stiffness = len(robot.feet) // len(robot.corners), walking_stiffness(robot)
        given = {"robot": who.robot, "gait": Stand()}
    ground = Ground(mu_s=friction, terrain=Plane(slope=np.radians(degrees), heading=who.heading), stiffness=stiffness)
    run = walk_as_far_as_it_goes(Scenario(**given, controller=who.controller, ground=ground, duration=job["duration"]))
    thrust = np.linalg.norm(run["thrust"], axis=2).sum(axis=1)
    slip = 1e3 * float(run["slip_path"][-1].sum()) / points  # of a sole the mean of its corners
    return {
        "fell": run.ending != "completed",
        "slip_mm": float(measure(run).slip_mm_per_step) if who.speed else slip,
        "thrust_n": float(thrust[len(thrust) // 2 :].mean()) if who.robot == "harpy" else 0.0,
        "without_thrust": without_thrust,
        "least_thrust": least_thrust,
    }


def how_it_stands(row: dict[str, Any]) -> str:
    """Whether it ``stands``, ``slides`` or ``falls``."""
    if row["fell"]:
        return "falls"
    return "stands" if row["slip_mm"] <= HELD else "slides"


def _whole(value: float | None) -> str:
    return "–" if value is None else f"{value:.0f}"


def _least_thrust(row: dict[str, Any]) -> str:
    return _whole(row["least_thrust"])


def _slip(row: dict[str, Any]) -> str:
    return "falls" if row["fell"] else _whole(row["slip_mm"])


def _standing(rows: Rows) -> Rows:
    return [row for row in rows if how_it_stands(row) == "stands"]


def _usual(rows: Rows) -> Rows:
    return [row for row in rows if row["degrees"] <= USUAL]


def _map(name: str, title: str, rows: Rows, value: Callable[[dict[str, Any]], str], note: str) -> Table:
    """Of each angle and friction."""
    return crossed(
        name, title, rows, lambda row: f"{row['degrees']:g}°", lambda row: f"{row['friction']:g}",
        lambda rows: value(rows[0]), note,
    )  # fmt: skip


def _tables(rows: Rows) -> list[Table]:
    """A map of each walker: its slip, mm, or that it fell; those of statics; and how many places each stands."""
    tables = []
    note = "Least sum of the thrusts' components with which it can stand, N, by angle and friction coefficient."
    for robot in dict.fromkeys(WALKERS[row["walker"]].robot for row in rows):
        own = [row for row in rows if WALKERS[row["walker"]].robot == robot]
        title = f"What statics allows: {'Harpy' if robot == 'harpy' else WALKERS[robot].name}"
        tables.append(_map(f"slopes_statics_{robot}", title, own, _least_thrust, note))
    for (walker,), here in grouped(rows, "walker").items():
        slip = "Slip in a step" if WALKERS[walker].speed else "Slip of all feet"
        note = f"{slip}, mm, by angle and friction coefficient; up to {HELD:g} mm it stands."
        tables.append(_map(f"slopes_{walker}", f"On slopes: {WALKERS[walker].name}", here, _slip, note))
    thrust = mean("thrust_n")
    columns: dict[str, Any] = {
        "stands": lambda rows: f"{len(_standing(rows))} of {len(rows)}",
        f"up to {USUAL:g}°": lambda rows: f"{len(_standing(_usual(rows)))} of {len(_usual(rows))}",
        "statics allow": lambda rows: sum(row["least_thrust"] is not None for row in rows),
        "without thrust": lambda rows: sum(row["without_thrust"] for row in rows),
        "mean thrust": (lambda rows: thrust(_standing(rows)), "N"),
    }
    note = "Mean thrust is the sum of both thrusts in the last half, where it stands."
    title = "Where robots stand on slopes"
    return [*tables, tabulated("slopes", title, rows, lambda row: WALKERS[row["walker"]].name, columns, note)]


STUDY = Study(
    name="slopes",
    help="""Stand robots on slopes, angle by friction.

    From 0 to 45 degrees, at friction 0.1 to 1.0, beside the bound of statics: Harpy under a joint PID without thrust,
    the paper's governor, the contact-force filter, the condensed controller and the whole-body QP, and Go2 and G1 under
    the condensed controller. Needs the extra "robots". This takes many minutes.
    """,
    example="--out slopes.jsonl --figure slopes.png",
    defaults={
        "degrees": (0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0),  # by which the ground rises along x
        "frictions": (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0),  # which the controllers know
        "walkers": tuple(WALKERS),
        "duration": 3.0,  # s
    },
    quick={"degrees": (0.0, 15.0, 30.0), "frictions": (0.2, 0.8), "walkers": ("paper", "condensed"), "duration": 1.0},
    jobs=_jobs,
    measure=_measured,
    tables=_tables,
    only="walkers",
    figure=_drawn,
)
