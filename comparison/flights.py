"""Flights of Harpy: hop, jump, hover, a way through the air, a landing on a slope, fans that lag or lose power.

All measurements are noisy. A try stands if the robot is upright over its feet at the end, or walked on where it should.
The controller is not told of the fan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from comparison.measure.walking import Progress, Rows, grouped, in_processes, walk_as_far_as_it_goes
from comparison.tables import Cell, Table, number_text
from harpy_pin import (
    Actuators,
    Command,
    Controller,
    Disturbances,
    Fly,
    Flying,
    Gait,
    Ground,
    Jump,
    Noise,
    Ramp,
    Run,
    Scenario,
    State,
    Terrain,
    Thrusters,
    checks,
    make_controller,
)
from harpy_pin.controllers import ThrustWatch
from harpy_pin.gaits.flight.flying_gait import PHASES
from harpy_pin.log.power import PRESETS, Motors, power
from harpy_pin.simulation.mujoco import installed_version

__all__ = ["FLIGHTS", "FlightSettings", "flight_tables", "fly"]

FRICTION = 0.6
CONTROLLERS = {"condensed": "condensed", "wbc": "QP"}
PLANTS = {"compliant": "ours", "mujoco": "MuJoCo"}
MOTORS = Motors(constant=0.6)
"""Of Harpy's joints: assumed."""
WALKED_ON, UPRIGHT, OVER = 0.3, 0.05, 0.03
"""How far it walks after a landing, m; how upright and how near its height it must stand, rad and m."""
FAILS_AT = 4.0
"""When the fan loses half its power, s."""


@dataclass(frozen=True)
class Manoeuvre:
    """What is flown.

    Attributes:
        name: in the table.
        flight: what is asked for.
        duration: of a try, s.
        tries: with different noise.
        walks: whether it walks on.
        slope: of the ground where it lands, degrees.
        half_a_fan: whether the left one loses half its power in the air.
        watched: whether the controller finds that out (:mod:`harpy_pin.controllers.thrust_watch`).
        lag: of the thrusts, of which the controller does not know, s.
    """

    name: str
    flight: Jump | Fly
    duration: float
    tries: int = 3
    walks: bool = False
    slope: float = 0.0
    half_a_fan: bool = False
    watched: bool = False
    lag: float = 0.0


FLIGHTS: dict[str, Manoeuvre] = {
    one.name: one
    for one in (
        Manoeuvre("hop", Jump(height=0.31), 3.6),
        Manoeuvre("jump 0.4 m", Jump(height=0.31, forward=0.42), 3.6, tries=20),
        Manoeuvre("hover 10 s", Fly(hover=10.0), 15.0),
        Manoeuvre("fly 2 m, walk on", Fly(forward=2.0), 11.0, walks=True),
        Manoeuvre("fly 2 m to 15° up, walk on", Fly(forward=2.0), 11.0, walks=True, slope=15.0),
        Manoeuvre("fly 2 m to 15° down, walk on", Fly(forward=2.0), 11.0, walks=True, slope=-15.0),
        Manoeuvre("half a fan in hovering", Fly(hover=3.0), 9.0, half_a_fan=True),
        Manoeuvre("half a fan, found", Fly(hover=3.0), 9.0, half_a_fan=True, watched=True),
        Manoeuvre("jump 0.4 m, fans lag 30 ms", Jump(height=0.31, forward=0.42), 3.6, lag=0.03),
        Manoeuvre("jump 0.4 m, fans lag 100 ms", Jump(height=0.31, forward=0.42), 3.6, lag=0.1),
        Manoeuvre("hover 10 s, fans lag 100 ms", Fly(hover=10.0), 15.0, lag=0.1),
    )
}
"""By name."""


