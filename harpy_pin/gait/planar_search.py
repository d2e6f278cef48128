"""What the search for a planar gait varies and what it minimises (READING.md §3, row "gait optimisation")."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gait.planar_gait import PlanarGait
from harpy_pin.gait.planar_model import PlanarModel
from harpy_pin.gait.planar_walk import PlanarSummary, PlanarWalk
from harpy_pin.ground import Ground
from harpy_pin.state import Vector

__all__ = ["SEARCHES", "PlanarTask"]

Bounds = Mapping[str, tuple[float, float]]

PAPER: Bounds = {
    "half_step": (0.01, 0.2),
    "swing_mid_height": (0.45, 0.55),
    "stance_mid_height": (0.55, 0.7),
}
PLACE: Bounds = {"end_height": (0.57, 0.64), "offset": (-0.08, 0.08)}
START: Bounds = {
    "start_vx": (-0.2, 0.8),
    "start_vz": (-0.2, 0.2),
    "start_pitch": (-0.15, 0.15),
    "start_pitch_rate": (-1.0, 1.0),
}
MIDDLE: Bounds = {"swing_mid_x": (-0.15, 0.15), "stance_mid_x": (-0.15, 0.15)}
ENDS: Bounds = {
    "lift_x": (-0.12, 0.12),
    "lift_z": (-0.05, 0.1),
    "land_x": (-0.12, 0.12),
    "land_z": (-0.1, 0.05),
    "load_x": (-0.12, 0.12),
    "load_z": (-0.05, 0.05),
    "push_x": (-0.12, 0.12),
    "push_z": (-0.05, 0.05),
}
FEEDBACK: Bounds = {
    "stance_pitch": (-2.0, 2.0),
    "stance_pitch_rate": (-0.3, 0.3),
    "swing_pitch": (-2.0, 2.0),
    "swing_pitch_rate": (-0.3, 0.3),
}
OVERLAP: Bounds = {"double_support": (0.0, 0.6)}

SEARCHES: dict[str, Bounds] = {
    "paper": PAPER,
    "place": {**PAPER, **PLACE, "start_pitch": START["start_pitch"]},
    "start": {**PAPER, **START, "end_height": PLACE["end_height"]},
    "middle": {**PAPER, **PLACE, **START, **MIDDLE},
    "ends": {**PAPER, **PLACE, **START, **MIDDLE, **ENDS, "swing_mid_height": (0.4, 0.6)},
    "overlap": {**PAPER, **PLACE, **START, **MIDDLE, **ENDS, **OVERLAP, "swing_mid_height": (0.4, 0.6)},
    "feedback": {**PAPER, **PLACE, **START, **MIDDLE, **FEEDBACK},
}
"""Sets of numbers to vary, with their bounds. ``paper`` is what the paper prints; ``middle`` and all before it keep
its P1 = P0 and P3 = P4; ``ends`` frees the feet's velocities at both ends; ``overlap`` adds a planned double support;
``feedback`` adds pitch feedback in the legs to ``middle``."""

WORST = 20.0
"""Bound on the paper's cost: a walk that falls at once must not drown the others."""


@dataclass(frozen=True, kw_only=True)
class PlanarTask:
    """A planar walk to be found: how it is run and judged.

    The cost is the paper's, averaged over the walk, plus 30 times the share of the time that a fall took away, plus
    what lies outside the wanted bounds, plus slip.

    Attributes:
        model: the robot in the plane.
        search: one of :data:`SEARCHES`.
        fixed: numbers of the gait that do not vary, where they are not the defaults.
        duration: of each trial walk, s.
        friction: static friction coefficient of the ground.
        speed_margin: deviation of the mean speed that costs nothing, m/s; 50 per m/s beyond.
        height_margin: deviation of the height at any time that costs nothing, m; 50 per m beyond.
        pitch_margin: pitch at any time that costs nothing, rad; 20 per rad beyond.
        slip_weight: per mm of slip per step beyond 1 mm.
    """

    model: PlanarModel
    search: str = "middle"
    fixed: Mapping[str, float] = field(default_factory=dict)
    duration: float = 15.0
    friction: float = 0.8
    speed_margin: float = 0.02
    height_margin: float = 0.02
    pitch_margin: float = 0.13
    slip_weight: float = 0.03

    def __post_init__(self) -> None:
        if self.search not in SEARCHES:
            raise InputError.unknown("search", self.search, SEARCHES)
        for name in ("duration", "friction", "speed_margin", "height_margin", "pitch_margin", "slip_weight"):
            checks.number(name, getattr(self, name), low=0.0, strict=name in ("duration", "friction"))
        PlanarGait.from_dict(dict(self.fixed))

    @cached_property
    def ground(self) -> Ground:
        """The ground of the trial walks."""
        return Ground(mu_s=self.friction)

    @property
    def bounds(self) -> Bounds:
        """Numbers that vary, with their bounds."""
        return SEARCHES[self.search]

    def gait(self, x: Vector) -> PlanarGait:
        """The gait at a point of the unit cube, one coordinate per number that varies."""
        numbers = {
            name: low + (high - low) * float(u) for u, (name, (low, high)) in zip(x, self.bounds.items(), strict=True)
        }
        return PlanarGait(**{**self.fixed, **numbers})

    def walk(self, gait: PlanarGait) -> PlanarSummary:
        """One trial walk."""
        return PlanarWalk(self.model, gait, ground=self.ground).run(self.duration)

    def cost(self, summary: PlanarSummary, gait: PlanarGait) -> float:
        """What the search minimises."""
        s = summary
        missing = max(1.0 - s.duration / self.duration, 0.0)
        outside = (
            50.0 * max(abs(s.speed - gait.speed) - self.speed_margin, 0.0)
            + 50.0 * max(gait.height - self.height_margin - s.height_min, 0.0)
            + 50.0 * max(s.height_max - gait.height - self.height_margin, 0.0)
            + 20.0 * max(s.pitch_max - self.pitch_margin, 0.0)
        )
        slip = self.slip_weight * max(s.slip - 1.0, 0.0)
        paper = min(s.paper_cost, WORST) if s.steps > 0.4 else WORST
        return paper + 30.0 * missing + outside + slip
