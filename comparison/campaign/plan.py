"""How large a campaign is, what it varies, and its walks: every contender walks the same
scenarios.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

import harpy_pin
import harpy_pin as hp
from comparison.contenders import CONTENDERS, HARSH, TRUSTING, TUNED, TUNED_FILE
from harpy_pin import checks
from harpy_pin.log.run import describe_versions
from harpy_pin.simulation.mujoco import installed_version

WALKING = (
    "campaign/*.py",
    "measure/*.[pc]*",
    "joint_pd/*.py",
    "studies/*.py",
    "worlds/*.py",
    "contenders.py",
    "study.py",
)
"""What of the comparison decides the outcome of a walk."""
JOINT_DAMPING = 0.1
"""Of every joint of the packaged robot, N·m·s/rad; the authors' own model has 5."""

ENGINES: dict[str, hp.scenario.PlantPart] = {
    "compliant": hp.scenario.Compliant(),
    "mujoco": hp.Mujoco(),
    "mujoco default": hp.Mujoco("default"),
}
"""In which walks are walked; the last one has MuJoCo's default contact, whatever the ground's
stiffness.
"""


class Factor(NamedTuple):
    """What a scenario draws, under its name in a task."""

    levels: str  # attribute of the settings that holds its levels
    name: str  # for readers
    pattern: str  # of a level in a table, for a number times the scale
    usual: float | str | None  # the level at which nothing is unusual; None where there is none
    scale: float = 1.0  # by which a level is multiplied for readers
    zero: str = ""  # how a level of zero is written instead

    def text(self, key: str) -> str:
        """A level, from its key in the summary, with a word for its factor: ``push 2 N·s``."""
        if self.levels == "plants":
            return key.replace("mujoco", "MuJoCo") if "mujoco" in key else f"{key} engine"
        return (
            self.zero if self.zero and key == "0" else self.pattern.format(self.scale * float(key))
        )


FACTORS = {
    "friction": Factor("frictions", "friction of the ground", "μ {:g}", None),
    "push": Factor("pushes", "lateral push", "push {:g} N·s", 0.0),
    "mass_error": Factor("mass_errors", "error of the body's mass", "mass {:+.0f} %", 0.0, 100.0),
    "friction_error": Factor(
        "friction_errors", "error of the assumed friction", "μ error {:+.0f} %", 0.0, 100.0
    ),
    "noise": Factor("noises", "measurement noise", "noise × {:g}", 0.0),
    "delay": Factor("delays", "delay of the measurements", "delay {:g} ms", 0.0, 1e3),
    "stiffness": Factor(
        "stiffnesses", "stiffness of the ground", "ground {:g} kN/m", hp.Ground.stiffness, 1e-3
    ),
    "damping": Factor("dampings", "damping of the ground", "damping × {:g}", 1.0),
    "plant": Factor("plants", "engine", "", hp.scenario.Compliant.name),
    "speed": Factor("speeds", "speed", "speed {:g} m/s", hp.Straight().speed),
    "ice": Factor("ices", "strip of ice", "ice, μ {:g}", 0.0, zero="no ice"),
    "joint_damping": Factor(
        "joint_dampings", "damping of the joints", "joint damping {:g}", JOINT_DAMPING
    ),
    "torque_share": Factor(
        "torque_shares",
        "torque limits of the motors",
        "torque × {:g}",
        1.0,
        zero="torque unclipped",
    ),
    "bandwidth": Factor(
        "bandwidths", "bandwidth of the motors", "motors {:g} Hz", 0.0, zero="motors without lag"
    ),
}
"""A further factor comes last: each draws from the generator of its place, so that earlier ones are
drawn as before.
"""

_ERRORS = ("mass_error", "friction_error")
_POSITIVE = ("stiffness", "speed")
_MOST = 1e6
"""Largest level of any factor, in its own unit."""


def level_key(level: float | str) -> str:
    """A level as a key of the summary."""
    return level if isinstance(level, str) else f"{level:g}"


