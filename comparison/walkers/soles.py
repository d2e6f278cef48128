"""Talos walks straight on its soles: by placo's plan, and under the condensed WBC with this library's gait."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from comparison.measure.walking import walk_as_far_as_it_goes
from comparison.walkers.pattern import DT, SETTLE, Follower, Pattern, planned
from comparison.walking import SIDES, SINK, SOLE_PUSH
from harpy_pin import Disturbances, Ground, Push, Scenario, Walking, load_robot, measure
from harpy_pin.model.state import Vector

__all__ = ["PLANNED", "SolesWalk", "soles_walked", "soles_walks"]

ROBOT, GRAVITY = "talos", 9.81
PLANNED = "placo, joint PD"
SPEEDS = (0.2, 0.36)
"""m/s."""


@dataclass(frozen=True, kw_only=True)
class SolesWalk:
    """One walk.

    Attributes:
        what: kind of the walk.
        walker: ``condensed`` or :data:`PLANNED`.
        plant: the engine.
        number: of the push.
        friction: of the ground.
        speed: forward, m/s.
        push: time, s, and impulse over mass, m/s; none at all zero.
        duration: of the steps, s.
    """

    what: str
    walker: str
    plant: str
    number: int = 0
    friction: float
    speed: float
    push: tuple[float, float, float] = (0.0, 0.0, 0.0)
    duration: float


def soles_walks(*, pushes: int, duration: float, seed: int) -> Iterator[SolesWalk]:
    """The same walks for both.

    Args:
        pushes: walks with a push from each of eight sides.
        duration: of the steps, s.
        seed: of the pushes' times.
    """
    for walker in (PLANNED, "condensed"):
        same = partial(SolesWalk, walker=walker, duration=duration)
        for plant in ("compliant", "mujoco"):
            for speed in SPEEDS:
                yield same(what=f"{ROBOT}, {speed:g} m/s", plant=plant, friction=0.8, speed=speed)
            yield same(what=f"{ROBOT}, {SPEEDS[-1]:g} m/s, friction 0.3", plant=plant, friction=0.3, speed=SPEEDS[-1])
        for number in range(SIDES * pushes):
            angle = 2.0 * np.pi * number / SIDES
            time = float(np.random.default_rng([seed, number]).uniform(2.5, 3.5))
            push = (time, float(SOLE_PUSH * np.cos(angle)), float(SOLE_PUSH * np.sin(angle)))
            yield same(
                what=f"{ROBOT}, pushed", plant="compliant", number=number, friction=0.6, speed=SPEEDS[0], push=push
            )  # fmt: skip


def soles_walked(job: SolesWalk, folder: Path, pattern: Pattern | None = None) -> dict[str, Any]:
    """What the walk was, and its measures.

    Args:
        job: the walk.
        folder: of the peers' environments.
        pattern: of placo's walk; the one that was found by default.

    Raises:
        WorkerError: placo is not installed, or plans nothing.
    """
    robot, chosen = load_robot(ROBOT), Pattern() if pattern is None else pattern
    plan = planned(robot, folder, chosen, speed=job.speed, duration=job.duration)
    end = SETTLE + DT * len(plan["q"])
    scenario = Scenario(
        robot=ROBOT,
        controller="condensed",
        plant=job.plant,
        gait=Walking(velocity=((SETTLE, job.speed, 0.0, 0.0), (SETTLE + job.duration, 0.0, 0.0, 0.0))),
        ground=Ground(mu_s=job.friction, stiffness=robot.mass * GRAVITY / SINK),
        disturbances=Disturbances(pushes=_pushes(job, robot.mass)),
        duration=end + 0.5,
    )
    if job.walker == PLANNED:
        run = walk_as_far_as_it_goes(scenario, partial(Follower, plan=plan, pattern=chosen))
        data, every = robot.model.createData(), slice(None, None, 10)
        centre = np.array([pin.centerOfMass(robot.model, data, q)[:2] for q in run["q"][every]])
        at = np.clip((run["t"][every] - SETTLE) / DT, 0, len(plan["q"]) - 1).astype(int)
        error = centre - centre[0] - (plan["com"][at, :2] - plan["com"][0, :2])
        steps = _steps(plan["share"][: at[-1] + 1])
    else:
        run = walk_as_far_as_it_goes(scenario)
        steps, error = max(int(run["steps"][-1]), 1), run["centre"][:, :2] - run["path"][:, :2]
    said = asdict(job)
    del said["push"]
    return {
        **said,
        "fell": run.ending != "completed",
        "stood_s": float(run["t"][-1]),
        "steps": steps,
        "slip_mm_per_step": 1e3 * float(run["slip_path"][-1].sum()) / steps,
        "off_path_mm": 1e3 * float(np.sqrt(np.mean(np.sum(error**2, axis=1)))),
        "joint_power_w": measure(run).joint_power_w,
    }


def _steps(share: Vector) -> int:
    """How often a foot was off the ground, from the share of the load on the left one; at least 1."""
    left = share[(share == 0.0) | (share == 1.0)]
    return 1 + int(np.count_nonzero(np.diff(left)))


def _pushes(job: SolesWalk, mass: float) -> tuple[Push, ...]:
    t, x, y = job.push
    return (Push(t, (mass * x, mass * y, 0.0)),) if x or y else ()
