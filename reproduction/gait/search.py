"""What the search for a planar gait varies and what it minimises (equations.md §3, row "gait
optimisation").
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import HarpyError, InputError
from harpy_pin.ground.ground import Ground
from harpy_pin.log.measures import Measures, measure
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector
from harpy_pin.scenario import Governed, Scenario, walk
from reproduction.gait.planar_gait import PlanarGait
from reproduction.gait.planar_model import PlanarModel
from reproduction.gait.planar_walk import PlanarSummary, PlanarWalk
from reproduction.gait.spatial import SpatialGait

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
OVERLAP: Bounds = {
    "double_support": (0.0, 0.88),
    "half_step": (0.01, 0.23),
    "swing_mid_height": (0.3, 0.6),
    "load_x": (-0.15, 0.15),
    "push_x": (-0.15, 0.15),
}

SEARCHES: dict[str, Bounds] = {
    "paper": PAPER,
    "place": {**PAPER, **PLACE, "start_pitch": START["start_pitch"]},
    "start": {**PAPER, **START, "end_height": PLACE["end_height"]},
    "middle": {**PAPER, **PLACE, **START, **MIDDLE},
    "ends": {**PAPER, **PLACE, **START, **MIDDLE, **ENDS, "swing_mid_height": (0.4, 0.6)},
    "overlap": {**PAPER, **PLACE, **START, **MIDDLE, **ENDS, **OVERLAP},
}
"""Sets of numbers to vary, with their bounds. ``paper`` is what the paper prints; ``middle`` and
all before it keep its P1 = P0 and P3 = P4; ``ends`` frees the feet's velocities at both ends;
``overlap`` adds a planned double support and the wider bounds that it needs.
"""

SPEED_MARGIN, HEIGHT_MARGIN, PITCH_MARGIN = 0.01, 0.02, 0.12
"""Deviations of the mean speed, m/s, and at any time of the height, m, and of the pitch, rad, that
cost nothing.
"""
VARIATION_WEIGHT = 20.0
"""Per rad of :attr:`PlanarSummary.variation`: a walk whose steps are alike is likely stable."""
WORST = 20.0
"""Bound on the paper's cost: a walk that falls at once must not drown the others."""
PROMISING, NOT_ASKED = 5.0, 100.0
"""Planar cost under which the further cost is asked for, and what stands in for it above."""
MIN_OF_FALLS = 30.0
"""No walk that stays up costs more, none that falls less."""


