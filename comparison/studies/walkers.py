"""What is walked beside the condensed WBC: Go1 by a policy, on a course, by random commands, on slippery ground and
pushed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from comparison.measure.walking import Rows, grouped
from comparison.peers.environment import default_folder
from comparison.studies.walking import DRAWN, SIDES, course, slip_and_falls
from comparison.study import Job, Study, View, commands, fell, grid, median, where
from comparison.walkers.policy import package_in
from comparison.walkers.walk import PLANTS, WALKERS, walked

RANGE = (1.5, 0.8, 1.2)
"""Of the commands under which the policy was trained: forward, sideways, m/s, turning, rad/s."""
CHANGES = (1.0, 4.0)
"""Between random commands, s."""
PUSHED = 0.6
"""Impulse over mass of a push, m/s."""
SLOW = 0.5
"""Velocity forward on slippery ground and under pushes, m/s."""


def _jobs(s: Any) -> Iterator[Job]:
    """Go1's walks, the same for every walker in both plants."""
    package_in(default_folder())
    for one in grid(walk=_walks(s), plant=PLANTS, walker=WALKERS):
        yield {"walker": one["walker"], "plant": one["plant"], "push": None, **one["walk"]}


def _walks(s: Any) -> Iterator[Job]:
    forward: Job = {"number": 0, "commands": [[0.5, SLOW, 0.0, 0.0]], "duration": s.duration}
    on_course = forward | {"commands": [list(row) for row in course(RANGE[0])], "duration": s.course}
    yield on_course | {"what": "go1, course", "friction": 0.8}
    yield on_course | {"what": "go1, course, friction 0.3", "friction": 0.3}
    yield forward | {"what": "go1, friction 0.1", "friction": 0.1}
    for number in range(s.walks):
        rng = np.random.default_rng([s.seed, number])
        drawn = {"friction": float(rng.uniform(*DRAWN)), "number": number, "what": "go1, random"}
        rows = commands(rng, s.duration, _any_direction, begin=0.5, least=CHANGES[0], most=CHANGES[1])
        yield forward | drawn | {"commands": [list(row) for row in rows]}
    for number in range(SIDES * s.pushes):
        angle = 2.0 * np.pi * number / SIDES
        time = float(np.random.default_rng([s.seed, number]).uniform(2.5, 3.5))
        push = [time, float(PUSHED * np.cos(angle)), float(PUSHED * np.sin(angle))]
        yield forward | {"what": "go1, pushed", "number": number, "friction": 0.6, "push": push}


def _any_direction(rng: np.random.Generator) -> tuple[float, float, float]:
    x, y, w = rng.uniform(-1.0, 1.0, 3) * RANGE
    return float(x), float(y), float(w)


def _measured(job: Job) -> dict[str, Any]:
    return walked(job, default_folder())


UNITS = {
    "slip_mm_per_step": ("slip", "mm"),
    "steps_per_s": ("steps", "1/s"),
    "error_m_s": ("error", "m/s"),
    "settled_error_m_s": ("settled", "m/s"),
    "settled_turn_error_rad_s": ("turning", "rad/s"),
    "joint_power_w": ("power", "W"),
    "cost_of_transport": ("cost of transport", ""),
    "call_us": ("call", "µs"),
}


def _kind(row: dict[str, Any]) -> str:
    return str(row["what"]).removeprefix("go1, ")


def _slips(rows: Rows) -> str:
    """In one plant after the other."""
    return " / ".join(slip_and_falls(walks) for walks in grouped(rows, "plant").values())


VIEWS = (
    View(
        lambda row: re.sub(r"\W+", "_", f"walkers_{row['what']}_{row['plant']}"),
        "{what}, {plant}",
        row="{walker}",
        columns={"fell": fell, **{name: (where(median(key), fell=False), unit) for key, (name, unit) in UNITS.items()}},
        note="Medians over the walks that did not fall. Slip: path of what touches the ground, of all feet, per step. "
        "Error: of the velocity, rms, against the "
        "command as given; settled, and of turning: from 2 s after a new command on. Power without braking. Joint "
        "friction: estimated, because the controller's model lacks it. Call: thread time of the network alone, "
        "every 20 ms; of the controller with its gait, every step.",
    ),
    View(
        "walkers_go1",
        "Walks of Go1",
        row="{walker}",
        across=_kind,
        columns=_slips,
        note="Slip, mm per step, medians over the walks, and how many fall; of one plant after the other.",
    ),
)

STUDY = Study(
    name="walkers",
    help="""Walk other people's walker beside ours.

    MuJoCo Playground's policy for Go1 and the condensed WBC in the policy's own model of the robot: a course, random
    commands, slippery ground and pushes. "peers --install" installs the policy. Needs the extra "robots". This takes
    many minutes.
    """,
    example="--out walkers.jsonl",
    defaults={
        "walks": 20,  # random sequences of commands
        "pushes": 1,  # walks with a push from each of eight sides
        "course": 20.0,  # seconds of it
        "duration": 8.0,  # of the other walks, s
        "seed": 0,
    },
    quick={"walks": 1, "pushes": 0, "course": 2.0, "duration": 3.0},
    jobs=_jobs,
    measure=_measured,
    views=VIEWS,
)
