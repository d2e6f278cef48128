"""Walk every controller on Harpy as it is built.

Beside it is the paper's open chain. The robot as it is built has a rod that closes each leg, and a
heavier body. Its thrusters are fixed and push in any direction here, as the paper's do. The
controllers know the friction; gains and settings are those of the open chain.
"""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.contenders import WALKERS, label
from comparison.measure.walking import as_far_as_it_goes
from comparison.studies.slip import how_far, slip_of
from comparison.study import Job, Study, View, grid, scenario_of
from harpy_pin.gaits.straight import GaitParameters, StraightGait, penetration_offset_on
from harpy_pin.model.catalogue import CATALOGUE, own_urdf

ROBOTS = ("open chain", "as built")
HEIGHT, WIDTH = 0.5, 0.13
"""Of the walk on the robot as it is built, which stands lower, m."""


@cache
def built_harpy() -> hp.Robot:
    """Harpy as it is built, with fixed thrusters that push in any direction."""
    text, known = own_urdf("harpy_built.urdf").read_text(), CATALOGUE["harpy_built"]
    for side in ("left", "right"):
        joint = f'<joint name="{side}_tilt" type='
        text = text.replace(f'{joint}"revolute">', f'{joint}"fixed">')
    with TemporaryDirectory() as folder:
        path = Path(folder) / "fixed_fans.urdf"
        path.write_text(text)
        return hp.load_robot(
            path,
            feet=known.feet,
            thrusters=tuple(rotor.frame for rotor in known.rotors),
            thrust_limit=53.0,
            loops=known.loops,
            posture=np.zeros(6),
        )


def built_gait(robot: str, speed: float) -> StraightGait:
    """The straight walk of a robot of :data:`ROBOTS`."""
    given = hp.load_harpy() if robot == ROBOTS[0] else built_harpy()
    place = {} if robot == ROBOTS[0] else {"height": HEIGHT, "width": WIDTH}
    offset = penetration_offset_on(given, hp.Ground().stiffness)
    return StraightGait(given, GaitParameters(speed=speed, penetration_offset=offset, **place))


def _measured(job: Job) -> dict[str, Any]:
    scenario = scenario_of(job["walker"], job["friction"], duration=job["duration"])
    gait = built_gait(job["robot"], job["speed"])
    return how_far(as_far_as_it_goes(partial(hp.walk, scenario, gait=gait)))


STUDY = Study(
    name="built",
    help=__doc__,
    defaults={
        "walkers": WALKERS,
        "robots": ROBOTS,
        "frictions": (0.8, 0.5, 0.25, 0.2, 0.15),
        "speed": 0.2,  # m/s
        "duration": 12.0,  # s
    },
    quick={"duration": 1.5},
    jobs=lambda s: grid(
        robot=s.robots, friction=s.frictions, walker=s.walkers, speed=s.speed, duration=s.duration
    ),
    measure=_measured,
    views=[
        View(
            lambda row: "built" if row["robot"] == ROBOTS[1] else "open",
            "Slip per step, {robot}, in walks of {duration:g} s, mm",
            row=lambda row: label(row["walker"]),
            across="{friction:g}",
            columns=slip_of,
        )
    ],
)
