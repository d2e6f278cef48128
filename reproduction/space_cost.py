"""What a planar gait is worth in space, under the paper's governor: a further cost for the gait's search."""

from __future__ import annotations

from dataclasses import dataclass

from harpy_pin import checks
from harpy_pin.errors import HarpyError
from harpy_pin.gaits.planar.planar_gait import PlanarGait
from harpy_pin.gaits.spatial import SpatialGait
from harpy_pin.log.measures import Measures, measure
from harpy_pin.model.robot import Robot
from harpy_pin.scenario import Governed, Scenario, walk
from harpy_pin.simulation.ground import Ground

__all__ = ["SpaceCost"]


@dataclass(frozen=True, kw_only=True)
class SpaceCost:
    """Slip of the governed walk in space that a planar gait gives, in mm, and what lies outside the desired bounds.

    Attributes:
        robot: Harpy.
        width: lateral distance of each foot from the path, m.
        friction: static friction coefficient.
        duration: of the walk, s.
    """

    robot: Robot
    width: float = 0.125
    friction: float = 0.25
    duration: float = 6.0

    def __post_init__(self) -> None:
        checks.number("width", self.width, low=0.0)
        checks.number("friction", self.friction, low=0.0, high=checks.MAX_FRICTION, strict=True)
        checks.number("duration", self.duration, low=0.0, strict=True)

    @property
    def name(self) -> str:
        """What the cost is, for the record of a search."""
        return f"governed walk, width {self.width:g} m, friction {self.friction:g}, {self.duration:g} s"

    def walk(self, planar: PlanarGait) -> Measures:
        """Measures of the governed walk.

        Raises:
            HarpyError: the gait cannot be walked in space.
        """
        gait = SpatialGait(self.robot, planar, width=self.width, reference="planar", friction=self.friction)
        ground = Ground(mu_s=self.friction)
        return measure(walk(Scenario(controller=Governed(), ground=ground, duration=self.duration), gait=gait))

    def __call__(self, planar: PlanarGait) -> float:
        """Late slip and a quarter of all slip, in mm per step, and penalties on speed, pitch and normal force."""
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
