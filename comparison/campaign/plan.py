"""Which walks a campaign consists of: every contender walks the same scenarios."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import harpy_pin
from comparison.campaign.settings import FACTORS, JOINT_DAMPING, CampaignSettings
from comparison.tuning.variants import TUNED_FILE
from harpy_pin.log.run import describe_versions
from harpy_pin.model.robot import harpy_urdf
from harpy_pin.simulation.mujoco import installed_version

SCHEMA = 4
"""Version of the rows' meaning; raise it when a measure or the way a walk is done changes."""

_DRAWING = 2
"""Version of how scenarios are drawn; part of the generators' seed, so that raising it draws other ones."""

_Level = TypeVar("_Level")


@dataclass(frozen=True, kw_only=True)
class Task:
    """One walk, wholly determined by its fields.

    Attributes:
        contender: who walks, see :mod:`comparison.contenders`.
        friction: static coefficient of the ground.
        push: lateral impulse in mid-stance, N·s.
        mass_error: relative: the simulated body has 1 + error times the mass (and inertia) that is believed.
        friction_error: relative, of what the controller assumes.
        noise: scale of the measurement noise (:meth:`harpy_pin.simulation.sensors.Noise.typical`).
        delay: age of the measurements, s.
        stiffness: of the ground, N/m, known to the walk.
        damping: of the ground, in multiples of that of the paper's damping ratio.
        plant: the engine, of :data:`~comparison.campaign.settings.ENGINES`.
        speed: m/s.
        ice: friction coefficient of a strip in mid-walk that the controller knows nothing of; 0 where there is none.
        joint_damping: of every joint, N·m·s/rad, known to the controllers.
        torque_share: the motors' largest torque, as a share of the peak torque, known to the controllers; 0 where the
            plant clips nothing, and the governed controllers do not either.
        bandwidth: of the motors, Hz, not known; 0 where torques are there at once.
        jitter: standard deviation of the starting velocity, m/s.
        seed: draws the push's side and step, the starting velocity and the noise.
        duration: s.
    """

    contender: str
    friction: float
    push: float
    mass_error: float
    friction_error: float
    noise: float
    delay: float
    stiffness: float
    damping: float
    plant: str
    speed: float
    ice: float
    joint_damping: float = JOINT_DAMPING
    torque_share: float = 0.0
    bandwidth: float = 0.0
    jitter: float
    seed: int
    duration: float

    def key(self, code: str) -> str:
        """Identifies the walk: hash of its fields, the schema and the code that does it (see :func:`code_digest`)."""
        text = json.dumps({"schema": SCHEMA, "code": code, **asdict(self)}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:24]


def plan(settings: CampaignSettings) -> list[Task]:
    """All walks of a campaign, scenario by scenario."""
    scenarios = -(-settings.walks // len(settings.contenders))
    # One generator per factor: how many levels one factor has does not change the order of another.
    streams = np.random.default_rng([settings.seed, _DRAWING]).spawn(len(FACTORS))
    levels = [getattr(settings, factor.levels) for factor in FACTORS.values()]
    drawn = [_balanced(some, scenarios, stream) for some, stream in zip(levels, streams, strict=True)]
    tasks = []
    for i, scenario in enumerate(zip(*drawn, strict=True)):
        factors: dict[str, Any] = dict(zip(FACTORS, scenario, strict=True))
        seed = 1000 * settings.seed + i
        task = Task(contender="", jitter=settings.jitter, seed=seed, duration=settings.duration, **factors)
        tasks += [replace(task, contender=name) for name in settings.contenders]
    return tasks


def _balanced(levels: Sequence[_Level], count: int, rng: np.random.Generator) -> list[_Level]:
    """Shuffled rounds of all levels, cut off at a count."""
    rounds = -(-count // len(levels))
    return [levels[i] for _ in range(rounds) for i in rng.permutation(len(levels))][:count]


@cache
def code_digest() -> str:
    """Hash of everything that decides the outcome of a walk: this code, the library, the robot, the versions used.

    Rows of other code are never mixed with today's; a campaign is resumed only by the code that began it.
    """
    total = hashlib.sha256()
    for folder in (Path(harpy_pin.__file__).parent, Path(__file__).parent):
        for path in sorted(folder.rglob("*.py")):
            if "view" not in path.relative_to(folder).parts:
                total.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    total.update(harpy_urdf().read_bytes() + TUNED_FILE.read_bytes())
    versions = {k: v for k, v in describe_versions().items() if k != "machine"} | {"mujoco": installed_version()}
    total.update(json.dumps(versions, sort_keys=True, default=str).encode())
    return total.hexdigest()[:24]
