"""Flights of Harpy: hop, jump, hover, a way through the air, a landing on a slope, fans that lag or lose power.

Walks stand beside them, to compare what they cost. All measurements are noisy. A try stands if the robot is upright
over its feet at the end, or walked on where it should. The controller knows of the fan only where a row says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from comparison.measure.walking import Rows, walk_as_far_as_it_goes
from comparison.studies.flight_measures import flight_measures, walk_measures
from comparison.study import Job, Study, Value, shown, tabulated
from comparison.tables import Table, number_text
from harpy_pin import (
    Actuators,
    Commanded,
    Controller,
    Disturbances,
    Gait,
    Ground,
    Noise,
    Run,
    Scenario,
    Thrusters,
    make_controller,
)
from harpy_pin.contrib.flight import Fly, Flying, Jump
from harpy_pin.contrib.thrusters import ThrustWatch
from harpy_pin.ground import Plane, Ramp, Terrain
from harpy_pin.simulation.mujoco import installed_version

FRICTION = 0.6
CONTROLLERS = {"condensed": "condensed", "wbc": "QP"}
PLANTS = {"compliant": "ours", "mujoco": "MuJoCo"}
FAILING = (0, 4.0, 0.5)
"""The left fan loses half its power after 4 s."""
SPEED = 0.3
"""Of walks, and after a landing, m/s."""
FIRST_SEED = 200
"""Of the tries; settings were chosen on lower ones."""
NO_THRUST = 1e6
"""Weight of thrusts where there are none: the controller plans with little."""


@dataclass(frozen=True)
class Manoeuvre:
    """What is flown, or walked.

    Attributes:
        name: in the table.
        flight: what is asked for; None walks.
        duration: of a try, s.
        tries: with different noise.
        walks: whether it walks on.
        slope: of the ground, degrees: from 1.2 m on for flights that walk on, else everywhere.
        failing: whether the left fan loses half its power in the air.
        watched: whether the controller finds that out (:mod:`harpy_pin.contrib.thrusters`).
        lag: of the thrusts, s.
        known: whether the controller knows of it.
        thrust: whether it has thrust at all.
    """

    name: str
    flight: Jump | Fly | None
    duration: float
    tries: int = 3
    walks: bool = False
    slope: float = 0.0
    failing: bool = False
    watched: bool = False
    lag: float = 0.0
    known: bool = False
    thrust: bool = True

    @property
    def terrain(self) -> Terrain | None:
        """The ground; None where it is flat."""
        slope = float(np.radians(self.slope))
        if not slope:
            return None
        return Ramp(slope=slope, start=1.2, length=4.0) if self.walks else Plane(slope=slope)

    @property
    def parameters(self) -> dict[str, Any]:
        """Settings of the controller."""
        known = {"thrust_lag": self.lag} if self.known else {}
        return known if self.thrust else known | {"weights": {"thrust": NO_THRUST}}

    def scenario(self, controller: str, plant: str, seed: int) -> Scenario:
        """What is flown.

        Args:
            controller: its name.
            plant: likewise.
            seed: of the noise.
        """
        after = ((0.0, SPEED if self.walks else 0.0, 0.0, 0.0),)
        failing, largest = FAILING if self.failing else None, None if self.thrust else 0.0
        thrusters = Thrusters(lag=self.lag, failing=failing, largest=largest)
        return Scenario(
            gait=Commanded() if self.flight is None else Flying(flights=self.flight, velocity=after),
            controller={"name": controller, "parameters": self.parameters},
            plant=plant,
            ground=Ground(mu_s=FRICTION, terrain=self.terrain),
            disturbances=Disturbances(noise=Noise.typical(), seed=seed, actuators=Actuators(thrusters=thrusters)),
            duration=self.duration,
        )


JUMP = Jump(height=0.32, forward=0.42)
FLIGHTS: dict[str, Manoeuvre] = {
    one.name: one
    for one in (
        Manoeuvre("walk", None, 6.0, tries=1),
        Manoeuvre("walk without thrust", None, 6.0, tries=1, thrust=False),
        Manoeuvre("hop", Jump(height=0.31), 3.6),
        Manoeuvre("jump 0.4 m", JUMP, 3.6, tries=20),
        Manoeuvre("hover 10 s", Fly(hover=10.0), 15.0),
        Manoeuvre("fly 2 m, walk on", Fly(forward=2.0), 11.0, walks=True),
        Manoeuvre("fly 2 m to 15° up, walk on", Fly(forward=2.0), 11.0, walks=True, slope=15.0),
        Manoeuvre("fly 2 m to 15° down, walk on", Fly(forward=2.0), 11.0, walks=True, slope=-15.0),
        Manoeuvre("half a fan in hovering", Fly(hover=3.0), 9.0, failing=True),
        Manoeuvre("half a fan, found", Fly(hover=3.0), 9.0, failing=True, watched=True),
        Manoeuvre("jump 0.4 m, fans lag 30 ms", JUMP, 3.6, lag=0.03),
        Manoeuvre("jump 0.4 m, 30 ms known", JUMP, 3.6, lag=0.03, known=True),
        Manoeuvre("jump 0.4 m, fans lag 100 ms", JUMP, 3.6, lag=0.1),
        Manoeuvre("jump 0.4 m, 100 ms known", JUMP, 3.6, lag=0.1, known=True),
        Manoeuvre("jump 0.4 m, 300 ms known", JUMP, 3.6, lag=0.3, known=True),
        Manoeuvre("hover 10 s, fans lag 100 ms", Fly(hover=10.0), 15.0, lag=0.1),
        *(
            Manoeuvre(f"{what}, {slope}° up", flight, duration, tries=1, slope=float(slope))
            for slope in (10, 20)
            for what, flight, duration in (
                ("walk", None, 6.0),
                ("jump 0.4 m", JUMP, 3.6),
                ("fly 2 m", Fly(forward=2.0), 9.0),
            )
        ),
    )
}
"""By name."""


def _jobs(s: Any) -> Iterator[Job]:
    plants = [plant for plant in s.plants if plant != "mujoco" or installed_version() is not None]
    for name, controller, plant in product(s.names, s.controllers, plants):
        for seed in range(FIRST_SEED, FIRST_SEED + min(FLIGHTS[name].tries, s.most_tries)):
            yield {"flight": name, "controller": controller, "plant": plant, "seed": seed}


def flown(
    name: str, controller: str = "condensed", plant: str = "compliant", seed: int = FIRST_SEED
) -> tuple[Run, dict[str, Any]]:
    """One try of a manoeuvre, and its measures.

    Args:
        name: of :data:`FLIGHTS`.
        controller: of :data:`CONTROLLERS`.
        plant: of :data:`PLANTS`.
        seed: of the noise.
    """
    one = FLIGHTS[name]
    scenario, make = one.scenario(controller, plant, seed), None
    if one.watched:

        def make(gait: Gait) -> Controller:
            return ThrustWatch(make_controller(controller, gait, mu=FRICTION), gait.robot)

    run = walk_as_far_as_it_goes(scenario, make)
    return run, walk_measures(run) if one.flight is None else flight_measures(run, one.flight, one.walks)


def _measured(job: Job) -> dict[str, Any]:
    """Measures of one try."""
    return flown(job["flight"], job["controller"], job["plant"], job["seed"])[1]


def _of_all(name: str, together: Callable[[list[Any]], Any], digits: int) -> Value:
    """The entry of all tries put together, with so many digits."""
    value = shown(name, together)
    return lambda rows: "" if (found := value(rows)) is None else number_text(float(found), digits)


COLUMNS: dict[str, Any] = {
    "stands": lambda rows: f"{sum(row['stands'] for row in rows)} of {len(rows)}",
    "height, m": _of_all("height_m", min, 3),
    "distance, m": _of_all("distance_m", min, 3),
    "place, mm": _of_all("place_mm", max, 2),
    "hover, mm": _of_all("hover_mm", max, 2),
    "peak / weight": _of_all("peak", max, 2),
    "slip, mm": _of_all("slip_mm", max, 2),
    "energy, J": _of_all("energy_j", np.median, 3),
    "power, W": _of_all("power_w", np.median, 3),
    "J/(N·m)": _of_all("cost", np.median, 2),
}
NOTE = (
    f"Friction {FRICTION:g}, noisy measurements. Of all tries: least height of the jump or flight and least distance "
    "of the feet, greatest error of the landing and of the hovering body, greatest force of both feet and greatest "
    "slip in landing; medians of the energy. Fans of 18 N from 1 kW, motors of 0.6 N·m/√W, both assumed."
)


def _tables(rows: Rows) -> list[Table]:
    """A row for each manoeuvre, controller and plant."""

    def place(row: dict[str, Any]) -> str:
        return f"{row['flight']}, {CONTROLLERS[row['controller']]}, {PLANTS[row['plant']]}"

    return [tabulated("flights", "Flights of Harpy", rows, place, COLUMNS, NOTE)]


STUDY = Study(
    name="flights",
    help="""Let Harpy jump, hover and fly.

    Under the condensed controller and the whole-body QP, in both engines, with noise: a hop, a jump of 0.4 m, hovering
    for 10 s, 2 m through the air to level ground and to slopes of 15 degrees, half a fan lost in the air, fans that
    lag, and what walks, jumps and flights cost on slopes. This takes many minutes.
    """,
    defaults={
        "names": tuple(FLIGHTS),
        "controllers": tuple(CONTROLLERS),
        "plants": tuple(PLANTS),
        "most_tries": 20,  # of one manoeuvre
    },
    quick={
        **{"names": ("walk", "hop", "jump 0.4 m"), "controllers": ("condensed",), "plants": ("compliant",)},
        **{"most_tries": 1},
    },
    jobs=_jobs,
    measure=_measured,
    tables=_tables,
    only="names",
)
