"""Push robots from eight sides.

At four instants of a step, in place and at half of the largest speed, by 0.4 and 0.6 m/s times the
mass. The gait on two feet was tuned on as many pushes of the same sizes from directions and at
instants half-way between these. Needs the extra "robots".
"""

from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.studies.crossings import PLANTS
from comparison.studies.walking import BIPEDS, QUADRUPEDS, push_from
from comparison.study import (
    Job,
    Rows,
    Study,
    View,
    grid,
    grouped,
    share,
    walk_as_far_as_it_goes,
    where,
)

SIDES, INSTANTS = 8, 4
"""Directions of a push, and instants of a step at which it begins."""
FRICTION = 0.6
WALKED, STANDS = 2.0, 2.5
"""How long a robot walks before it is pushed, and for how long it has to stand afterwards, s."""
SIZES = (0.4, 0.6)
"""Impulses of pushes of 0.1 s over the mass, m/s."""
SPEEDS = {"in place": 0.0, "at half speed": 0.5}
"""As shares of the largest speed."""
MOST = 7
"""Discs of the figure side by side."""
_STOOD = ("#c8553d", "#e9c46a", "#2c6e9b")
"""Colours: no push is stood, the smaller, both."""


def measured(job: Job) -> dict[str, Any]:
    """Whether it still stands at the end."""
    robot = hp.load_robot(job["robot"])
    gait = hp.WalkingGait(robot)
    time = round(WALKED + gait.step_duration * (job["instant"] + 0.5) / INSTANTS, 3)
    push = push_from((job["side"] + 0.5) / SIDES, robot.mass * job["size"], time)
    schedule = "step" if job["robot"] in BIPEDS else "trot"
    scenario = hp.Scenario(
        robot=job["robot"],
        plant=job["plant"],
        gait=hp.Walking(
            schedule=schedule, velocity=((0.3, SPEEDS[job["speed"]] * gait.max_speed, 0.0, 0.0),)
        ),
        controller=hp.Condensed(),
        ground=hp.Ground(mu_s=FRICTION),
        disturbances=hp.Disturbances(pushes=(push,)),
        duration=time + STANDS,
    )
    return {"stands": walk_as_far_as_it_goes(scenario).ending == "completed"}


def _draw(figure: Any, rows: Rows) -> None:
    """A disc for each robot and plant: the side of a push is the angle, its instant and the speed
    are the ring.
    """
    from matplotlib.patches import Patch

    discs, sizes = grouped(rows, "plant", "robot"), sorted({row["size"] for row in rows})
    plants, robots = ([*dict.fromkeys(names)] for names in zip(*discs, strict=True))
    lines, columns = -(-len(robots) // MOST), min(len(robots), MOST)
    figure.set_size_inches(1.75 * columns, 1.95 * lines * len(plants) + 0.5)
    panels = figure.subplots(
        lines * len(plants), columns, squeeze=False, subplot_kw={"projection": "polar"}
    )
    for panel in panels.flat:
        panel.set_axis_off()
    for (plant, robot), mine in discs.items():
        line, column = divmod(robots.index(robot), MOST)
        panel = panels[lines * plants.index(plant) + line][column]
        panel.set_theta_zero_location("N")
        for (speed, side, instant), same in grouped(mine, "speed", "side", "instant").items():
            sides, instants = (1 + max(row[name] for row in mine) for name in ("side", "instant"))
            stood = sum(row["stands"] for row in same) * len(_STOOD) // (len(sizes) + 1)
            ring, angle = (
                [*SPEEDS].index(speed) * (instants + 0.5) + instant + 1.0,
                2.0 * np.pi * (side + 0.5) / sides,
            )
            panel.bar(
                angle,
                1.0,
                2.0 * np.pi / sides,
                ring,
                color=_STOOD[stood],
                edgecolor="white",
                linewidth=0.6,
            )
        panel.set_title(f"{robot}, {plant}", pad=0.0)
    words = ("falls", *(f"stands {size:g}" for size in sizes))
    patches = [
        Patch(color=_STOOD[n * len(_STOOD) // len(words)], label=word)
        for n, word in enumerate(words)
    ]
    figure.legend(handles=patches, loc="outside lower center", ncols=len(words), frameon=False)


STUDY = Study(
    name="pushes",
    help=__doc__,
    defaults={
        "robots": (*QUADRUPEDS, *BIPEDS),
        "plants": PLANTS,
        "sizes": SIZES,
        "sides": SIDES,
        "instants": INSTANTS,
    },
    quick={"robots": ("bolt",), "sizes": SIZES[:1], "sides": 1, "instants": 1},
    jobs=lambda s: grid(
        robot=s.robots,
        plant=s.plants,
        speed=SPEEDS,
        size=s.sizes,
        side=range(s.sides),
        instant=range(s.instants),
    ),
    measure=measured,
    views=[
        View(
            "pushes_{plant}",
            "Pushed, {plant}: pushes after which it stands",
            row="{robot}",
            columns={
                f"{speed}, {size}": where(share("stands"), speed=speed, size=size)
                for size in SIZES
                for speed in SPEEDS
            },
            note="Impulse over mass, m/s.",
        )
    ],
    only="robots",
    draw=_draw,
)
