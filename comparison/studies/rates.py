"""Measure how much this machine does in a second.

Environment steps and whole-body optima, and a viewer's share of a tick.
"""

from collections.abc import Callable, Iterator
from time import perf_counter, thread_time_ns
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.study import Job, Study, View, grid, shown
from harpy_pin.contrib.batch import CondensedBatch
from harpy_pin.model.source import loaded_robot

VIEWED = 1000
"""Ticks of a round that is viewed."""
WALK = 10.0
"""Length of the walk whose states make a batch, s."""


def _rates(count: float, rounds: int, work: Callable[[], Any]) -> list[float]:
    """How many are done in a second of the clock, in each round."""
    rates = []
    for _ in range(rounds):
        begin = perf_counter()
        work()
        rates.append(count / (perf_counter() - begin))
    return rates


def _shares_of_a_viewer(settings: Job) -> list[float]:
    """µs of the loop's own thread that a viewer takes of a tick, a percentile of each round's
    ticks.
    """
    walk = hp.build(hp.Scenario(controller="condensed", ground=hp.Ground(mu_s=0.25)))
    plant, controller, found = walk.simulator, walk.controller, []
    with hp.view.Viewer(walk.gait.robot, ground=plant.ground) as viewer:
        for _ in range(settings["rounds"]):
            taken = []
            for _ in range(VIEWED):
                command = controller.step(plant.state)
                begin = thread_time_ns()
                viewer.show(plant.state, command, controller)
                taken.append((thread_time_ns() - begin) * 1e-3)
                plant.advance(command)
            found.append(float(np.percentile(taken, settings["percentile"])))
    return found


def _environments(settings: Job) -> list[float]:
    """Steps of many environments under small random actions."""
    from harpy_pin.contrib.gym import (
        batched_env,
    )  # Gymnasium is an extra that only this figure needs

    size, rounds = settings["size"], settings["rounds"] + 1
    worlds, random, idle = (
        batched_env.BatchedEnv(size),
        np.random.default_rng(settings["seed"]),
        np.zeros(size, np.bool_),
    )
    actions = iter([random.uniform(-0.2, 0.2, (size, batched_env.ACTIONS)) for _ in range(rounds)])
    rates = _rates(size, rounds, lambda: worlds.step(next(actions), idle))
    worlds.close()
    return rates[1:]  # the first compiles


def _optima(settings: Job) -> list[float]:
    """Optima at states of a walk or, of another robot, of standing with its weight shifted."""
    random, n = np.random.default_rng(settings["seed"]), settings["size"]
    robot, dtype = loaded_robot(settings["on"]), np.dtype(settings["dtype"]).type
    batch = CondensedBatch(robot, n, dtype=dtype)
    if robot.name == "harpy":
        walk = hp.walk(
            hp.Scenario(controller="condensed", ground=hp.Ground(mu_s=0.25), duration=WALK)
        )
        gait = hp.make_gait(robot, speed=0.3)
        chosen = random.integers(1000, len(walk), (n,))
        q, v, force = (walk[name][chosen].astype(dtype) for name in ("q", "v", "foot_force"))
        for i, row in enumerate(chosen):
            batch.targets.fill(gait.update(float(walk["t"][row])), i)
    else:
        standing = hp.Standing(robot)
        q = np.tile(standing.initial_state()[0], (n, 1)).astype(dtype)
        q[:, 7:] += 0.02 * random.standard_normal((n, q.shape[1] - 7)).astype(dtype)
        v = 0.05 * random.standard_normal((n, robot.nv)).astype(dtype)
        force = np.zeros((n, len(robot.feet), 3), dtype)
        force[:, :, 2] = robot.mass * 9.81 / len(robot.feet)
    rates = _rates(n, settings["rounds"] + 1, lambda: batch.step(q, v, force))
    batch.close()
    return rates[1:]


def _jobs(s: Any) -> Iterator[Job]:
    kinds = [
        {"kind": "environments"},
        *grid(kind="viewer", percentile=(50, 99)),
        *grid(kind="optima", on=s.robots, dtype=("float64", "float32")),
    ]
    return (kind | {"size": s.size, "rounds": s.rounds, "seed": s.seed} for kind in kinds)


FIGURES: dict[str, tuple[str, str, Callable[[Job], list[float]]]] = {
    "environments": ("Gymnasium environments, all cores", "steps/s", _environments),
    "viewer": (
        "a viewer's share of a tick in Python, {percentile} % of ticks below",
        "µs",
        _shares_of_a_viewer,
    ),
    "optima": ("whole-body optima, {on}, {dtype}, all cores", "per second", _optima),
}
"""What is measured, its unit, and what measures it, by the kind of a job."""


def _measured(job: Job) -> dict[str, Any]:
    """A figure: its name, unit, median and best."""
    what, unit, values_of = FIGURES[job["kind"]]
    values = values_of(job)
    best = min(values) if unit == "µs" else max(values)
    return {
        "what": what.format(**job),
        "unit": unit,
        "median": float(np.median(values)),
        "best": best,
    }


STUDY = Study(
    name="rates",
    help=__doc__,
    defaults={
        "robots": ("harpy", "solo12", "g1"),  # of the batches of optima
        "size": 4096,  # robots of a batch, and environments
        "rounds": 15,  # of each figure; the median is told, and the best
        "seed": 0,  # of the actions, and of which states of a walk make a batch
    },
    quick={"robots": ("harpy",), "size": 1024, "rounds": 3},
    timed=_jobs,
    measure=_measured,
    views=[
        View(
            "rates, {unit}",
            "Rates, {unit}",
            row="{what}",
            columns={name: shown(name) for name in ("median", "best")},
            note="Of several rounds; other work on the machine lowers the medians.",
        )
    ],
    only="robots",
)
