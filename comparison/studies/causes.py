"""Find what fells the condensed WBC in others' models.

Torques alone, in models that have one of dry friction, damping and armature in the joints, round
feet, their own steps and pyramids as friction cones; then in the whole model, with what the
controller may know or the motors may do. Random commands at friction 0.8 and 0.3. Then commands
that last, at up to 0.8 of a robot's largest speed, with the motor law that learns nothing of the
joints, without one property at a time. "peers --install" installs the models. This takes many
minutes.
"""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from comparison.studies.worlds import LASTING, SPEED, fast_walks, random_walk
from comparison.study import Job, Rows, Study, View, grouped
from comparison.worlds.models import FEET, JOINTS, PLAYGROUND, PROPERTIES, ROBOTS, world
from comparison.worlds.walk import LAW, LAW_CONTACT_DAMPING, MOTOR_LAW, walked
from harpy_pin import WalkingGait
from harpy_pin.view.palette import SLIDING

UNTOLD: dict[str, Any] = {"round": False}
CASES: dict[str, tuple[tuple[str, ...] | None, dict[str, Any]]] = {
    "nothing": ((), UNTOLD),
    **{name: ((name,), UNTOLD) for name in PROPERTIES},
    "all, as in the file": (None, UNTOLD),
    "radius of the feet": (None, {}),
    "and friction estimated": (None, {"estimate": True}),
    "and dry friction": (None, {"known": ["friction"]}),
    "and damping": (None, {"known": ["damping"]}),
    "and armature": (None, {"known": ["armature"]}),
    "and all joints": (None, {"known": list(JOINTS)}),
    "and contact damping 20": (None, {"contact_damping": LAW_CONTACT_DAMPING}),
    "and motor damping": (None, {"law": (0.0, LAW[1]), "contact_damping": LAW_CONTACT_DAMPING}),
    "and motor law": (None, MOTOR_LAW),
    "motor law, armature": (None, {"known": ["armature"], **MOTOR_LAW}),
    "motor law, all joints": (None, {"known": list(JOINTS), **MOTOR_LAW}),
}
"""What is kept of a model (None: all), and what the condensed WBC is given; by the name of the
row.
"""
_UNLEARNED: dict[str, Any] = {**MOTOR_LAW, "learning": 0.0}
AT_SPEED: dict[str, tuple[tuple[str, ...] | None, dict[str, Any]]] = {
    "nothing learned": (None, _UNLEARNED),
    **{
        f"without {gone}": (tuple(name for name in PROPERTIES if name != gone), _UNLEARNED)
        for gone in PROPERTIES
    },
    "armature known": (None, {"known": ["armature"], **_UNLEARNED}),
    "four times as stiff": (None, {**_UNLEARNED, "law": tuple(4.0 * gain for gain in LAW)}),
    "learned": (None, MOTOR_LAW),
}
"""The same with the motor law, for commands that last."""
CAUSES = len(PROPERTIES) + 2
"""The first so many are causes, the rest remedies."""


def _jobs(s: Any) -> Iterator[Job]:
    for name in s.worlds:
        robot = world(name, FEET)[1]
        drawn = [
            random_walk(s.seed, number, friction, s.duration)
            for friction in SPEED
            for number in range(s.sequences)
        ]
        fast = fast_walks(WalkingGait(robot).max_speed, s.lasting) if s.lasting else ()
        lasting = [walk for walk in fast if walk["what"] == LASTING[0]]
        here = {"world": name, "feet": list(FEET)}
        for cases, walks in ((CASES, drawn), (AT_SPEED, lasting)):
            for (case, (kept, who)), walk in product(cases.items(), walks):
                yield {**here, "case": case, **walk, "kept": kept, "who": who}


def _cell(rows: Rows) -> str:
    """Median slip of what stands, and the falls."""
    standing = [row["slip_mm_s"] for row in rows if not row["fell"]]
    fallen = len(rows) - len(standing)
    slip = f"{np.median(standing):.0f}" if standing else "–"
    return f"{slip}, {fallen} of {len(rows)}" if fallen else slip


def _view(name: str, title: str, cases: list[str]) -> View:
    return View(
        name,
        title,
        row="{case}",
        across="{world}",
        columns=_cell,
        note="Slip, mm/s, median over the walks that stand, and how many fall.",
        only=lambda row: row["case"] in cases,
    )


def _draw(figure: Any, rows: Rows) -> None:
    """A row for each cause and remedy, a column for each world: slip, and which share of the walks
    falls.
    """
    from matplotlib.colors import LinearSegmentedColormap

    cells, worlds = (
        grouped(rows, "case", "world"),
        list(dict.fromkeys(row["world"] for row in rows)),
    )
    figure.set_size_inches(8.4, 7.0)
    parts = list(CASES)[:CAUSES], list(CASES)[CAUSES:]
    panels = figure.subplots(2, 1, sharex=True, height_ratios=[len(part) for part in parts])
    colours = LinearSegmentedColormap.from_list("falls", ["#ffffff", SLIDING])
    for panel, part, title in zip(
        panels, parts, ("only this is on", "all is on, and the WBC is given"), strict=True
    ):
        shares = [
            [np.mean([row["fell"] for row in cells[case, name]]) for name in worlds]
            for case in part
        ]
        panel.pcolormesh(
            np.array(shares, dtype=float), cmap=colours, vmin=0.0, vmax=1.5, edgecolor="#d9dee4"
        )
        for y, case in enumerate(part):
            for x, name in enumerate(worlds):
                panel.text(x + 0.5, y + 0.5, _cell(cells[case, name]), ha="center", va="center")
        panel.set_yticks(np.arange(len(part)) + 0.5, part)
        panel.set_xticks(np.arange(len(worlds)) + 0.5, [name.replace(" ", "\n") for name in worlds])
        panel.set_title(title, fontsize=9, loc="left")
        panel.tick_params(length=0)
        panel.invert_yaxis()


STUDY = Study(
    name="causes",
    help=__doc__,
    example="--out causes.jsonl --figure causes.png",
    defaults={
        "worlds": (*ROBOTS, PLAYGROUND),
        "sequences": 4,  # of random commands, at each friction
        "duration": 8.0,  # s
        "lasting": 10,  # of a command that lasts, s
        "seed": 2000,
    },
    quick={"worlds": ("Mini Cheetah",), "sequences": 1, "duration": 2.0, "lasting": 0},
    options={
        "sequences": "Sequences of random commands at each friction.",
        "lasting": "Seconds of each walk with a command that lasts; 0: none.",
    },
    jobs=_jobs,
    measure=walked,
    views=[
        _view(
            "causes", "Torque alone, with one property of the model at a time", list(CASES)[:CAUSES]
        ),
        _view(
            "remedies",
            "All properties, with what the condensed WBC is given",
            list(CASES)[CAUSES - 1 :],
        ),
        _view(
            "speed",
            "Motor law and commands that last, at up to 0.8 of the largest speed",
            list(AT_SPEED),
        ),
    ],
    only="worlds",
    draw=_draw,
)
