"""Walk every controller in three plants; time their steps.

The library's own plant, Pinocchio's ABA with the paper's ground as written, and MuJoCo. The first
two also walk with shorter steps and with less creep, so that what differs between plants can be
told from what differs within one. Steps are timed standing, with motors that hold the posture.
This takes some minutes.
"""

from collections.abc import Callable, Iterator
from functools import partial
from time import perf_counter_ns
from typing import Any

import numpy as np
import pinocchio as pin

import harpy_pin as hp
from comparison.contenders import CONTENDERS, controller_part, short_name
from comparison.measure.timing import Bench, Laps, TimingSettings, summarise_repetitions
from comparison.studies.grounds import ending_and_slip
from comparison.study import (
    STARTS,
    Job,
    Rows,
    Study,
    View,
    grid,
    shown,
    start_velocity,
    starts,
    walk_as_far_as_it_goes,
)
from harpy_pin.model.catalogue import installed_data
from harpy_pin.simulation.mujoco import MujocoPlant
from harpy_pin.simulation.mujoco.conventions import import_mujoco

PLANTS: dict[str, tuple[hp.scenario.PlantPart, float]] = {
    "compliant": (hp.scenario.Compliant(), 5e-4),
    "0.1 ms": (hp.scenario.Compliant(), 1e-4),
    "pinocchio": (hp.Pinocchio(), 5e-4),
    "0.25 mm/s": (hp.Pinocchio(stiction_tolerance=2.5e-4), 5e-4),
    "mujoco": (hp.Mujoco(), 5e-4),
}
"""Plants and their physics steps, s, by name."""
BATCH = 20
"""Steps, or calls, between two readings of the clock."""
DEPTH = 2e-3
"""How deep the feet of a robot stand whose steps are timed, m."""
STIFF, DAMPED = 3600.0, 60.0
"""Motors' laws, as multiples of each joint's inertia, 1/s² and 1/s."""


def _timed(s: Any) -> Iterator[Job]:
    """Every robot that is installed."""
    robots = [name for name in s.robots if name == "harpy" or installed_data() is not None]
    return grid(robot=robots, repetitions=s.repetitions, laps=s.laps, seed=s.seed)


def _measured(job: Job) -> dict[str, Any]:
    return _step_times(job) if "robot" in job else _walked(job)


def _walked(job: Job) -> dict[str, Any]:
    plant, dt = PLANTS[job["plant"]]
    scenario = hp.Scenario(
        controller=controller_part(job["walker"]),
        plant=plant,
        ground=hp.Ground(mu_s=job["friction"]),
        disturbances=hp.Disturbances(start_velocity=start_velocity(job)),
        duration=job["duration"],
        dt=dt,
    )
    return ending_and_slip(walk_as_far_as_it_goes(scenario))


class _Lap:
    """Something that is timed from the same state, again and again."""

    def __init__(self, call: Callable[[], Any], begin: Callable[[], Any], length: int) -> None:
        self.call, self.begin, self.laps = call, begin, np.zeros(length, dtype=np.int64)

    def time_block(self, begin: int, end: int) -> None:
        """See :class:`comparison.measure.timing.Timed`."""
        for i in range(begin, min(end, len(self.laps))):
            self.begin()
            start = perf_counter_ns()
            self.call()
            self.laps[i] = perf_counter_ns() - start


def _step_times(job: Job) -> dict[str, Any]:
    """Medians, µs."""
    robot = hp.load_harpy() if job["robot"] == "harpy" else hp.load_robot(job["robot"])
    settings = TimingSettings(repetitions=job["repetitions"], warm_up=2, block=10, settle=1)
    rng = np.random.default_rng(job["seed"])
    bench = Bench(robot=robot, friction=0.8, settings=settings, rng=rng)
    laps, overhead = bench.repeat(
        lambda _: _candidates(robot, job["laps"]), [job["laps"]], block=settings.block
    )
    return {name: _median(times, overhead) for name, times in laps.items()}


def _median(laps: list[Laps], overhead: float) -> dict[str, float]:
    """Median and range of the repetitions, µs."""
    found = summarise_repetitions(laps, overhead)
    return {name: float(found[f"{name}_us"]) / BATCH for name in ("p50", "low", "high")}


