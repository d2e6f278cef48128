"""Walk the robots that are known by name.

Courses that commands describe, in both engines under the condensed controller, the whole-body QP by
own search and joint PD; slippery ground, other schedules, random commands without and with noise
and delay, and pushes from eight sides. No setting of the gait was chosen on the random commands and
pushes of seed 0, which are what is walked by default. Needs the extra "robots", and an hour.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.contenders import OWN, controller_part, label
from comparison.joint_pd.controller import JointPD, JointPDGains, found_gains
from comparison.measure.replay import time_ticks
from comparison.study import (
    Job,
    Rows,
    Study,
    View,
    commands,
    fell,
    grid,
    kept,
    median,
    most,
    shown,
    walk_as_far_as_it_goes,
    where,
)
from harpy_pin.model.state import Vector

QUADRUPEDS = ("solo12", "a1", "b1", "go1", "go2", "laikago", "anymal_b", "anymal_c", "hyq")
ON_SOLES = ("g1", "talos", "icub")
BIPEDS = ("bolt", *ON_SOLES)
PD = "joint_pd"
"""Joint PD with feedforward (:mod:`comparison.joint_pd`); it walks everything, but for robots on
soles.
"""
PD_ROBOTS = (*QUADRUPEDS, "bolt")
"""Who has gains for it."""
FRICTION = {
    **dict.fromkeys(("course", "ticks"), 0.8),
    **{"course, friction 0.3": 0.3, "friction 0.1": 0.1},
    **dict.fromkeys(("crawl", "pace", "bound", "ten metres"), 0.5),
}
"""Of the ground, which the controllers know, by what is walked; of the rest it is drawn, or 0.6."""
DRAWN = (0.3, 0.8)
"""Range of the friction under random commands."""
SIDES = 8
PUSH, SOLE_PUSH = 0.6, 0.15
"""Impulse over mass of a push of 0.1 s, m/s, on points and on soles."""
ICE_SPEED = 0.4
"""Speed of quadrupeds at friction 0.1, m/s."""
TEN_METRES = ((0.5, 0.22, 0.0, 0.0), (47.0, 0.11, 0.0, 0.4), (51.0, 0.0, 0.0, 0.0))
"""Of robots on soles: the velocity for more than 10 m forward, a turn by 1.6 rad, and a stop."""
STOPPED = 54.0
"""When they stand again, s."""
DELAY = 3e-3
"""With noise, s."""
LEG_SPEED = 0.99
"""Speed of the course forward, as a share of the gait's largest."""
LATE = 2e3
"""Longest tick that is asked for, µs."""
POSTURE = 1e-9
"""Weight of the QP's posture task, which the condensed WBC has not: the smaller, the nearer are the
two.
"""
COURSES = {"course": "course", "friction 0.3": "course, friction 0.3", "ten metres": "ten metres"}
"""Columns of courses, which are walked in both engines."""
WALKS: dict[str, tuple[str, ...]] = {
    "friction 0.1": ("friction 0.1",),
    "crawl, pace, bound": ("crawl", "pace", "bound"),
    "random": ("random",),
    "noise and delay": ("random, noise and delay",),
    "pushed": ("pushed",),
}
"""Columns of what is walked in the compliant plant, and what each holds."""


def job_of(robot: str, what: str, duration: float, seed: int, **options: Any) -> Job:
    """A walk; by default under the condensed WBC in the compliant plant."""
    job: Job = {
        "robot": robot,
        "what": what,
        "controller": "condensed",
        "plant": "compliant",
        "number": 0,
    }
    return job | {"duration": duration, "seed": seed, **options}


def push_from(turn: float, impulse: float, time: float) -> hp.Push:
    """A level push of 0.1 s towards a direction, as a share of a turn to the left; N·s and s."""
    angle = 2.0 * np.pi * turn
    return hp.Push(time, (impulse * np.cos(angle), impulse * np.sin(angle), 0.0))