@dataclass(frozen=True, kw_only=True)
class FlightSettings:
    """What is flown.

    Attributes:
        names: of :data:`FLIGHTS`.
        controllers: names of whole-body controllers.
        plants: names of physics engines.
        most_tries: of one manoeuvre.
    """

    names: tuple[str, ...] = tuple(FLIGHTS)
    controllers: tuple[str, ...] = tuple(CONTROLLERS)
    plants: tuple[str, ...] = tuple(PLANTS)
    most_tries: int = 20

    def __post_init__(self) -> None:
        for name in self.names:
            checks.one_of("flight", name, FLIGHTS)
        for name in self.controllers:
            checks.one_of("controller", name, CONTROLLERS)
        for name in self.plants:
            checks.one_of("plant", name, PLANTS)
        checks.whole("most_tries", self.most_tries, low=1)

    @classmethod
    def quick(cls) -> FlightSettings:
        """A hop and a jump: to see whether it works."""
        return cls(names=("hop", "jump 0.4 m"), controllers=("condensed",), plants=("compliant",), most_tries=1)


class HalfAFan:
    """A controller whose left thruster gives half of what it asks for, from a time on.

    Args:
        controller: that does not know.
        since: s.
    """

    def __init__(self, controller: Controller, since: float) -> None:
        inner: Any = controller
        self._step, self._since, self.period = inner.step, since, inner.period
        self.telemetry, self.describe, self.reset = inner.telemetry, inner.describe, inner.reset

    def step(self, state: State) -> Command:
        """The controller's command, with what is left of it.

        Args:
            state: of the tick.
        """
        command: Command = self._step(state)
        if state.t < self._since:
            return command
        thrust = command.thrust.copy()
        thrust[0] *= 0.5
        return Command(command.torque.copy(), thrust)


def fly(settings: FlightSettings, progress: Progress | None = None) -> Rows:
    """A row for each try, and one of a walk, to compare its cost."""
    plants = [plant for plant in settings.plants if plant != "mujoco" or installed_version() is not None]
    jobs = [
        (name, controller, plant, seed)
        for name, controller, plant in product(settings.names, settings.controllers, plants)
        for seed in range(min(FLIGHTS[name].tries, settings.most_tries))
    ]
    walks = [("walk", controller, plant, 0) for controller, plant in product(settings.controllers, plants)]
    return in_processes(_try, [*jobs, *walks], progress)


def _try(job: tuple[str, str, str, int]) -> dict[str, Any]:
    """Measures of one try."""
    name, controller, plant, seed = job
    what = {"flight": name, "controller": controller, "plant": plant, "seed": seed}
    noise = Disturbances(noise=Noise.typical(), seed=seed)
    if name == "walk":
        run = walk_as_far_as_it_goes(
            Scenario(controller=controller, plant=plant, ground=Ground(mu_s=FRICTION), disturbances=noise)
        )
        return {**what, "stands": run.ending == "completed", **_cost(run, slice(None))}
    one = FLIGHTS[name]
    terrain: Terrain | None = None
    if one.slope:
        terrain = Ramp(slope=float(np.radians(one.slope)), start=1.2, length=4.0)
    scenario = Scenario(
        gait=Flying(flights=one.flight, velocity=((0.0, 0.3 if one.walks else 0.0, 0.0, 0.0),)),
        controller=controller,
        plant=plant,
        ground=Ground(mu_s=FRICTION, terrain=terrain),
        disturbances=replace(noise, actuators=Actuators(thrusters=Thrusters(lag=one.lag))),
        duration=one.duration,
    )
    make = None
    if one.half_a_fan:

        def make(gait: Gait) -> Controller:
            whole = make_controller(controller, gait, mu=FRICTION)
            return HalfAFan(ThrustWatch(whole, gait.robot) if one.watched else whole, FAILS_AT)

    run = walk_as_far_as_it_goes(scenario, make)
    return {**what, **_measures(run, one)}


