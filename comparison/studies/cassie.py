"""Walk Cassie in MuJoCo Menagerie's own model, whose springs are alive.

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
import pinocchio as pin

import harpy_pin as hp
from comparison.studies.worlds import random_walk
from comparison.study import Job, Study, View, fell, median, most
from comparison.worlds.walk import followed
from harpy_pin.errors import InputError
from harpy_pin.model.mjcf_rods import WEIGHT
from harpy_pin.simulation.mujoco.conventions import import_mujoco

BASE, FEET = "cassie-pelvis", ("left-foot", "right-foot")
SOLES = ("left-sole", "right-sole")
EVERY = 2
"""Steps of MuJoCo's, of 0.5 ms, from tick to tick."""
LEVEL, LEVEL_RATE, CONTACT_DAMPING = 1.0, 40.0, 50.0
"""Weight, and rate, 1/s, at which feet come back level and straight ahead, and the damping of held
feet, 1/s: of seven settings on seeds 100 to 103 those that slipped least.
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
    """MuJoCo's model, and the robot with a foot in the middle of the bar of each foot."""
    mujoco = import_mujoco()
    if not Path(mjcf).is_file():
        how = "git clone https://github.com/google-deepmind/mujoco_menagerie"
        raise InputError(f"'{mjcf}' is missing: {how}", name="mjcf", value=mjcf)
    spec = mujoco.MjSpec.from_file(mjcf)
    plain = spec.compile()
    data = mujoco.MjData(plain)
    mujoco.mj_resetDataKeyframe(plain, data, 0)
    mujoco.mj_kinematics(plain, data)
    for foot, sole in zip(FEET, SOLES, strict=True):
        body = plain.body(foot).id
        (bar,) = np.flatnonzero((plain.geom_bodyid == body) & (plain.geom_contype != 0))
        along, up = data.geom_xmat[bar].reshape(3, 3)[:, 2], np.array((0.0, 0.0, 1.0))
        ahead = along * np.sign(along[0])
        aside = np.cross(up, ahead) / np.linalg.norm(np.cross(up, ahead))
        own = data.xmat[body].reshape(3, 3).T
        level = own @ np.column_stack((ahead, aside, np.cross(ahead, aside)))
        turn = pin.Quaternion(level)
        spec.body(foot).add_site(
            name=sole,
            pos=plain.geom_pos[bar] - plain.geom_size[bar, 0] * level[:, 2],
            quat=(turn.w, turn.x, turn.y, turn.z),
        )
    model = spec.compile()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is held and left out: this module says so
        return model, hp.load_robot(model, feet=SOLES)


class Walker:
    """The condensed controller, with feet that stay level and straight ahead."""

    def __init__(self, model: Any, robot: hp.Robot, friction: float) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # points on legs of five joints
            self.gait = hp.WalkingGait(robot)
        self.bridge, self.force, self.bent = hp.MujocoBridge(model, robot), 0.0, 0.0
        self._springs = model.jnt_qposadr[model.jnt_stiffness > 0.0]
        self._controller = hp.make_controller(
            "condensed",
            self.gait,
            mu=SHARE * friction,
            period=EVERY * float(model.opt.timestep),
            contact_damping=CONTACT_DAMPING,
        )
        gains, weight = (LEVEL_RATE**2, 2.0 * LEVEL_RATE), (0.0, LEVEL, LEVEL)
        for sole in SOLES:
            how: dict[str, Any] = {"part": "orientation", "axes": "local", "rotation": np.eye(3)}
            self._controller.add(hp.FrameTask(sole, root=BASE, gains=gains, **how), weight=weight)

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
    return found | {"force": walker.force / WEIGHT / robot.mass, "bent": walker.bent}


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
    options={"mjcf": "The file, with level ground.", "seed": "Of commands, starts and pushes."},
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
