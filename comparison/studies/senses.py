"""Walk on what robots feel.

That is an inertial unit, encoders and motor torques. Thirteen robots and Harpy in both engines, and
quadrupeds in other people's models of them, walk random commands, pushes and courses, and Harpy
jumps. The table has falls, on two feet also those on the true state, and how far off the estimate
is. Needs the extra "robots".
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from math import ceil
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.measure.estimates import complementary, contacts
from comparison.peers.environment import default_folder
from comparison.studies.walking import BIPEDS, DRAWN, QUADRUPEDS, SIDES, job_of, push_from, scenario
from comparison.studies.worlds import random_walk
from comparison.study import Job, Study, View, fell, median, most, walk_as_far_as_it_goes, where
from comparison.worlds import walk as others
from comparison.worlds.models import FEET, ROBOTS
from harpy_pin.contrib.drift import off
from harpy_pin.contrib.flight import Flying, Jump
from harpy_pin.model.source import loaded_robot

HARPY, HARPY_PUSH = "harpy", 3.0
"""Its pushes, N·s."""
SHARE = {HARPY: 0.6, **dict.fromkeys(BIPEDS, 0.4)}
"""Of the random commands, that robots on two feet walk."""
KNOWN = "motor law, joints known"
"""Who walks in other people's worlds."""


def _scenario(job: Job) -> hp.Scenario:
    if job["robot"] != HARPY:
        return scenario(job)
    rng = np.random.default_rng([job["seed"], job["number"]])
    push = push_from(job["number"] / SIDES, HARPY_PUSH, float(rng.uniform(1.5, 2.5)))
    return hp.Scenario(
        gait=Flying(flights=Jump(height=0.3, forward=0.4)) if job["what"] == "jump" else None,
        plant=job["plant"],
        ground=hp.Ground(mu_s=float(rng.uniform(*DRAWN))),
        disturbances=hp.Disturbances(pushes=(push,) if job["what"] == "pushed" else ()),
        duration=job["duration"],
    )


def walked(job: Job) -> dict[str, Any]:
    """Measures of one walk."""
    if "world" in job:
        who = replace(others.WALKERS[KNOWN], sensed=True)
        return others.walked({**job, "who": vars(who)})
    drawn = _scenario(job)
    disturbances = replace(drawn.disturbances, seed=job["number"])
    run = walk_as_far_as_it_goes(
        replace(drawn, state=job["state"], sensors=hp.Imu(), disturbances=disturbances)
    )
    found: dict[str, Any] = {"fell": run.ending != "completed"}
    found |= off(run["q"], run["v"], run["estimated_q"], run["estimated_v"], period=drawn.period)
    if job["state"] == "estimated":
        plain = off(
            run["q"], run["v"], *complementary(run, loaded_robot(job["robot"])), period=drawn.period
        )
        found |= {f"plain_{name}": plain[name] for name in ("drift", "velocity_cm_s", "tilt_deg")}
    return found | contacts(run["foot_force"][:, :, 2], run["contact_probability"])


def _jobs(s: Any) -> Iterator[Job]:
    for robot, plant, state in product(s.robots, s.plants, s.states):
        if state == "true" and robot in QUADRUPEDS:
            continue
        walk = partial(job_of, robot, plant=plant, controller="condensed")
        walks = ceil(SHARE.get(robot, 1.0) * s.walks)
        kinds = {"random": walks, "pushed": min(walks, SIDES)}
        kinds |= {"jump": 1} if robot == HARPY else {"course, friction 0.3": 1, "friction 0.1": 1}
        for what, count in kinds.items():
            duration = s.course if what.startswith("course") else s.duration
            yield from (
                walk(what, duration, s.seed, number=number) | {"state": state}
                for number in range(count)
            )
    worlds = s.worlds if (default_folder() / "worlds").exists() else ()
    for name, friction, number in product(worlds, (0.8, 0.3), range(s.walks)):
        job = random_walk(s.seed, number, friction, s.duration) | {
            "world": name,
            "feet": list(FEET),
        }
        yield job | {"noise": number, "state": "estimated", "robot": name, "plant": "world"}


_SEEN = {"state": "estimated", "fell": False}

STUDY = Study(
    name="senses",
    help=__doc__,
    example="--walks 2 --only go2",
    defaults={
        "robots": (HARPY, *QUADRUPEDS, *BIPEDS),
        "plants": ("compliant", "mujoco"),
        "states": ("true", "estimated"),
        "worlds": tuple(ROBOTS),
        "walks": 50,  # with random commands
        "duration": 6.0,  # s
        "course": 20.0,  # s
        "seed": 2000,
    },
    quick={"robots": (HARPY,), "plants": ("compliant",), "worlds": (), "walks": 1, "duration": 3.0},
    options={"walks": "Random commands of each robot."},
    jobs=_jobs,
    measure=walked,
    views=(
        View(
            "senses",
            "On the estimate",
            row="{robot}",
            columns={
                "walks": where(lambda rows: len(rows), state="estimated"),
                "fell, true state": where(fell, state="true"),
                "fell, estimate": where(fell, state="estimated"),
                "drift": (where(median("drift"), **_SEEN), "%"),
                "worst drift": (where(most("drift"), **_SEEN), "%"),
                "path": (where(median("trajectory_mm"), **_SEEN), "mm"),
                "within a second": (where(median("relative_mm"), **_SEEN), "mm"),
                "velocity": (where(median("velocity_cm_s"), **_SEEN), "cm/s"),
                "tilt": (where(median("tilt_deg"), **_SEEN), "°"),
                "complementary filter, drift": (where(median("plain_drift"), **_SEEN), "%"),
                "complementary filter, velocity": (
                    where(median("plain_velocity_cm_s"), **_SEEN),
                    "cm/s",
                ),
                "complementary filter, tilt": (where(median("plain_tilt_deg"), **_SEEN), "°"),
                **{name: where(median(name), **_SEEN) for name in ("precision", "recall")},
            },
            note="Drift is the error of the displacement over the length of the way; path, way "
            "within a second, "
            "velocity and tilt are rms errors of the body; precision and recall those of the "
            "contacts. Medians of the "
            "walks that stand. The complementary filter has the same readings and contacts.",
        ),
    ),
    only="robots",
)
