"""A walk over ground that is known, and no plane."""

import numpy as np

from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.swinging import PEAK
from harpy_pin.ground.surface import TerrainRecord, greatest_rise
from harpy_pin.model.record import Records


def walk_over(walk: Records[WalkingRecord], terrain: Records[TerrainRecord], reach: float) -> bool:
    """Let a walk go over a terrain, whose plane the body follows in a square to ``reach`` on each
    side.

    Where that is no plane, steps last as long as lifting a foot takes. Returns whether the targets
    of swing feet have world heights: those of points, on ground that is no plane.
    """
    w, build, pace, steps = (walk[part] for part in ("tuned", "build", "pace", "steps"))
    walk["terrain"], pace["ground_reach"] = terrain, reach
    uneven = bool(terrain["pieces"][0] or terrain["cells"][0, 2])
    if not uneven or build["soles"][0]:
        return False
    both = pace["fast_double_support"]
    pace["steps_over"] = pace["slow_load_ramp"] = pace["fast_load_ramp"] = 1
    pace["slow_double_support"] = steps["double_support"] = both
    farthest = float(w["longest_way"][0] * build["height"][0])
    height = float(pace["clearance"][0]) + greatest_rise(terrain, farthest)
    rising = float(np.sqrt(PEAK * height / w["lift_acceleration"][0]))
    least = rising / float(w["apex"][0] * (1.0 - both[0]))
    pace["usual_step"] = steps["duration"] = max(least, float(pace["usual_step"][0]))
    return True
