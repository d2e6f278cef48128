"""Let Harpy jump, hover and fly.

Under the condensed controller and the whole-body QP by own search, in both engines, with noise: a
hop, a jump of 0.4 m, hovering for 10 s, 2 m through the air to level ground and to slopes of 15
degrees, half a fan lost in the air, fans that lag, and what walks, jumps and flights cost on
slopes. A try stands if the robot is upright over its feet at the end, or walked on where it should.
The controller knows of the fan only where a row says so. This takes many minutes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.study import (
    Job,
    Rows,
    Shown,
    Study,
    Value,
    View,
    grid,
    number_text,
    share,
    shown,
    walk_as_far_as_it_goes,
)
from harpy_pin.contrib.flight import Fly, Flying, Jump
from harpy_pin.contrib.flight.flying_gait import PHASES
from harpy_pin.contrib.power import Motors, power
from harpy_pin.contrib.thrusters import ThrustWatch
from harpy_pin.log.power import PRESETS

FRICTION = 0.6
CONTROLLERS: dict[str, tuple[str, dict[str, Any]]] = {
    "condensed": ("condensed", {}),
    "QP": ("wbc", {"solver": "active_set"}),
}
"""Names of controllers and their parameters, by the name of their rows; ``QP`` is the whole-body QP
by own search.
"""
PLANTS = {"compliant": "ours", "mujoco": "MuJoCo"}
FAILING = (0, 4.0, 0.5)
"""The left fan loses half its power after 4 s."""
SPEED = 0.3  # of walks, and after a landing, m/s
FIRST_SEED = 200
"""Of the tries; settings were chosen on lower ones."""
NO_THRUST = 1e6
"""Weight of thrusts where there are none: the controller plans with little."""
MOTORS = Motors(constant=0.6)
"""Of Harpy's joints: assumed."""
WALKED_ON, UPRIGHT, OVER = 0.3, 0.05, 0.03
"""How far it walks after a landing, m; how upright and how near its height it must stand, rad and
m.
"""