@dataclass(frozen=True, kw_only=True)
class CampaignSettings(checks.Checked):
    """How large the campaign is and what it varies.

    Each scenario draws one level of every factor, each level of a factor equally often; one that is
    given twice is drawn twice as often. A longer campaign contains a shorter one of the same seed.
    What the levels are is said at :class:`~comparison.campaign.plan.Task`.
    """

    # in total, rounded up to whole scenarios (each is walked by every contender)
    walks: int = checks.setting(420, checks.whole, low=1, high=1_000_000)
    duration: float = checks.setting(5.0, low=1.5)  # of a walk, s
    seed: int = checks.setting(0, checks.whole)  # of the scenarios
    contenders: tuple[str, ...] = CONTENDERS  # who walks them, see :mod:`comparison.contenders`
    frictions: tuple[float, ...] = (0.15, 0.2, 0.25, 0.4, 0.6, 0.8)
    pushes: tuple[float, ...] = (0.0, 1.0, 2.0, 3.5, 5.0)
    mass_errors: tuple[float, ...] = (-0.2, 0.0, 0.2)
    friction_errors: tuple[float, ...] = (-0.3, 0.0, 0.3)
    noises: tuple[float, ...] = (0.0,)
    delays: tuple[float, ...] = (0.0,)
    stiffnesses: tuple[float, ...] = (hp.Ground.stiffness,)
    dampings: tuple[float, ...] = (1.0,)
    plants: tuple[str, ...] = (hp.scenario.Compliant.name,)
    speeds: tuple[float, ...] = (hp.Straight().speed,)
    ices: tuple[float, ...] = (0.0,)
    joint_dampings: tuple[float, ...] = (JOINT_DAMPING,)
    torque_shares: tuple[float, ...] = (0.0,)
    bandwidths: tuple[float, ...] = (0.0,)
    # standard deviation of the walk's starting velocity along x and y, m/s
    jitter: float = checks.setting(0.01, low=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.ticks(self.duration, 1e-3)
        for name in self.contenders:
            checks.one_of("contender", name, (*CONTENDERS, *TRUSTING, *TUNED))
        for name, factor in FACTORS.items():
            for value in getattr(self, factor.levels):
                if name == "plant":
                    checks.one_of("plant", value, ENGINES)
                else:
                    least, strict = -1.0 if name in _ERRORS else 0.0, name in (*_ERRORS, *_POSITIVE)
                    checks.number(
                        name.replace("_", " "), value, low=least, high=_MOST, strict=strict
                    )

    @classmethod
    def of(cls, kind: str, **changes: Any) -> CampaignSettings:
        """Those of a campaign of :data:`KINDS`, with changes."""
        return cls(**KINDS[kind] | changes)


_WIDE: dict[str, Any] = {
    "walks": 210 * (len(CONTENDERS) + len(TRUSTING)),
    "seed": 40427,
    "contenders": (*CONTENDERS, *TRUSTING),
    "frictions": (0.12, 0.17, 0.22, 0.35, 0.55, 0.8),
    "pushes": (0.0, 2.0, 4.0, 6.0, 8.0),
    "mass_errors": (-0.25, -0.12, 0.0, 0.12, 0.25),
    "friction_errors": (-0.3, -0.15, 0.0, 0.15, 0.3),
    "noises": (0.0, 0.5, 1.0),
    "delays": (0.0, 1e-3, 2e-3),
    "stiffnesses": (4e3, 8e3, 16e3, 40e3, 80e3),
    "dampings": (0.5, 1.0, 2.0),
    "plants": ("compliant", "mujoco"),
    "speeds": (0.2, 0.35, 0.5),
    "ices": (0.0, 0.0, 0.15),
}
_HARSH: dict[str, Any] = {
    "walks": 210 * len(HARSH),
    "seed": 71993,
    "contenders": HARSH,
    "plants": tuple(ENGINES),
    "joint_dampings": (JOINT_DAMPING, JOINT_DAMPING, 0.01, 1.0, 5.0),
    "torque_shares": (1.0, 1.0, 1.0, 0.7, 0.5, 0.3),
    "bandwidths": (0.0, 0.0, 0.0, 200.0, 50.0, 20.0),
}
KINDS: dict[str, dict[str, Any]] = {
    "plain": {},
    "wide": _WIDE,
    "variants": _WIDE | {"walks": 210 * len(TUNED), "contenders": TUNED},
    "harsh": _WIDE | _HARSH,
}
"""Campaigns by name: settings that differ from the plain one's.

In the wide one everything varies, ground, engine and speed as well, from a seed of its own. Its
levels keep apart from those that settings are known to have been chosen on, but for the default
ground and walks without any error or push. With 210 scenarios every level of
every factor is drawn equally often. The same scenarios are walked by every tuned variant with
published and with found settings. The harsh one varies the motors and has MuJoCo's default contact,
too, from its own seed: torques are clipped to the same limits for all, and what it adds is as usual
in about half of the scenarios.
"""

QUICK: dict[str, Any] = {"walks": 63, "duration": 2.5}
"""Fewer and shorter walks of any kind: to see whether it works, not to quote."""

_DRAWING = 2
"""Version of how scenarios are drawn; part of the generators' seed, so that raising it draws other
ones.
"""

_Level = TypeVar("_Level")


@dataclass(frozen=True, kw_only=True)
class Task:
    """One walk, wholly determined by its fields."""

    contender: str  # who walks, see :mod:`comparison.contenders`
    friction: float  # static coefficient of the ground
    push: float  # lateral impulse in mid-stance, N·s
    # relative: the simulated body has 1 + error times the mass (and inertia) that is believed
    mass_error: float
    friction_error: float  # relative, of what the controller assumes
    noise: (
        float  # scale of the measurement noise (:meth:`harpy_pin.simulation.sensors.Noise.typical`)
    )
    delay: float  # age of the measurements, s
    stiffness: float  # of the ground, N/m, known to the walk
    damping: float  # of the ground, in multiples of that of the paper's damping ratio
    plant: str  # the engine, of :data:`~comparison.campaign.plan.ENGINES`
    speed: float  # m/s
    # friction coefficient of a strip in mid-walk that no controller knows of; 0 where there is none
    ice: float
    joint_damping: float = JOINT_DAMPING  # of every joint, N·m·s/rad, known to the controllers
    # of the peak torque, largest of the motors, known to the controllers; 0 clips nothing
    torque_share: float = 0.0
    bandwidth: float = 0.0  # of the motors, Hz, not known; 0 where torques are there at once
    jitter: float  # standard deviation of the starting velocity, m/s
    seed: int  # draws the push's side and step, the starting velocity and the noise
    duration: float  # s

    def key(self, code: str) -> str:
        """Identifies the walk: hash of its fields and of the code that does it (see
        :func:`code_digest`).
        """
        text = json.dumps({"code": code, **asdict(self)}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:24]


def plan(settings: CampaignSettings) -> list[Task]:
    """All walks of a campaign, scenario by scenario."""
    scenarios = -(-settings.walks // len(settings.contenders))
    # One generator per factor: how many levels one factor has does not change the order of another.
    streams = np.random.default_rng([settings.seed, _DRAWING]).spawn(len(FACTORS))
    levels = [getattr(settings, factor.levels) for factor in FACTORS.values()]
    drawn = [
        _balanced(some, scenarios, stream) for some, stream in zip(levels, streams, strict=True)
    ]
    tasks, same = [], {"jitter": settings.jitter, "duration": settings.duration}
    for i, scenario in enumerate(zip(*drawn, strict=True)):
        factors: dict[str, Any] = dict(
            zip(FACTORS, scenario, strict=True), seed=1000 * settings.seed + i, **same
        )
        tasks += [Task(contender=name, **factors) for name in settings.contenders]
    return tasks


def _balanced(levels: Sequence[_Level], count: int, rng: np.random.Generator) -> list[_Level]:
    """Shuffled rounds of all levels, cut off at a count."""
    rounds = -(-count // len(levels))
    return [levels[i] for _ in range(rounds) for i in rng.permutation(len(levels))][:count]


def code_files() -> dict[str, Path]:
    """The files of source that decide the outcome of a walk, by their path in the repository."""
    found: dict[str, Path] = {}
    for folder, patterns in (
        (Path(harpy_pin.__file__).parent, ("**/*.py", "**/*.c")),
        (Path(__file__).parents[1], WALKING),
    ):
        paths = [path for pattern in patterns for path in folder.glob(pattern)]
        found |= {path.relative_to(folder.parent).as_posix(): path for path in paths}
    return {name: path for name, path in found.items() if not name.startswith("harpy_pin/view/")}


@cache
def code_digest() -> str:
    """Hash of everything that decides the outcome of a walk: :func:`code_files`, the robot, the
    versions used.

    Rows of other code are never mixed with today's; a campaign is resumed only by the code that
    began it.
    """
    total = hashlib.sha256()
    for name, path in sorted(code_files().items()):
        total.update(name.encode() + b"\0" + path.read_bytes())
    total.update(hp.model.harpy_urdf().read_bytes() + TUNED_FILE.read_bytes())
    versions = {k: v for k, v in describe_versions().items() if k != "machine"} | {
        "mujoco": installed_version()
    }
    total.update(json.dumps(versions, sort_keys=True, default=str).encode())
    return total.hexdigest()[:24]