def scenario(job: Job) -> hp.Scenario:
    """What is walked; the same number has the same command, friction and push, whoever walks it."""
    robot = hp.load_robot(job["robot"])
    fastest = float(hp.WalkingGait(robot).describe()["max_speed"])
    rng = np.random.default_rng([job["seed"], job["number"]])
    friction, schedule = FRICTION.get(job["what"], 0.6), None
    pushes: tuple[hp.Push, ...] = ()
    sensors: dict[str, Any] = {}
    rows = course(LEG_SPEED * fastest)
    if job["what"] in ("crawl", "pace", "bound"):
        schedule, rows = job["what"], ((0.3, 0.3 * fastest, 0.0, 0.0),)
    elif job["what"] == "ten metres":
        rows = TEN_METRES
    elif job["what"] == "friction 0.1":
        rows = ((0.3, ICE_SPEED if job["robot"] in QUADRUPEDS else 0.3 * fastest, 0.0, 0.0),)
    elif job["what"] == "pushed":
        rows = ((0.3, 0.4 * fastest, 0.0, 0.0),)
        impulse = robot.mass * (SOLE_PUSH if robot.flat_feet else PUSH)
        pushes = (push_from(job["number"] / SIDES, impulse, float(rng.uniform(1.5, 2.5))),)
    elif job["what"].startswith("random"):
        friction = float(rng.uniform(*DRAWN))
        rows = tuple(
            commands(rng, job["duration"], partial(_any_direction, fastest), least=0.2, most=2.5)
        )
        if job["what"].endswith("delay"):
            sensors = {"noise": hp.Noise.typical(), "delay": DELAY, "seed": job["number"]}
    return hp.Scenario(
        robot=job["robot"],
        controller=controller_part("condensed" if job["controller"] == PD else job["controller"]),
        plant=job["plant"],
        gait=hp.Walking(schedule=schedule, velocity=rows),
        ground=hp.Ground(mu_s=friction),
        disturbances=hp.Disturbances(pushes=pushes, **sensors),
        duration=job["duration"],
    )


def course(speed: float) -> tuple[tuple[float, float, float, float], ...]:
    """Forward, a quarter to the left, sideways, back, and stop: 20 s."""
    turn, quarter = 0.6, np.pi / 2.0 / 0.6
    return (
        (0.5, speed, 0.0, 0.0),
        (5.0, 0.5 * speed, 0.0, turn),
        (5.0 + quarter, 0.0, 0.5 * speed, 0.0),
        (11.0, -0.5 * speed, 0.0, 0.0),
        (16.0, 0.0, 0.0, 0.0),
    )


def _any_direction(fastest: float, rng: np.random.Generator) -> tuple[float, float, float]:
    """Up to the largest speed, turning, too."""
    x, y, w = rng.uniform(-1.0, 1.0, 3)
    return float(x * fastest), float(0.6 * y * fastest), float(1.5 * w)


def _jobs(s: Any) -> Iterator[Job]:
    for robot in s.robots:
        walk, four = partial(job_of, robot, seed=s.seed), robot in QUADRUPEDS
        able = [one for one in s.controllers if one != PD or robot in PD_ROBOTS]
        for plant in s.plants:
            for controller, what in product(able, ("course", "course, friction 0.3")):
                yield walk(what, s.course, plant=plant, controller=controller)
            if robot in ON_SOLES:
                yield walk("ten metres", STOPPED, plant=plant, controller=s.controllers[0])
        for controller in [one for one in able if one in (s.controllers[0], PD)]:
            random = s.walks_on_four if four and controller == s.controllers[0] else s.walks
            counts = {
                "friction 0.1": 1,
                **dict.fromkeys(("crawl", "pace", "bound"), 1 if four else 0),
            }
            counts |= {
                "random": random,
                "random, noise and delay": s.walks,
                "pushed": SIDES * s.pushes,
            }
            for what, count in counts.items():
                for one in grid(number=range(count)):
                    yield walk(what, s.duration, controller=controller, **one)


def walked(job: Job, gains: JointPDGains | None = None) -> dict[str, Any]:
    """Measures of one walk; joint PD has the gains that were found by default."""
    what, own = scenario(job), None
    if job["what"] == "ticks":
        return ticks_of(what)
    if job["controller"] == PD:
        chosen = JointPDGains(**found_gains()[job["robot"]]["gains"]) if gains is None else gains
        own = partial(JointPD, gains=chosen, mu=what.mu)
    run = walk_as_far_as_it_goes(what, own)
    error_m = np.linalg.norm(run["centre"][:, :2] - run["path"][:, :2], axis=1)
    return kept(run, "joint_power_w") | {
        "stood_s": float(run["t"][-1]),
        "path_rms_mm": 1e3 * float(np.sqrt(np.mean(error_m**2))),
        "slip_mm_per_step": 1e3 * float(run["slip_path"][-1].sum()) / max(int(run["steps"][-1]), 1),
        "speed_m_s": float(np.linalg.norm(run["applied_velocity"][:, :2], axis=1).max()),
    }


def ticks_of(scenario: hp.Scenario) -> dict[str, Any]:
    """Times of a walk under the condensed WBC, and of the QP by own search at its states; how far
    apart torques are.
    """
    qp = hp.WholeBody(parameters={"solver": "active_set", "weights": {"posture": POSTURE}})
    condensed, other = (
        replace(scenario, controller=hp.Condensed()),
        replace(scenario, controller=qp),
    )
    _, times, apart = time_ticks(hp.build(condensed), hp.build(other).controller)
    return {
        **_times("condensed", times[:, 0]),
        **_times("qp", times[:, 1]),
        "late": int((times > LATE).sum()),
    } | {
        "apart": float(np.median(apart)),
        "apart_99": float(np.quantile(apart, 0.99)),
        "apart_worst": float(apart.max()),
    }


