"""How large a campaign is, and what it varies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from comparison.contenders import CONTENDERS, ESTIMATES, FORCES, HARSH, TUNED
from harpy_pin import checks
from harpy_pin.scenario import Compliant, Mujoco, PlantPart, Straight
from harpy_pin.simulation.ground import Ground

__all__ = ["FACTORS", "JOINT_DAMPING", "KINDS", "CampaignSettings"]

JOINT_DAMPING = 0.1
"""Of every joint of the packaged robot, N·m·s/rad; the authors' own model has 5."""

ENGINES: dict[str, PlantPart] = {"compliant": Compliant(), "mujoco": Mujoco(), "mujoco default": Mujoco("default")}
"""In which walks are walked; the last one has MuJoCo's default contact, whatever the ground's stiffness."""

FACTORS = {
    "friction": "frictions",
    "push": "pushes",
    "mass_error": "mass_errors",
    "friction_error": "friction_errors",
    "noise": "noises",
    "delay": "delays",
    "stiffness": "stiffnesses",
    "damping": "dampings",
    "plant": "plants",
    "speed": "speeds",
    "ice": "ices",
    "joint_damping": "joint_dampings",
    "torque_share": "torque_shares",
    "bandwidth": "bandwidths",
}
"""What a scenario draws: the attribute of a task, and that of the settings which holds its levels.

A further factor comes last: each draws from the generator of its place, so that earlier ones are drawn as before.
"""

_ERRORS = ("mass_errors", "friction_errors")
_POSITIVE = ("stiffnesses", "speeds")
_MOST = 1e6
"""Largest level of any factor, in its own unit."""


@dataclass(frozen=True, kw_only=True)
class CampaignSettings:
    """How large the campaign is and what it varies.

    Each scenario draws one level of every factor, each level of a factor equally often; a longer campaign contains a
    shorter one of the same seed.

    Attributes:
        walks: in total, rounded up to whole scenarios (each is walked by every contender).
        duration: of a walk, s.
        seed: of the scenarios.
        contenders: who walks them, see :mod:`comparison.contenders`.
        frictions: static friction coefficients of the ground.
        pushes: lateral impulses in mid-stance, N·s; their side and step are drawn.
        mass_errors: relative errors of the body's mass: the simulated body has 1 + error times the mass (and
            inertia) that the controller believes.
        friction_errors: relative errors of the coefficient that the controller assumes.
        noises: scales of the measurement noise (:meth:`harpy_pin.simulation.sensors.Noise.typical`).
        delays: ages of the measurements, s.
        stiffnesses: of the ground, N/m, known to the walk.
        dampings: of the ground, in multiples of that of the paper's damping ratio.
        plants: engines, of :data:`ENGINES`.
        speeds: of the walk, m/s.
        ices: friction coefficients of a strip in mid-walk that the controller knows nothing of; 0 is no strip. A
            level that is given twice is drawn twice as often.
        joint_dampings: of every joint, N·m·s/rad, known to the controllers.
        torque_shares: largest torques of the motors, as shares of the peak torque, for all controllers; at 0 the plant
            clips nothing, and only whole-body controllers have limits.
        bandwidths: of the motors, Hz; 0 is no lag.
        jitter: standard deviation of the walk's starting velocity along x and y, m/s.
    """

    walks: int = 420
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
        for factor, levels in FACTORS.items():
            for value in getattr(self, levels):
                if factor == "plant":
                    checks.one_of("plant", value, ENGINES)
                else:
                    least, strict = -1.0 if levels in _ERRORS else 0.0, levels in (*_ERRORS, *_POSITIVE)
                    checks.number(factor.replace("_", " "), value, low=least, high=_MOST, strict=strict)
        checks.number("jitter", self.jitter, low=0.0)

    @classmethod
    def quick(cls, **changes: Any) -> CampaignSettings:
        """Fewer and shorter walks: to see whether it works, not to quote."""
        return cls(**{"walks": 63, "duration": 2.5, **changes})

    @classmethod
    def hard(cls, **changes: Any) -> CampaignSettings:
        """Wider ranges, with noise and delay, from a seed of its own: nothing was tuned on these scenarios."""
        levels: dict[str, Any] = {
            "walks": 1600,
            "seed": 20211,
            "contenders": (*CONTENDERS, FORCES),
            "frictions": (0.12, 0.15, 0.2, 0.3, 0.5, 0.8),
            "pushes": (0.0, 2.0, 4.0, 6.0, 8.0),
            "mass_errors": (-0.25, -0.1, 0.1, 0.25),
            "friction_errors": (-0.2, 0.0, 0.2),
            "noises": (0.0, 0.5, 1.0),
            "delays": (0.0, 1e-3, 2e-3),
        }
        return cls(**{**levels, **changes})

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
            "contenders": (*(name for name in CONTENDERS if name != "governed/cone"), *ESTIMATES),
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


KINDS: dict[str, Callable[..., CampaignSettings]] = {
    "plain": CampaignSettings,
    "quick": CampaignSettings.quick,
    "hard": CampaignSettings.hard,
    "wide": CampaignSettings.wide,
    "variants": CampaignSettings.variants,
    "harsh": CampaignSettings.harsh,
}
"""Campaigns by name."""
