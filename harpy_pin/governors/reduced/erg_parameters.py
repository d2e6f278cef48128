"""Settings of the paper's governor on a walk."""

from __future__ import annotations

from dataclasses import dataclass

from harpy_pin import checks

__all__ = ["CONDITIONS", "PaperGovernorParameters"]

CONDITIONS = ("algorithm", "equation")
"""Conditions of the terms of the update: those of Algorithm 1, or those of the equations."""


@dataclass(frozen=True, kw_only=True)
class PaperGovernorParameters:
    """Settings of :class:`~harpy_pin.governors.ExplicitReferenceGovernor` on a walk; by default the paper's 3D run.

    Attributes:
        alpha_r: rate towards the target where it is allowed, 1/s.
        alpha_t: rate along the null space of the violated rows, 1/s.
        alpha_n: rate of the repair along the worst row, 1/s.
        conditions: ``algorithm`` or ``equation``, which differ (equations.md E8).
        friction_share: share of the assumed friction coefficient that the rows use; what is left is for errors.
        min_normal_force: least normal force of the row on it, N.
    """

    alpha_r: float = 10.0
    alpha_t: float = 15.0
    alpha_n: float = 20.0
    conditions: str = "algorithm"
    friction_share: float = 1.0
    min_normal_force: float = 20.0

    def __post_init__(self) -> None:
        checks.numbers(self, "alpha_r", "alpha_t", "alpha_n", "min_normal_force", low=0.0)
        checks.one_of("conditions", self.conditions, CONDITIONS)
        checks.number("friction_share", self.friction_share, low=0.0, high=1.0, strict=True)