def _candidates(robot: hp.Robot, length: int) -> dict[str, _Lap]:
    """What is timed, ready to begin."""
    model, terms = robot.model, hp.Dynamics(robot)
    data = model.createData()
    q, v = hp.Standing(robot).initial_state(penetration=DEPTH)
    terms.update(q, v)
    inertia = np.diag(terms.mass_matrix)[6:]
    hold: dict[str, Any] = {
        "q": q[7:].copy(),
        "v": v[6:].copy(),
        "k_p": STIFF * inertia,
        "k_d": DAMPED * inertia,
    }
    command = hp.Command(np.zeros(len(robot.joints)), np.zeros((len(robot.thrusters), 3)), **hold)
    ground = hp.Ground(
        mu_s=0.8, stiffness=robot.mass * hp.model.GRAVITY / (DEPTH * len(robot.feet))
    )
    tau, speed = np.zeros(model.nv), 0.1 * np.ones(model.nv)

    def batch(call: Callable[[], Any]) -> Callable[[], None]:
        def calls() -> None:
            for _ in range(BATCH):
                call()

        return calls

    def steps(plant: hp.Simulator | hp.simulation.PinocchioPlant) -> _Lap:
        return _Lap(lambda: plant.advance(command, steps=BATCH), lambda: plant.reset(q, v), length)

    mujoco, other = import_mujoco(), MujocoPlant(robot, ground)
    step = partial(mujoco.mj_step, other.model, other.data, nstep=BATCH)
    return {
        "aba": _Lap(batch(lambda: pin.aba(model, data, q, speed, tau)), lambda: None, length),
        "own": _Lap(batch(lambda: terms.update(q, speed)), lambda: None, length),
        "compliant": steps(hp.Simulator(robot, ground)),
        "pinocchio": steps(hp.simulation.PinocchioPlant(robot, ground)),
        "mj_step": _Lap(step, lambda: other.reset(q, v), length),
    }


def _slip(name: str, rows: Rows) -> str:
    """Median over the walks; how many fell, if any did."""
    fallen = sum(row["ending"] != "completed" for row in rows)
    if fallen:
        return f"fell {fallen}/{len(rows)}"
    return f"{np.median([row[name] for row in rows]):.2f}"


def _time(name: str) -> Callable[[Rows], Any]:
    return lambda rows: shown(name)(rows)["p50"] if name in rows[0] else None


STUDY = Study(
    name="plants",
    help=__doc__,
    example="--out plants.jsonl",
    defaults={
        **STARTS,
        "seed": 630,
        **{"plants": tuple(PLANTS), "walkers": CONTENDERS, "frictions": (0.8, 0.25)},
        **{"robots": ("harpy", "solo12", "go2", "g1"), "repetitions": 10, "laps": 50},
    },
    quick={"duration": 0.75, "robots": ("harpy",), "repetitions": 3, "laps": 20},
    jobs=lambda s: grid(plant=s.plants, friction=s.frictions, walker=s.walkers, **starts(s)),
    timed=_timed,
    measure=_measured,
    views=[
        *(
            View(
                f"plants_{{friction:g}}_{name}",
                f"Slip, {what}, mm per step, friction {{friction:g}}",
                row=lambda row: short_name(row["walker"]),
                across="{plant}",
                columns=partial(_slip, f"{name}_mm"),
                note="Both feet; or how many of the walks fell. Beside each of the first two "
                "plants the same "
                "one with a physics step of 0.1 ms, and with a stiction tolerance of 0.25 mm/s.",
                only=lambda row: "walker" in row,
            )
            for name, what in (("path", "path"), ("net", "net displacement"))
        ),
        View(
            "plants_times",
            "Times, µs",
            row="{robot}",
            columns={
                "pin.aba": _time("aba"),
                "own terms": _time("own"),
                "compliant step": _time("compliant"),
                "mj_step": _time("mj_step"),
                "pinocchio step": _time("pinocchio"),
            },
            note="Medians. pin.aba and the own recursions (mass matrix, bias, Jacobians and drift "
            "of the feet) are "
            "called from Python once each; a compliant step and mj_step are a twentieth of twenty "
            "in one call; a "
            "pinocchio step is Python, with an evaluation of pin.aba for every stage.",
            only=lambda row: "robot" in row,
        ),
    ],
    only="plants",
)
