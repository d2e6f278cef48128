"""Let robots cross stairs, rough ground and ramps.

Harpy, Go2 and G1 under the condensed controller, in both engines: steps up and down, rough ground
that the gait knows or does not know, ramps, and normals that are told wrong by 5 degrees. Ground
that is not known is walked blind: by the gait of flat ground, or, on four feet, by one that feels
the plane below its feet. The robot begins with its feet on the ground. Needs the extra "robots".
This takes some minutes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.study import Job, Study, View, as_far_as_it_goes, grid, kept, median, share, where
from harpy_pin.contrib.felt_ground import OnFeltGround
from harpy_pin.model.source import loaded_robot

FRICTION = 0.6
BLIND_CLEARANCE = 0.06
"""Height of a foot of Go2 at mid-swing on ground that it does not know, m."""
WRONG = float(np.radians(5.0))
"""Error of the normals, rad."""


@dataclass(frozen=True)
class Crossing:
    """One kind of ground and who crosses it."""

    name: str  # in the table
    robot: str  # of the catalogue
    ground: Callable[[int], hp.ground.Terrain]  # from the number of the try
    goal: float  # how far the body must come, m
    duration: float  # s
    tries: int = 2  # how many, of different grounds
    speed: float = 0.3  # m/s
    blind: bool = False  # whether the gait does not know the ground
    wrong: float = 0.0  # error of the normals that the controller knows, rad


def _stairs(rise: float, steps: int) -> Callable[[int], hp.ground.Terrain]:
    return lambda seed: hp.ground.Stairs(rise=rise, depth=0.3, steps=steps, start=0.5 + 0.03 * seed)


def _rough(amplitude: float) -> Callable[[int], hp.ground.Terrain]:
    return lambda seed: hp.ground.Rough(amplitude=amplitude, resolution=0.2, seed=seed)


def _ramp(degrees: float, heading: float = 0.0) -> Callable[[int], hp.ground.Terrain]:
    return lambda seed: hp.ground.Plane(
        slope=float(np.radians(degrees)), heading=heading + 0.1 * seed
    )


CROSSINGS: dict[str, Crossing] = {
    one.name: one
    for one in (
        Crossing("Harpy, 10 steps of 5 cm up", "harpy", _stairs(0.05, 10), 3.5, 13.0, tries=10),
        Crossing("Harpy, 10 steps of 5 cm down", "harpy", _stairs(-0.05, 10), 3.5, 13.0, tries=10),
        Crossing("Harpy, ±2 cm, blind", "harpy", _rough(0.02), 0.7, 4.0, tries=20, blind=True),
        Crossing("Harpy, 20° up, normals 5° wrong", "harpy", _ramp(20.0), 0.6, 4.0, wrong=WRONG),
        Crossing("Go2, 6 steps of 8 cm up", "go2", _stairs(0.08, 6), 2.6, 11.0, tries=10),
        Crossing("Go2, 6 steps of 8 cm down", "go2", _stairs(-0.08, 6), 2.6, 11.0, tries=10),
        Crossing("Go2, ±4 cm, known", "go2", _rough(0.04), 0.7, 4.0, tries=20),
        Crossing("Go2, ±4 cm, blind", "go2", _rough(0.04), 0.7, 4.0, tries=20, blind=True),
        Crossing("Go2, 20° up", "go2", _ramp(20.0), 0.7, 4.0),
        Crossing("Go2, 20° down", "go2", _ramp(-20.0), 0.7, 4.0),
        Crossing("Go2, 10° up, normals 5° wrong", "go2", _ramp(10.0), 0.7, 4.0, wrong=WRONG),
        Crossing("G1, 15° up", "g1", _ramp(15.0), 0.4, 5.0, speed=0.15),
        Crossing("G1, 15° down", "g1", _ramp(-15.0), 0.4, 5.0, speed=0.15),
        Crossing("G1, 15° across", "g1", _ramp(15.0, np.pi / 2.0), 0.4, 5.0, speed=0.15),
    )
}
"""By name."""


def _jobs(s: Any) -> Iterator[Job]:
    for one in grid(crossing=s.names, plant=s.plants):
        yield from (
            one | {"seed": k} for k in range(min(CROSSINGS[one["crossing"]].tries, s.most_tries))
        )


def _measured(job: Job) -> dict[str, Any]:
    one = CROSSINGS[job["crossing"]]
    run = as_far_as_it_goes(partial(_run, one, job["plant"], job["seed"]))
    found = kept(run, "slip_mm_per_step")
    through = not found.pop("fell") and float(np.hypot(*run["q"][-1, :2])) >= one.goal
    return found | {"through": through}


def _run(one: Crossing, plant: str, seed: int) -> hp.Run:
    """Walk a try."""
    robot, terrain, velocity = loaded_robot(one.robot), one.ground(seed), (one.speed, 0.0, 0.0)
    harpy = one.robot == "harpy"
    settings: dict[str, Any] = {
        "robot": one.robot,
        "ground": hp.Ground(mu_s=FRICTION, terrain=terrain),
        "duration": one.duration,
        "plant": plant,
    }
    if not one.blind:
        parts: dict[str, Any] = {} if harpy else {"gait": hp.Walking(velocity=velocity)}
        return hp.build(
            hp.Scenario(**settings, **parts, disturbances=hp.Disturbances(normal_error=one.wrong))
        ).run()
    gait: hp.Gait
    if harpy:
        gait = hp.OnTerrain(hp.make_gait(robot), hp.ground.Plane(slope=0.0))
    else:
        gait = OnFeltGround(hp.WalkingGait(robot, velocity=velocity, clearance=BLIND_CLEARANCE))
    made = hp.build(hp.Scenario(**settings), gait=gait)
    known = hp.OnTerrain(hp.make_gait(robot) if harpy else hp.WalkingGait(robot), terrain)
    made.simulator.reset(*known.initial_state(penetration=made.simulator.static_penetration))
    return made.run()


PLANTS = ("compliant", "mujoco")
COLUMNS: dict[str, Any] = {}
for _plant in PLANTS:
    COLUMNS[_plant] = where(share("through"), plant=_plant)
    COLUMNS[f"slip, {_plant}"] = where(median("slip_mm_per_step"), plant=_plant, through=True), "mm"
STUDY = Study(
    name="crossings",
    help=__doc__,
    example="--out crossings.jsonl",
    defaults={
        "names": tuple(CROSSINGS),
        "plants": PLANTS,
        "most_tries": 20,
    },  # of one kind of ground
    quick={
        "names": ("Harpy, ±2 cm, blind", "Go2, 20° up"),
        "plants": ("compliant",),
        "most_tries": 1,
    },
    jobs=_jobs,
    measure=_measured,
    views=[
        View(
            "crossings",
            "What robots cross",
            row="{crossing}",
            columns=COLUMNS,
            note=f"Condensed controller, friction {FRICTION:g}. Slip is the median of those that "
            f"came through, "
            "per step.",
        )
    ],
    only="names",
)