def _times(name: str, times: Vector) -> dict[str, float]:
    return {f"{name}_us": float(np.median(times)), f"{name}_worst_us": float(times.max())}


def _in_both(what: str, rows: Rows) -> str | None:
    """Of a course in one plant after the other; of ten metres only where they were walked."""
    told = [
        where(slip_and_falls, what=what, plant=plant)(rows)
        for plant in dict.fromkeys(r["plant"] for r in rows)
    ]
    return (
        None
        if what == "ten metres" and told[0] is None
        else " / ".join(text or "–" for text in told)
    )


def _of_kinds(kinds: tuple[str, ...], rows: Rows) -> str | None:
    told = [where(slip_and_falls, what=what, plant=rows[0]["plant"])(rows) for what in kinds]
    return ", ".join(text for text in told if text) or None


def slip_and_falls(rows: Rows) -> str:
    """Median slip per step, and the falls if there are any."""
    fell = sum(row["fell"] for row in rows)
    if len(rows) == 1 and fell:
        return "falls"
    slip = f"{np.median([row['slip_mm_per_step'] for row in rows]):.2f}"
    return f"{slip}, {fell} of {len(rows)} fall{'s' if fell == 1 else ''}" if fell else slip


def _is_walk(row: dict[str, Any]) -> bool:
    return bool(row["what"] != "ticks")


_IN_NAMES = str.maketrans({",": None, " ": "_", "/": "_"})
STUDY = Study(
    name="walking",
    help=__doc__,
    example="--only go2 --out go2.jsonl",
    defaults={
        "robots": QUADRUPEDS + BIPEDS,
        "controllers": (
            "condensed",
            OWN,
            PD,
        ),  # of the courses; the first one and joint PD walk the rest
        "plants": ("compliant", "mujoco"),  # of the courses
        "course": 20.0,  # seconds of it that are walked
        # random sequences of commands for each robot, and as many with noise and delay
        "walks": 40,
        # random sequences without noise for each quadruped under the first controller
        "walks_on_four": 200,
        "pushes": 3,  # walks with a push from each of eight sides
        "duration": 6.0,  # of these walks, s
        "seed": 0,
    },
    quick={
        **{
            "robots": ("solo12",),
            "controllers": ("condensed",),
            "plants": ("compliant",),
            "course": 3.0,
            "walks": 1,
        },
        **{"walks_on_four": 1, "pushes": 0, "duration": 3.0},
    },
    jobs=_jobs,
    timed=lambda s: (job_of(robot, "ticks", s.course, s.seed) for robot in s.robots),
    measure=walked,
    views=[
        View(
            lambda row: "walking_{what}_{plant}_{controller}".format(**row).translate(_IN_NAMES),
            lambda row: f"{row['what']}, {row['plant']} plant, {label(row['controller'])}",
            row="{robot}",
            columns={
                "fell": fell,
                "slip": (median("slip_mm_per_step"), "mm"),
                "largest slip": (most("slip_mm_per_step"), "mm"),
                "off path": (median("path_rms_mm"), "mm"),
                "power": (median("joint_power_w"), "W"),
                "speed": (most("speed_m_s"), "m/s"),
            },
            note="Slip: path of all feet (soles: of all corners) along the ground, per step. Off "
            "path: rms. Power: of "
            "the joints, without braking. Medians over the walks.",
            only=_is_walk,
        ),
        View(
            "walks_{controller}",
            lambda row: f"Walks, {label(row['controller'])}",
            row="{robot}",
            columns={
                "speed": (most("speed_m_s"), "m/s"),
                **{column: partial(_in_both, what) for column, what in COURSES.items()},
                "off path": (where(shown("path_rms_mm"), what="course"), "mm"),
                **{column: partial(_of_kinds, kinds) for column, kinds in WALKS.items()},
            },
            note="Slip, mm per step, the median of the walks; of courses in the compliant plant "
            "and in MuJoCo. Off "
            "path: rms.",
            only=_is_walk,
        ),
        View(
            "walking_ticks",
            "Ticks",
            row="{robot}",
            columns={
                **{
                    f"{who}{more}": (shown(f"{key}{entry}"), "µs")
                    for who, key in (("condensed", "condensed"), ("QP, own search", "qp"))
                    for more, entry in (("", "_us"), (", worst", "_worst_us"))
                },
                "over 2 ms": shown("late"),
                "apart": shown("apart"),
                "apart, 99 %": shown("apart_99"),
                "apart, largest": shown("apart_worst"),
            },
            note="On the course at friction 0.8, every tick called from Python, in time of the "
            "thread: medians and "
            "worst. Apart: largest difference of the condensed WBC's torques from the QP's, over "
            "the largest torque.",
            only=lambda row: row["what"] == "ticks",
        ),
    ],
    only="robots",
)
