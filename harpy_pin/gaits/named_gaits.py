"""The gaits that come with the package, by name."""

from __future__ import annotations

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.gaits.planar.gait_file import PAPER_CURVES_GAIT, SPACE_GAIT, load_gait
from harpy_pin.gaits.spatial import SpatialGait
from harpy_pin.gaits.straight import TUNED_STIFFNESS, StraightGait, make_gait
from harpy_pin.model.robot import Robot

__all__ = ["GAITS", "make_named_gait"]

GAITS = ("hand", "optimised", "paper-curves")
"""``hand``: a walk of few parameters, tuned for little slip, any speed. ``optimised``: a planar gait that walks without
thrust, refined for the governed walk in space. ``paper-curves``: one with the paper's own curve shape, P1 = P0 and
P3 = P4, found for friction 0.8, in space as the paper prints it: feet at ±0.15 m, the body's target at constant speed
and height."""


def make_named_gait(robot: Robot, name: str, *, speed: float = 0.3, stiffness: float = TUNED_STIFFNESS) -> StraightGait:
    """A gait in space by name; at speed zero all of them stand.

    Args:
        robot: a biped of Harpy's kind.
        name: one of :data:`GAITS`.
        speed: along x, m/s; the found gaits have one speed, 0.3 m/s.
        stiffness: of the ground that the walk is for, N/m; the found gaits were found on 8 kN/m and do not change.

    Raises:
        InputError: unknown name, or a speed that the gait does not have.
    """
    checks.one_of("gait", name, GAITS)
    if name == "hand" or speed == 0.0:
        return make_gait(robot, speed=speed, stiffness=stiffness)
    planar = load_gait(PAPER_CURVES_GAIT if name == "paper-curves" else SPACE_GAIT).gait
    if speed != planar.speed:
        raise InputError(
            f"the gait '{name}' was found for {planar.speed:g} m/s, not {speed:g}", name="speed", value=speed
        )
    if name == "paper-curves":
        return SpatialGait(robot, planar, width=0.15, reference="constant")
    return SpatialGait(robot, planar, width=0.125, reference="planar")
