"""Swing feet over ground that is not even: first up, then across what is higher, then down; in world heights.

A foot that moved across while it is still rising would meet the riser of a step that it stands before.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.gaits.walking.commanding import wrapped
from harpy_pin.gaits.walking.pendulum import toward
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.ground.surface import TerrainRecord, greatest_rise, surface_height
from harpy_pin.model.record import Records

__all__: list[str] = []

UP, ACROSS, THERE, DOWN, LANDED = 0.4, 0.2, 0.7, 0.5, 0.9
"""Shares of its swing at which a foot is at its highest, begins to move across and ends to, begins to sink, and is at
the ground."""
LEAST = 0.1
"""Share of its swing that a foot has at least for what is left of a phase."""
DESCENT = 0.3
"""Velocity at which a foot goes on down that has not met the ground in time, m/s."""
DEEPEST = 0.25
"""How far below the ground it is searched for, as a share of the body's height."""
FARTHEST = 0.68
"""Way of a foot in a step, on which it steps over what is higher, in heights of the body."""
PLACES = 8
"""On the way of a foot whose heights are looked at."""
LIFT = 80.0
"""Largest acceleration of a foot on its way up, m/s²."""
PEAK = 5.7735
"""Largest acceleration of a motion from rest to rest, in its way over its squared duration."""


@kernel
def swing_over(p: WalkingRecord, k: int, left: float, span: float) -> None:
    """Bring swing foot k to the present time, ``span`` after the last update and ``left`` before it should land."""
    swing, duration = p.swing[k], (1.0 - p.double_support) * p.step_duration
    u = 1.0 - left / duration
    if u >= ACROSS:
        rest = max(THERE - u, 0.0) * duration + span
        for i in range(3):
            goal = p.foothold[k, i]
            if i == 2:
                goal = swing[0, 2] + wrapped(goal - swing[0, 2])
            swing[0, i], swing[1, i], swing[2, i] = toward(swing[0, i], swing[1, i], swing[2, i], goal, rest, span)
    z, ground = p.lift[k], surface_height(p.terrain, p.foothold[k, 0], p.foothold[k, 1])
    if u >= 1.0:
        z[0] = max(z[0] - DESCENT * span, ground - DEEPEST * p.height)
        z[1], z[2] = -DESCENT, 0.0
        return
    goal, end = ground - p.penetration_offset, 1.0
    if u < DOWN:
        p.risen[k] = max(p.risen[k], highest_on_way(p, k) + p.clearance)
        goal, end = p.risen[k], UP
    elif u < LANDED:
        goal, end = ground, LANDED
    z[0], z[1], z[2] = toward(z[0], z[1], z[2], goal, max(end - u, LEAST) * duration + span, span)


@kernel
def highest_on_way(p: WalkingRecord, k: int) -> float:
    """Greatest height of the ground between a foot and its foothold, m."""
    x, y = p.swing[k, 0, 0], p.swing[k, 0, 1]
    highest = surface_height(p.terrain, x, y)
    for i in range(1, PLACES + 1):
        share = i / PLACES
        dx, dy = share * (p.foothold[k, 0] - x), share * (p.foothold[k, 1] - y)
        highest = max(highest, surface_height(p.terrain, x + dx, y + dy))
    return float(highest)


def walk_over(walk: Records[WalkingRecord], terrain: Records[TerrainRecord], reach: float) -> bool:
    """Let a walk go over a terrain, whose plane the body follows in a square to ``reach`` on each side.

    Where that is no plane, steps last as long as lifting a foot takes. Returns whether the targets of swing feet have
    world heights: those of points, on ground that is no plane.
    """
    walk["terrain"], walk["ground_reach"] = terrain, reach
    uneven = bool(terrain["pieces"][0] or terrain["cells"][0, 2])
    if not uneven or walk["soles"][0]:
        return False
    walk["steps_over"] = 1
    walk["slow_double_support"] = walk["double_support"] = walk["fast_double_support"]
    walk["slow_load_ramp"] = walk["fast_load_ramp"] = 1.0
    height = float(walk["clearance"][0]) + greatest_rise(terrain, FARTHEST * float(walk["height"][0]))
    least = float(np.sqrt(PEAK * height / LIFT)) / (UP * (1.0 - float(walk["double_support"][0])))
    walk["usual_step"] = max(least, float(walk["usual_step"][0]))
    walk["step_duration"] = walk["usual_step"]
    return True