@dataclass(frozen=True)
class Manoeuvre:
    """What is flown, or walked."""

    name: str  # in the table
    flight: Jump | Fly | None  # what is asked for; None walks
    duration: float  # of a try, s
    tries: int = 3  # with different noise
    walks: bool = False  # whether it walks on
    # of the ground, degrees: from 1.2 m on for flights that walk on, else everywhere
    slope: float = 0.0
    failing: bool = False  # whether the left fan loses half its power in the air
    # whether the controller finds that out (:mod:`harpy_pin.contrib.thrusters`)
    watched: bool = False
    lag: float = 0.0  # of the thrusts, s
    known: bool = False  # whether the controller knows of it
    thrust: bool = True  # whether it has thrust at all

    def scenario(self, controller: str, plant: str, seed: int) -> hp.Scenario:
        """What is flown; the seed is that of the noise."""
        slope = float(np.radians(self.slope))
        terrain: hp.ground.Plane | hp.ground.Ramp | None = None
        if slope:
            terrain = (
                hp.ground.Ramp(slope=slope, start=1.2, length=4.0)
                if self.walks
                else hp.ground.Plane(slope=slope)
            )
        name, own = CONTROLLERS[controller]
        parameters: dict[str, Any] = {**own, "thrust_lag": self.lag} if self.known else {**own}
        if not self.thrust:
            parameters["weights"] = {"thrust": NO_THRUST}
        after = ((0.0, SPEED if self.walks else 0.0, 0.0, 0.0),)
        failing, largest = FAILING if self.failing else None, None if self.thrust else 0.0
        fans = hp.Actuators(thrusters=hp.Thrusters(lag=self.lag, failing=failing, largest=largest))
        return hp.Scenario(
            gait=hp.Commanded()
            if self.flight is None
            else Flying(flights=self.flight, velocity=after),
            controller={"name": name, "parameters": parameters},
            plant=plant,
            ground=hp.Ground(mu_s=FRICTION, terrain=terrain),
            disturbances=hp.Disturbances(noise=hp.Noise.typical(), seed=seed, actuators=fans),
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
    for one in grid(flight=s.names, controller=s.controllers, plant=s.plants):
        yield from (
            one | {"seed": FIRST_SEED + k}
            for k in range(min(FLIGHTS[one["flight"]].tries, s.most_tries))
        )


def _measured(job: Job) -> dict[str, Any]:
    """Measures of one try of a manoeuvre."""
    one, make = FLIGHTS[job["flight"]], None
    if one.watched:

        def make(gait: hp.Gait) -> hp.Controller:
            name, own = CONTROLLERS[job["controller"]]
            return ThrustWatch(hp.make_controller(name, gait, mu=FRICTION, **own), gait.robot)

    run = walk_as_far_as_it_goes(one.scenario(job["controller"], job["plant"], job["seed"]), make)
    if one.flight is not None:
        return flight_measures(run, one.flight, one.walks)
    if run.ending != "completed":
        return {"stands": False, "fell_s": float(run["t"][-1])}
    way = float(run["q"][-1, 0] - run["q"][0, 0])
    return {
        "stands": True,
        "distance_m": way,
        "peak": _peak(run, slice(None)),
        **_cost(run, slice(None)),
    }


def flight_measures(run: hp.Run, flight: Jump | Fly, walks: bool) -> dict[str, Any]:
    """Where a flight landed, how hard, and what it cost; ``walks`` says whether it should walk
    on.
    """
    phase = run["flight_phase"].ravel()
    air, land = (np.flatnonzero(phase == PHASES.index(name)) for name in ("air", "land"))
    if len(land) == 0:
        return {"stands": False, "fell_s": float(run["t"][-1])}
    q, feet, plan, slip = run["q"], run["foot_position"], run["body_plan"], run["slip_path"]
    before, after = feet[air[0] - 1].mean(axis=0), feet[land[-1]].mean(axis=0)
    rest = np.linalg.norm(np.diff(plan[air], axis=0), axis=1) < 1e-9
    still = air[1:][rest][1000:]  # where the plan stays, but for the first second
    bend = int(np.flatnonzero(phase == PHASES.index("bend"))[0])
    return {
        "stands": _stands(run, walks),
        "height_m": float(q[air, 2].max() - q[air[0], 2]),
        "distance_m": float(np.hypot(*(after - before)[:2])),
        "place_mm": float(1e3 * np.hypot(*((after - before)[:2] - (flight.forward, flight.left)))),
        "hover_mm": float(1e3 * np.linalg.norm(q[still, :3] - plan[still], axis=1).max())
        if len(still)
        else None,
        "push_off": _peak(run, slice(bend, int(air[0]))),
        "peak": _peak(run, land),
        "slip_mm": float(1e3 * (slip[land[-1]] - slip[land[0]]).sum()),
        **_cost(run, slice(bend, int(land[-1]) + 1), float(np.hypot(flight.forward, flight.left))),
    }


def _peak(run: hp.Run, ticks: Any) -> float:
    """Largest force of both feet, per weight."""
    force = np.linalg.norm(run["foot_force"][ticks], axis=2).sum(axis=1)
    return float(force.max() / (float(run.metadata["mass"]) * 9.81))


def _stands(run: hp.Run, walks: bool) -> bool:
    """Whether it stands at the end, or walked on."""
    if run.ending != "completed":
        return False
    end, q = run["q"][-1], run["q"]
    if walks:
        gait = np.flatnonzero(run["flight_phase"].ravel() == PHASES.index("gait"))
        return len(gait) > 0 and float(end[0] - q[gait[0], 0]) >= WALKED_ON
    tilt = 2.0 * float(np.hypot(end[3], end[4]))
    height = float(end[2] - run["foot_position"][-1, :, 2].mean() - q[0, 2])
    return tilt < UPRIGHT and abs(height) < OVER


def _cost(run: hp.Run, ticks: slice, distance: float | None = None) -> dict[str, Any]:
    """Energy, power, and cost of transport."""
    found = power(run, motors=MOTORS, propulsion=PRESETS["fan"])
    battery = found.battery[ticks]
    energy = float(battery.sum() * found.period)
    path = found.path if distance is None else distance
    cost = energy / (found.weight * path) if path > 0.1 else None
    return {"energy_j": energy, "power_w": float(battery.mean()), "cost": cost}


def _of_all(name: str, together: Callable[[list[Any]], Any], digits: int) -> Value:
    """The entry of all tries put together, with so many digits."""
    value = shown(name, together)
    return lambda rows: "" if (found := value(rows)) is None else number_text(float(found), digits)


def _cost_or_falls(rows: Rows) -> str:
    """The largest energy of tries that stand, and how many do not."""
    standing = [row for row in rows if row["stands"]]
    fell = len(rows) - len(standing)
    parts = (_of_all("cost", max, 3)(standing), f"{fell} of {len(rows)} fall" if fell else "")
    return ", ".join(filter(None, parts))


_UPHILL = (
    "walk",
    "jump 0.4 m",
    "fly 2 m, walk on",
    *(name for name in FLIGHTS if name.endswith("° up")),
)
"""What is done uphill, and the same on level ground."""
_COLUMNS: dict[str, Shown] = {
    "stands": share("stands"),
    "height, m": _of_all("height_m", min, 3),
    "distance, m": _of_all("distance_m", min, 3),
    "place, mm": _of_all("place_mm", max, 2),
    "hover, mm": _of_all("hover_mm", max, 2),
    "push-off / weight": _of_all("push_off", max, 2),
    "peak / weight": _of_all("peak", max, 2),
    "slip, mm": _of_all("slip_mm", max, 2),
    "energy, J": _of_all("energy_j", np.median, 3),
    "power, W": _of_all("power_w", np.median, 3),
    "J/(N·m)": _of_all("cost", np.median, 2),
}
_NOTE = (
    f"Friction {FRICTION:g}, noisy measurements. Of all tries: least height of the jump or flight "
    f"and "
    "least distance of the feet, greatest error of the landing and of the hovering body, greatest "
    "force of "
    "both feet in pushing off, and in landing or walking, greatest slip in landing; medians of the "
    "energy. "
    "Fans of 18 N from 1 kW, motors of 0.6 N·m/√W, both assumed."
)

STUDY = Study(
    name="flights",
    help=__doc__,
    defaults={
        **{"names": tuple(FLIGHTS), "controllers": tuple(CONTROLLERS), "plants": tuple(PLANTS)},
        "most_tries": 20,  # of one manoeuvre
    },
    quick={
        **{
            "names": ("walk", "hop", "jump 0.4 m"),
            "controllers": ("condensed",),
            "plants": ("compliant",),
        },
        "most_tries": 1,
    },
    jobs=_jobs,
    measure=_measured,
    views=[
        View(
            "flights",
            "Flights of Harpy",
            row=lambda row: f"{row['flight']}, {row['controller']}, {PLANTS[row['plant']]}",
            columns=_COLUMNS,
            note=_NOTE,
        ),
        View(
            "flights_all",
            "Flights of Harpy, all controllers and engines",
            "{flight}",
            _COLUMNS,
            note=_NOTE,
        ),
        View(
            "flights_uphill",
            "Energy, J/(N·m), level and uphill, and tries that fall",
            row=lambda row: row["flight"].partition(",")[0],
            across=lambda row: f"{FLIGHTS[row['flight']].slope:g}°",
            columns=_cost_or_falls,
            note="The largest of both controllers and engines.",
            only=lambda row: row["flight"] in _UPHILL,
        ),
    ],
    only="names",
)
