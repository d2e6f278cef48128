"""Walk Cassie in Menagerie's own model, springs alive.

The controller's model has closed loops, and springs that are held at rest; MuJoCo's has rods on
ball joints, springs in shins and heels, and damped joints without motors. The body begins with a
random velocity, commands are random, and it is pushed once. The file is in a clone of
google-deepmind/mujoco_menagerie.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterator
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.studies.worlds import random_walk
from comparison.study import Job, Study, View, fell, median, most
from comparison.worlds.walk import followed
from harpy_pin.errors import InputError
from harpy_pin.model.state import GRAVITY
from harpy_pin.simulation.mujoco.conventions import import_mujoco

FEET = ("left-foot", "right-foot")
EVERY = 2
"""Steps of MuJoCo's, of 0.5 ms, from tick to tick."""
CONTACT_DAMPING = 20.0
"""Of held feet, 1/s: of 20, 50 and 100 the one with which it fell least on seed 100, though feet
slip more.
"""
SHARE = 0.75
"""Share of the friction that the controller is told."""
UNIT = 0.5
"""Of the commands' speeds: up to 0.4 m/s at friction 0.8."""
ELLIPTIC, STIFFER = "elliptic cones", 50.0
STIFF = f"springs {STIFFER:g} times as stiff"
"""What is changed in the model, one at a time."""
START, PUSH = 0.05, 0.2
"""Standard deviation of the body's velocity at the start, m/s and rad/s, and impulse over mass of
the push, m/s.
"""


@cache
def cassie(mjcf: str) -> tuple[Any, hp.Robot]:
    """MuJoCo's model, and the robot, whose feet are the bars of the file."""
    if not Path(mjcf).is_file():
        how = "git clone https://github.com/google-deepmind/mujoco_menagerie"
        raise InputError(f"'{mjcf}' is missing: {how}", name="mjcf", value=mjcf)
    model = import_mujoco().MjModel.from_xml_path(mjcf)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is held and left out: this module says so
        return model, hp.load_robot(model, feet=FEET)


class Walker:
    """The condensed controller, at every other step of MuJoCo's."""

    def __init__(self, model: Any, robot: hp.Robot, friction: float) -> None:
        self.gait, self.bridge = hp.WalkingGait(robot), hp.MujocoBridge(model, robot)
        self.force = self.bent = 0.0
        self._springs = model.jnt_qposadr[model.jnt_stiffness > 0.0]
        self._controller = hp.make_controller(
            "condensed",
            self.gait,
            mu=SHARE * friction,
            period=EVERY * float(model.opt.timestep),
            contact_damping=CONTACT_DAMPING,
        )

    def act(self, data: Any, command: Any) -> None:
        """Write the commands of a tick into MuJoCo's data."""
        state = self.bridge.read(data)
        self.force = max(self.force, float(state.foot_force[:, 2].sum()))
        self.bent = max(self.bent, float(np.abs(data.qpos[self._springs]).max()))
        self.gait.command[:3] = command
        self.bridge.write(self._controller.step(state), data)


def _measured(job: Job) -> dict[str, Any]:
    mujoco = import_mujoco()
    plain, robot = cassie(job["mjcf"])
    model = copy.copy(plain)
    model.geom_friction[:, 0] = job["friction"]
    model.jnt_stiffness[:] *= STIFFER if job["model"] == STIFF else 1.0
    if job["model"] == ELLIPTIC:
        model.opt.cone, model.opt.impratio = 1, 100.0
    walker, data = Walker(model, robot, job["friction"]), mujoco.MjData(model)
    q, v = walker.gait.initial_state()
    v[:6] += START * np.random.default_rng([job["seed"], job["number"], 1]).normal(size=6)
    walker.bridge.place((q, v), data)
    mujoco.mj_forward(model, data)
    found = followed(job, walker.bridge, data, walker.act, EVERY)
    return found | {"force": walker.force / GRAVITY / robot.mass, "bent": walker.bent}


def _jobs(s: Any) -> Iterator[Job]:
    for friction, kind, number in product(s.frictions, s.models, range(s.walks)):
        walk = random_walk(s.seed, number, friction, s.duration, UNIT)
        rng = np.random.default_rng([s.seed, number, 2])
        angle, time = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.3, 0.7) * s.duration
        push = [float(time), float(PUSH * np.cos(angle)), float(PUSH * np.sin(angle))]
        yield walk | {"push": push, "model": kind, "seed": s.seed, "mjcf": s.mjcf}


STUDY = Study(
    name="cassie",
    help=__doc__,
    example="--mjcf clones/mujoco_menagerie/agility_cassie/scene.xml --json cassie.json",
    defaults={
        "walks": 20,
        "frictions": (0.8, 0.3),
        "models": ("as it is", ELLIPTIC, STIFF),
        "duration": 10.0,  # s
        "seed": 1000,
        "mjcf": "out/clones/mujoco_menagerie/agility_cassie/scene.xml",
    },
    quick={"walks": 1, "duration": 2.0},
    options={"mjcf": "The file, with level ground."},
    jobs=_jobs,
    measure=_measured,
    views=[
        View(
            "cassie",
            "Cassie in Menagerie's model",
            "friction {friction:g}, {model}",
            {
                "fell": fell,
                "slip": (median("slip_mm_s"), "mm/s"),
                "landing": (median("landing_mm_s"), "mm/s"),
                "lifting": (median("lifting_mm_s"), "mm/s"),
                "speed error": (median("error_m_s"), "m/s"),
                "largest force": (most("force"), "weights"),
                "springs bent": (most("bent"), "rad"),
            },
            note="Slip of both feet together; their force as MuJoCo has it, in any one tick.",
        )
    ],
)
