"""Walk Harpy where commands say.

A course, 200 random sequences, pushes, slippery ground and absurd commands, under the condensed
controller and the whole-body QP by own search; the course and some of the sequences in MuJoCo, too.
Nothing was chosen on these commands. This takes many minutes.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from comparison.contenders import OWN, controller_part, short_name
from comparison.study import (
    Job,
    Study,
    View,
    commands,
    fell,
    grid,
    kept,
    mean,
    median,
    most,
    walk_as_far_as_it_goes,
)
from harpy_pin import Commanded, Disturbances, Ground, Push, Scenario

Command = tuple[float, float, float]
"""Forward and lateral velocity, m/s, and yaw rate, rad/s."""

COURSE: tuple[tuple[float, float, float, float], ...] = (
    (0.5, 0.4, 0.0, 0.0),
    (5.0, 0.2, 0.0, np.pi / 6.0),
    (8.0, 0.0, 0.15, 0.0),
    (11.5, -0.3, 0.0, 0.0),
    (16.0, 0.0, 0.0, 0.0),
)
"""Ahead, a quarter to the left, sideways, back, and stop: 20 s."""
FRICTIONS = {
    "random": (0.25, 0.8),
    "pushed": (0.25, 0.8),
    "absurd": (0.25, 0.8),
    "slippery": (0.06, 0.2),
}
"""Range from which the friction is drawn, by what is walked."""


def scenario(job: Job) -> Scenario:
    """What is walked; the same number has the same command, friction and push, whoever walks it."""
    rng, what, impulse = (
        np.random.default_rng([job["seed"], job["number"]]),
        job["what"],
        job["impulse"],
    )
    friction, rows = 0.4, COURSE
    pushes: tuple[Push, ...] = ()
    if what != "course":
        friction = float(rng.uniform(*FRICTIONS[what]))
        draw, least, most = DRAWS.get(what, (_mixed, 0.2, 3.0))
        rows = tuple(commands(rng, job["duration"], draw, least=least, most=most))
    if impulse > 0.0:
        angle, time = float(rng.uniform(0.0, 2.0 * np.pi)), float(rng.uniform(1.5, 4.0))
        pushes = (Push(time, (impulse * np.cos(angle), impulse * np.sin(angle), 0.0)),)
    return Scenario(
        controller=controller_part(job["controller"]),
        plant=job["plant"],
        gait=Commanded(velocity=rows),
        ground=Ground(mu_s=friction),
        disturbances=Disturbances(pushes=pushes),
        duration=job["duration"],
    )


def _mixed(rng: np.random.Generator) -> Command:
    """Ahead and back, all at once, turning on the spot, or standing; one in ten is absurd."""
    ahead, turn = (
        (float(rng.uniform(-0.5, 0.5)), 0.0, 0.0),
        (0.0, 0.0, float(rng.uniform(-1.0, 1.0))),
    )
    both = (
        float(rng.uniform(-0.3, 0.4)),
        float(rng.uniform(-0.2, 0.2)),
        float(rng.uniform(-1.0, 1.0)),
    )
    x, y, w = (ahead, both, turn, (0.0, 0.0, 0.0))[int(rng.integers(4))]
    if rng.random() < 0.1:
        x, y, w = (float(value) for value in 10.0 * rng.standard_normal(3))
    return x, y, w


def _fast(rng: np.random.Generator) -> Command:
    """As fast as the legs reach, in a new direction every second."""
    angle = float(rng.uniform(0.0, 2.0 * np.pi))
    return np.cos(angle), 0.5 * np.sin(angle), float(rng.uniform(-2.0, 2.0))


def _absurd(rng: np.random.Generator) -> Command:
    """Metres per second and tens of radians per second, several times a second."""
    x, y, turn = (float(value) for value in rng.standard_normal(3))
    return 3.0 * x, 3.0 * y, 20.0 * turn


DRAWS = {"slippery": (_fast, 0.4, 1.6), "absurd": (_absurd, 0.1, 0.6)}
"""How commands are drawn, and the least and longest time between two of them, s."""


def _jobs(s: Any) -> Iterator[Job]:
    walk: Job = {"what": "random", "plant": "compliant", "number": 0, "impulse": 0.0}
    walk |= {"duration": s.duration, "seed": s.seed}
    kinds = [
        *grid(what="course", plant=s.plants, duration=s.course),
        *(
            one
            for k in range(s.walks)
            for one in ({"number": k}, *grid(what="pushed", number=k, impulse=s.pushes))
        ),
        *grid(number=range(s.in_mujoco), plant="mujoco"),
        *grid(what="slippery", number=range(s.slippery)),
        *grid(what="absurd", number=range(s.absurd)),
    ]
    return (
        walk | {"controller": controller} | one
        for controller in ("condensed", OWN)
        for one in kinds
    )


def _measured(job: Job) -> dict[str, Any]:
    run = walk_as_far_as_it_goes(scenario(job))
    error_m = np.linalg.norm(run["q"][:, :2] - run["x_r"][:, :2], axis=1)
    return kept(run, "stumbled", "slip_mm_per_step") | {
        "path_rms_mm": 1e3 * float(np.sqrt(np.mean(error_m**2))),
        "path_worst_mm": 1e3 * float(error_m.max()),
        "speed_m_s": float(np.linalg.norm(run["applied_velocity"][:, :2], axis=1).mean()),
    }


COLUMNS: dict[str, Any] = {
    "fell": fell,
    "rms": (median("path_rms_mm"), "mm"),
    "worst rms": (most("path_rms_mm"), "mm"),
    "slip": (median("slip_mm_per_step"), "mm"),
    "worst slip": (most("slip_mm_per_step"), "mm"),
}


def _who(row: dict[str, Any]) -> str:
    return short_name(row["controller"])


STUDY = Study(
    name="steering",
    help=__doc__,
    defaults={
        "course": 20.0,  # seconds of the course that are walked, friction 0.4
        "plants": ("compliant", "mujoco"),  # in which it is
        # random sequences of commands for each controller, without and with each push
        "walks": 200,
        "duration": 7.0,  # of these walks, s
        "pushes": (10.0, 12.0),  # N·s, from a random side at a random time
        "in_mujoco": 30,  # how many of the sequences without a push are walked in MuJoCo, too
        "slippery": 20,  # fast sequences on slippery ground
        "absurd": 20,  # sequences of commands that no robot could follow
        "seed": 0,
    },
    quick={
        **{
            "course": 3.0,
            "plants": ("compliant",),
            "walks": 1,
            "duration": 5.0,
            "pushes": (12.0,),
            "in_mujoco": 0,
        },
        **{"slippery": 1, "absurd": 1},
    },
    jobs=_jobs,
    measure=_measured,
    views=[
        View(
            "steering_commands",
            "Commands",
            row=lambda row: f"{row['what']}, {row['plant']}, {_who(row)}",
            columns=COLUMNS,
            note="Distance of the body from its target, and slip per step: medians over the walks, "
            "and the worst of "
            "all.",
            only=lambda row: row["what"] not in ("slippery", "pushed"),
        ),
        View(
            "steering_pushes",
            "Random commands, pushed",
            row=lambda row: f"{row['impulse']:g} N·s, {_who(row)}",
            columns=COLUMNS,
            note="One push of 0.1 s in each walk.",
            only=lambda row: row["what"] == "pushed",
        ),
        View(
            "steering_slippery",
            "Commands as fast as the legs reach, friction {:g} to {:g}".format(
                *FRICTIONS["slippery"]
            ),
            row=_who,
            columns=COLUMNS | {"speed": (mean("speed_m_s"), "m/s")},
            note="Speed is the mean.",
            only=lambda row: row["what"] == "slippery",
        ),
    ],
)
