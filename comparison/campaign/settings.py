"""How large a campaign is, and what it varies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from comparison.contenders import CONTENDERS, ESTIMATES, FORCES, HARSH, TUNED
from harpy_pin import checks
from harpy_pin.ground.ground import Ground
from harpy_pin.scenario import Compliant, Mujoco, PlantPart, Straight

JOINT_DAMPING = 0.1
"""Of every joint of the packaged robot, N·m·s/rad; the authors' own model has 5."""

ENGINES: dict[str, PlantPart] = {"compliant": Compliant(), "mujoco": Mujoco(), "mujoco default": Mujoco("default")}
"""In which walks are walked; the last one has MuJoCo's default contact, whatever the ground's stiffness."""


class Factor(NamedTuple):
    """What a scenario draws, under its name in a task.

    Attributes:
        levels: attribute of the settings that holds its levels.
        name: for readers.
        pattern: of a level in a table, for a number times the scale.
        scale: by which a level is multiplied for readers.
        zero: how a level of zero is written instead.
    """

    levels: str
    name: str
    pattern: str
    scale: float = 1.0
    zero: str = ""

    def text(self, key: str) -> str:
        """A level, from its key in the summary, with a word for its factor: ``push 2 N·s``."""
        if self.levels == "plants":
            return key.replace("mujoco", "MuJoCo") if "mujoco" in key else f"{key} engine"
        return self.zero if self.zero and key == "0" else self.pattern.format(self.scale * float(key))


FACTORS = {
    "friction": Factor("frictions", "friction of the ground", "μ {:g}"),
    "push": Factor("pushes", "lateral push", "push {:g} N·s"),
    "mass_error": Factor("mass_errors", "error of the body's mass", "mass {:+.0f} %", 100.0),
    "friction_error": Factor("friction_errors", "error of the assumed friction", "μ error {:+.0f} %", 100.0),
    "noise": Factor("noises", "measurement noise", "noise × {:g}"),
    "delay": Factor("delays", "delay of the measurements", "delay {:g} ms", 1e3),
    "stiffness": Factor("stiffnesses", "stiffness of the ground", "ground {:g} kN/m", 1e-3),
    "damping": Factor("dampings", "damping of the ground", "damping × {:g}"),
    "plant": Factor("plants", "engine", ""),
    "speed": Factor("speeds", "speed", "speed {:g} m/s"),
    "ice": Factor("ices", "strip of ice", "ice, μ {:g}", zero="no ice"),
    "joint_damping": Factor("joint_dampings", "damping of the joints", "joint damping {:g}"),
    "torque_share": Factor("torque_shares", "torque limits of the motors", "torque × {:g}", zero="torque unclipped"),
    "bandwidth": Factor("bandwidths", "bandwidth of the motors", "motors {:g} Hz", zero="motors without lag"),
}
"""A further factor comes last: each draws from the generator of its place, so that earlier ones are drawn as before."""

_ERRORS = ("mass_error", "friction_error")
_POSITIVE = ("stiffness", "speed")
_MOST = 1e6
"""Largest level of any factor, in its own unit."""


def level_key(level: float | str) -> str:
    """A level as a key of the summary."""
    return level if isinstance(level, str) else f"{level:g}"


