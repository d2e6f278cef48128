"""Which walks a campaign consists of: every contender walks the same scenarios."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import harpy_pin
from harpy_pin import checks
from harpy_pin.control.named import GOVERNORS
from harpy_pin.model.robot import harpy_urdf
from harpy_pin.plant.run import describe_versions

__all__ = ["SCHEMA", "CampaignSettings", "Task", "code_digest", "contenders", "plan"]

SCHEMA = 2
"""Version of the rows' meaning; raise it when a measure or the way a walk is done changes."""


@dataclass(frozen=True, kw_only=True)
class CampaignSettings:
    """How large the campaign is and what it varies.

    Each scenario draws one level of every factor, each level of a factor equally often; a longer campaign contains a
    shorter one of the same seed.

    Attributes:
        walks: in total, rounded up to whole scenarios (each is walked by every contender).
        duration: of a walk, s.
        seed: of the scenarios.
        frictions: static friction coefficients of the ground.
        pushes: lateral impulses in mid-stance, N·s; their side and step are drawn.
        mass_errors: relative errors of the body's mass: the simulated body has 1 + error times the mass (and
            inertia) that the controller believes.
        friction_errors: relative errors of the coefficient that the controller assumes.
        noises: scales of the measurement noise (:meth:`harpy_pin.plant.sensors.Noise.typical`).
        delays: ages of the measurements, s.
        jitter: standard deviation of the walk's starting velocity along x and y, m/s.
    """

    walks: int = 360
    duration: float = 5.0
    seed: int = 0
    frictions: tuple[float, ...] = (0.15, 0.2, 0.25, 0.4, 0.6, 0.8)
    pushes: tuple[float, ...] = (0.0, 1.0, 2.0, 3.5, 5.0)
    mass_errors: tuple[float, ...] = (-0.2, 0.0, 0.2)
    friction_errors: tuple[float, ...] = (-0.3, 0.0, 0.3)
    noises: tuple[float, ...] = (0.0,)
    delays: tuple[float, ...] = (0.0,)
    jitter: float = 0.01

    def __post_init__(self) -> None:
        checks.number("walks", self.walks, low=1.0, high=1e6)
        checks.ticks(checks.number("duration", self.duration, low=1.5), 1e-3)
        checks.number("seed", self.seed, low=0.0)
        for value in self.frictions:
            checks.number("friction", value, low=0.0)
        for value in self.pushes:
            checks.number("push", value, low=0.0)
        for name, values in (("mass error", self.mass_errors), ("friction error", self.friction_errors)):
            for value in values:
                checks.number(name, value, low=-1.0, strict=True)
        for name, values in (("noise", self.noises), ("delay", self.delays)):
            for value in values:
                checks.number(name, value, low=0.0)
        checks.number("jitter", self.jitter, low=0.0)

    @classmethod
    def quick(cls, **changes: Any) -> CampaignSettings:
        """Fewer and shorter walks: to see whether it works, not to quote."""
        return cls(**{"walks": 54, "duration": 2.5, **changes})

    @classmethod
    def hard(cls, **changes: Any) -> CampaignSettings:
        """Wider ranges, with noise and delay, from a seed of its own: nothing was tuned on these scenarios."""
        levels: dict[str, Any] = {
            "walks": 1200,
            "seed": 20211,
            "frictions": (0.12, 0.15, 0.2, 0.3, 0.5, 0.8),
            "pushes": (0.0, 2.0, 4.0, 6.0, 8.0),
            "mass_errors": (-0.25, -0.1, 0.1, 0.25),
            "friction_errors": (-0.2, 0.0, 0.2),
            "noises": (0.0, 0.5, 1.0),
            "delays": (0.0, 1e-3, 2e-3),
        }
        return cls(**{**levels, **changes})


@dataclass(frozen=True, kw_only=True)
class Task:
    """One walk, wholly determined by its fields.

    Attributes:
        controller: ``governed`` or ``wbc``.
        governor: of the governed controller; empty for the other.
        friction: of the ground.
        push: lateral impulse, N·s.
        mass_error: relative, of the simulated body.
        friction_error: relative, of what the controller assumes.
        noise: scale of the measurement noise.
        delay: age of the measurements, s.
        jitter: standard deviation of the starting velocity, m/s.
        seed: draws the push's side and step, the starting velocity and the noise.
        duration: s.
    """

    controller: str
    governor: str
    friction: float
    push: float
    mass_error: float
    friction_error: float
    noise: float
    delay: float
    jitter: float
    seed: int
    duration: float

    @property
    def contender(self) -> str:
        """Controller and governor as one name."""
        return f"{self.controller}/{self.governor}" if self.governor else self.controller

    def key(self, code: str) -> str:
        """Identifies the walk: hash of its fields, the schema and the code that does it (see :func:`code_digest`)."""
        text = json.dumps({"schema": SCHEMA, "code": code, **asdict(self)}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:24]


def contenders() -> list[tuple[str, str]]:
    """Controllers and governors to compare, in the order in which they are shown."""
    return [*(("governed", name) for name in GOVERNORS), ("explicit", ""), ("wbc", "")]


def plan(settings: CampaignSettings) -> list[Task]:
    """All walks of a campaign, scenario by scenario."""
    names = contenders()
    scenarios = -(-settings.walks // len(names))
    rng = np.random.default_rng([settings.seed, SCHEMA])
    # One generator per factor: how many levels one factor has does not change the order of another.
    s = settings
    factors = (s.frictions, s.pushes, s.mass_errors, s.friction_errors, s.noises, s.delays)
    streams = rng.spawn(len(factors))
    drawn = [_balanced(levels, scenarios, stream) for levels, stream in zip(factors, streams, strict=True)]
    tasks = []
    for i, (friction, push, mass_error, friction_error, noise, delay) in enumerate(zip(*drawn, strict=True)):
        task = Task(
            controller="",
            governor="",
            friction=friction,
            push=push,
            mass_error=mass_error,
            friction_error=friction_error,
            noise=noise,
            delay=delay,
            jitter=settings.jitter,
            seed=1000 * settings.seed + i,
            duration=settings.duration,
        )
        tasks += [replace(task, controller=controller, governor=governor) for controller, governor in names]
    return tasks


def _balanced(levels: tuple[float, ...], count: int, rng: np.random.Generator) -> list[float]:
    """Shuffled rounds of all levels, cut off at a count."""
    drawn: list[float] = []
    while len(drawn) < count:
        drawn += [float(levels[i]) for i in rng.permutation(len(levels))]
    return drawn[:count]


@cache
def code_digest() -> str:
    """Hash of everything that decides the outcome of a walk: this code, the library, the robot, the versions used.

    Rows of other code are never mixed with today's; a campaign is resumed only by the code that began it.
    """
    total = hashlib.sha256()
    package = Path(harpy_pin.__file__).parent
    for folder in (package, Path(__file__).parent):
        for path in sorted(folder.rglob("*.py")):
            if "view" not in path.relative_to(folder).parts:
                total.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    total.update(harpy_urdf().read_bytes())
    versions = {k: v for k, v in describe_versions().items() if k != "machine"}
    total.update(json.dumps(versions, sort_keys=True, default=str).encode())
    return total.hexdigest()[:24]