def _measures(run: Run, one: Manoeuvre) -> dict[str, Any]:
    """What became of a flight."""
    phase = run["flight_phase"].ravel()
    air, land = (np.flatnonzero(phase == PHASES.index(name)) for name in ("air", "land"))
    if len(land) == 0:
        return {"stands": False}
    weight = float(run.metadata["mass"]) * 9.81
    q, feet, force = run["q"], run["foot_position"], np.linalg.norm(run["foot_force"], axis=2).sum(axis=1)
    before, after = feet[air[0] - 1].mean(axis=0), feet[land[-1]].mean(axis=0)
    plan, slip = run["body_plan"], run["slip_path"]
    still = _hovering(plan, air)
    flown = slice(int(np.flatnonzero(phase == PHASES.index("bend"))[0]), int(land[-1]) + 1)
    return {
        "stands": _stands(run, one),
        "height_m": float(q[air, 2].max() - q[air[0], 2]),
        "distance_m": float(np.hypot(*(after - before)[:2])),
        "place_mm": float(1e3 * np.hypot(*((after - before)[:2] - (one.flight.forward, one.flight.left)))),
        "hover_mm": float(1e3 * np.linalg.norm(q[still, :3] - plan[still], axis=1).max()) if len(still) else None,
        "peak": float(force[land].max() / weight),
        "slip_mm": float(1e3 * (slip[land[-1]] - slip[land[0]]).sum()),
        **_cost(run, flown, float(np.hypot(one.flight.forward, one.flight.left))),
    }


def _hovering(plan: Any, air: Any) -> Any:
    """Ticks of the air in which the plan stays where it is, but for the first second."""
    rest = np.linalg.norm(np.diff(plan[air], axis=0), axis=1) < 1e-9
    ticks = air[1:][rest]
    return ticks[1000:]


def _stands(run: Run, one: Manoeuvre) -> bool:
    """Whether it stands at the end, or walked on."""
    if run.ending != "completed":
        return False
    end, q = run["q"][-1], run["q"]
    if one.walks:
        gait = np.flatnonzero(run["flight_phase"].ravel() == PHASES.index("gait"))
        return len(gait) > 0 and float(end[0] - q[gait[0], 0]) >= WALKED_ON
    tilt = 2.0 * float(np.hypot(end[3], end[4]))
    height = float(end[2] - run["foot_position"][-1, :, 2].mean() - q[0, 2])
    return tilt < UPRIGHT and abs(height) < OVER


def _cost(run: Run, ticks: slice, distance: float | None = None) -> dict[str, Any]:
    """Energy, and cost of transport."""
    found = power(run, motors=MOTORS, propulsion=PRESETS["fan"])
    energy = float(found.battery[ticks].sum() * found.period)
    path = found.path if distance is None else distance
    return {"energy_j": energy, "cost": energy / (found.weight * path) if path > 0.1 else None}


COLUMNS: dict[str, tuple[str, Callable[[Any], Any], int]] = {
    "height_m": ("height, m", min, 3),
    "distance_m": ("distance, m", min, 3),
    "place_mm": ("place, mm", max, 2),
    "hover_mm": ("hover, mm", max, 2),
    "peak": ("peak / weight", max, 2),
    "slip_mm": ("slip, mm", max, 2),
    "energy_j": ("energy, J", np.median, 3),
    "cost": ("J/(N·m)", np.median, 2),
}
"""By the name in a row: the column's, how tries are put together, and digits."""


def flight_tables(rows: Sequence[dict[str, Any]]) -> list[Table]:
    """A row for each manoeuvre, controller and plant."""
    cells = []
    for (name, controller, plant), here in grouped(rows, "flight", "controller", "plant").items():
        place = f"{name}, {CONTROLLERS[controller]}, {PLANTS[plant]}"
        cells.append(Cell(place, "stands", f"{sum(row['stands'] for row in here)} of {len(here)}"))
        for key, (column, together, digits) in COLUMNS.items():
            values = [row[key] for row in here if row.get(key) is not None]
            cells.append(Cell(place, column, number_text(float(together(values)), digits) if values else ""))
    return [Table("flights", "Flights of Harpy", tuple(cells), NOTE)]


NOTE = (
    f"Friction {FRICTION:g}, noisy measurements. Of all tries: least height of the jump or flight and least distance "
    "of the feet, greatest error of the landing and of the hovering body, greatest force of both feet and greatest "
    "slip in landing; medians of the energy. Fans of 18 N from 1 kW, motors of 0.6 N·m/√W, both assumed."
)