@dataclass(frozen=True, kw_only=True)
class CampaignSettings:
    """How large the campaign is and what it varies.

    Each scenario draws one level of every factor, each level of a factor equally often; one that is given twice is
    drawn twice as often. A longer campaign contains a shorter one of the same seed. What the levels are is said at
    :class:`~comparison.campaign.plan.Task`.

    Attributes:
        walks: in total, rounded up to whole scenarios (each is walked by every contender).
        duration: of a walk, s.
        seed: of the scenarios.
        contenders: who walks them, see :mod:`comparison.contenders`.
        jitter: standard deviation of the walk's starting velocity along x and y, m/s.
    """

    walks: int = 360
    duration: float = 5.0
    seed: int = 0
    contenders: tuple[str, ...] = CONTENDERS
    frictions: tuple[float, ...] = (0.15, 0.2, 0.25, 0.4, 0.6, 0.8)
    pushes: tuple[float, ...] = (0.0, 1.0, 2.0, 3.5, 5.0)
    mass_errors: tuple[float, ...] = (-0.2, 0.0, 0.2)
    friction_errors: tuple[float, ...] = (-0.3, 0.0, 0.3)
    noises: tuple[float, ...] = (0.0,)
    delays: tuple[float, ...] = (0.0,)
    stiffnesses: tuple[float, ...] = (Ground.stiffness,)
    dampings: tuple[float, ...] = (1.0,)
    plants: tuple[str, ...] = (Compliant.name,)
    speeds: tuple[float, ...] = (Straight().speed,)
    ices: tuple[float, ...] = (0.0,)
    joint_dampings: tuple[float, ...] = (JOINT_DAMPING,)
    torque_shares: tuple[float, ...] = (0.0,)
    bandwidths: tuple[float, ...] = (0.0,)
    jitter: float = 0.01

    def __post_init__(self) -> None:
        checks.number("walks", self.walks, low=1.0, high=1e6)
        checks.ticks(checks.number("duration", self.duration, low=1.5), 1e-3)
        checks.number("seed", self.seed, low=0.0)
        for name in self.contenders:
            checks.one_of("contender", name, (*CONTENDERS, FORCES, *ESTIMATES, *TUNED))
        for name, factor in FACTORS.items():
            for value in getattr(self, factor.levels):
                if name == "plant":
                    checks.one_of("plant", value, ENGINES)
                else:
                    least, strict = -1.0 if name in _ERRORS else 0.0, name in (*_ERRORS, *_POSITIVE)
                    checks.number(name.replace("_", " "), value, low=least, high=_MOST, strict=strict)
        checks.number("jitter", self.jitter, low=0.0)

    @classmethod
    def wide(cls, **changes: Any) -> CampaignSettings:
        """Everything varies, ground, engine and speed as well, from a seed of its own.

        Levels keep apart from those that settings are known to have been chosen on, but for the default ground and
        walks without any error or push (docs/simulation.md). With 210 scenarios every level of every factor is drawn
        equally often.
        """
        levels: dict[str, Any] = {
            "walks": 1680,
            "seed": 40427,
            "contenders": (*CONTENDERS, *ESTIMATES),
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
        return cls(**{**levels, **changes})

    @classmethod
    def harsh(cls, **changes: Any) -> CampaignSettings:
        """What the wide campaign varies, and the motors and MuJoCo's default contact, from a seed of its own.

        Torques are clipped to the same limits for all. What it adds is as usual in about half of the scenarios.
        """
        levels: dict[str, Any] = {
            "walks": 210 * len(HARSH),
            "seed": 71993,
            "contenders": HARSH,
            "plants": tuple(ENGINES),
            "joint_dampings": (JOINT_DAMPING, JOINT_DAMPING, 0.01, 1.0, 5.0),
            "torque_shares": (1.0, 1.0, 1.0, 0.7, 0.5, 0.3),
            "bandwidths": (0.0, 0.0, 0.0, 200.0, 50.0, 20.0),
        }
        return cls.wide(**{**levels, **changes})

    @classmethod
    def variants(cls, **changes: Any) -> CampaignSettings:
        """The scenarios of the wide campaign, walked by every tuned variant with published and with found settings."""
        return cls.wide(**{"walks": 210 * len(TUNED), "contenders": TUNED, **changes})


QUICK: dict[str, Any] = {"walks": 54, "duration": 2.5}
"""Fewer and shorter walks of any kind: to see whether it works, not to quote."""

KINDS: dict[str, Callable[..., CampaignSettings]] = {
    "plain": CampaignSettings,
    "wide": CampaignSettings.wide,
    "variants": CampaignSettings.variants,
    "harsh": CampaignSettings.harsh,
}
"""Campaigns by name."""