@dataclass(frozen=True, kw_only=True)
class PlanarTask(checks.Checked):
    """A planar walk to be found: how it is run and judged.

    A walk that falls costs 30 and 60 times the share of the time that the fall took away; one that
    does not costs the paper's average plus what lies outside the desired bounds, slip, and steps
    that differ.
    """

    model: PlanarModel  # the robot in the plane
    search: str = checks.setting("middle", checks.one_of, valid=SEARCHES)  # one of :data:`SEARCHES`
    # numbers of the gait that do not vary, where they are not the defaults
    fixed: Mapping[str, float] = field(default_factory=dict)
    duration: float = checks.setting(15.0, low=0.0, strict=True)  # of each trial walk, s
    # static friction coefficients of the grounds that a gait has to walk on; the worst one counts
    friction: tuple[float, ...] = (0.25,)
    slip_weight: float = checks.setting(0.05, low=0.0)  # per mm of slip per step beyond 1 mm
    # a further cost of a gait, such as that of its walk in space; asked only for gaits that cost
    # less than 5 in the
    # plane, all others cost 100 more
    extra: Callable[[PlanarGait], float] | None = None
    extra_name: str = ""  # what it is, kept in the record

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.friction:
            raise InputError(
                "the search needs a friction coefficient", name="friction", value=self.friction
            )
        for mu in self.friction:
            checks.number("friction", mu, low=0.0, high=checks.MAX_FRICTION, strict=True)
        PlanarGait.from_dict(dict(self.fixed))

    @cached_property
    def grounds(self) -> tuple[Ground, ...]:
        """The grounds of the trial walks."""
        return tuple(Ground(mu_s=mu) for mu in self.friction)

    @property
    def bounds(self) -> Bounds:
        """Numbers that vary, with their bounds."""
        return SEARCHES[self.search]

    def point(self, gait: PlanarGait) -> Vector:
        """Point of the unit cube of a gait, moved inside where it lies beyond a bound.

        Args:
            gait: to be searched around.
        """
        numbers = gait.as_dict()
        place = [(numbers[name] - low) / (high - low) for name, (low, high) in self.bounds.items()]
        return np.clip(place, 0.005, 0.995)

    def gait(self, x: Vector) -> PlanarGait:
        """The gait at a point of the unit cube, one coordinate per number that varies.

        Args:
            x: (numbers that vary,) each from 0 to 1.
        """
        numbers = {
            name: low + (high - low) * float(u)
            for u, (name, (low, high)) in zip(x, self.bounds.items(), strict=True)
        }
        return PlanarGait(**{**self.fixed, **numbers})

    def walk(self, gait: PlanarGait) -> list[PlanarSummary]:
        """One trial walk on each ground.

        Args:
            gait: to be walked.
        """
        return [
            PlanarWalk(self.model, gait, ground=ground).run(self.duration)
            for ground in self.grounds
        ]

    def evaluate(self, gait: PlanarGait) -> float:
        """Cost of a gait: that of its worst trial walk, and the further cost where there is one.

        Args:
            gait: to be judged.
        """
        cost = max(self.cost(summary, gait) for summary in self.walk(gait))
        if self.extra is None:
            return cost
        return cost + (self.extra(gait) if cost < PROMISING else NOT_ASKED)

    def cost(self, summary: PlanarSummary, gait: PlanarGait) -> float:
        """Cost of one trial walk.

        Args:
            summary: of the trial walk.
            gait: that was walked.
        """
        s = summary
        paper = min(s.paper_cost, WORST) if s.steps > 0.4 else WORST
        if s.fell:
            return MIN_OF_FALLS + 60.0 * max(1.0 - s.duration / self.duration, 0.0) + paper
        outside = (
            50.0 * max(abs(s.speed - gait.speed) - SPEED_MARGIN, 0.0)
            + 50.0 * max(gait.height - HEIGHT_MARGIN - s.height_min, 0.0)
            + 50.0 * max(s.height_max - gait.height - HEIGHT_MARGIN, 0.0)
            + 20.0 * max(s.pitch_max - PITCH_MARGIN, 0.0)
        )
        slip = self.slip_weight * max(s.slip - 1.0, 0.0)
        return min(paper + outside + slip + VARIATION_WEIGHT * min(s.variation, 0.5), MIN_OF_FALLS)


@dataclass(frozen=True, kw_only=True)
class SpaceCost(checks.Checked):
    """Slip of the governed walk in space that a planar gait gives, in mm, and what lies outside the
    desired bounds.
    """

    robot: Robot  # Harpy
    width: float = checks.setting(0.125, low=0.0)  # lateral distance of each foot from the path, m
    # static friction coefficient
    friction: float = checks.setting(0.25, low=0.0, high=checks.MAX_FRICTION, strict=True)
    duration: float = checks.setting(6.0, low=0.0, strict=True)  # of the walk, s

    @property
    def name(self) -> str:
        """What the cost is, for the record of a search."""
        return (
            f"governed walk, width {self.width:g} m, friction {self.friction:g}, "
            f"{self.duration:g} s"
        )

    def walk(self, planar: PlanarGait) -> Measures:
        """Measures of the governed walk.

        Raises:
            HarpyError: the gait cannot be walked in space.
        """
        gait = SpatialGait(
            self.robot, planar, width=self.width, reference="planar", friction=self.friction
        )
        ground = Ground(mu_s=self.friction)
        return measure(
            walk(Scenario(controller=Governed(), ground=ground, duration=self.duration), gait=gait)
        )

    def __call__(self, planar: PlanarGait) -> float:
        """Late slip and a quarter of all slip, in mm per step, and penalties on speed, pitch and
        normal force.
        """
        try:
            m = self.walk(planar)
        except HarpyError:
            return 100.0
        if m.ending != "completed":
            return 60.0 + 10.0 * (self.duration - m.duration_s)
        return (
            m.late_slip_mm_per_step
            + 0.25 * m.slip_mm_per_step
            + 400.0 * max(abs(m.distance_m / m.duration_s - planar.speed) - 0.012, 0.0)
            + 20.0 * max(m.pitch_max_rad - 0.12, 0.0)
            + 50.0 * max(m.low_force - 0.003, 0.0)
        )
