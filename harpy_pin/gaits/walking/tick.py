"""A tick of the walk: from the measured state to the targets of body and feet."""

from __future__ import annotations

from harpy_pin.gaits.gait import LONGEST, GaitTargetRecord
from harpy_pin.gaits.walking.contacts import begin_on_all_feet, go_on, time_left
from harpy_pin.gaits.walking.demand import demand_acceleration
from harpy_pin.gaits.walking.footholds import choose_footholds
from harpy_pin.gaits.walking.measuring import measure_drift
from harpy_pin.gaits.walking.path import begin_path, follow_command
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.rolling import stay_flat
from harpy_pin.gaits.walking.swinging import swing_foot
from harpy_pin.gaits.walking.targets import write_targets
from harpy_pin.kernels import kernel

LONGEST_GAP = 0.05
"""Time that counts between two updates, at most, s."""


@kernel
def advance(t: float, p: WalkingRecord, target: GaitTargetRecord) -> bool:
    """All targets at the time t, from the state that was measured last.

    Time zero, or one that is more than a step before the last, begins the walk anew; one that is
    less before it counts as the last. Returns False, with nothing done, where t is no time, the
    next row of the script begins before it, or a script has to begin anew, too.
    """
    begun = p.time >= 0.0
    anew = not begun or t <= 0.0 or t < p.time - p.pace.usual_step
    script_behind = anew and begun and p.planned.scripted != 0
    if script_behind or not (abs(t) < LONGEST and t < p.planned.switch):
        return False
    if anew:
        begin_walk(p, t)
    span = t - p.time
    p.time = max(t, p.time)
    walk_on(p, target, span)
    return True


@kernel
def begin_walk(p: WalkingRecord, t: float) -> None:
    """Stand where the robot is, on all feet, at the time t."""
    p.time = t
    begin_path(p)
    begin_on_all_feet(p)
    stay_flat(p)
    measure_drift(p)  # it was measured on the feet that were down in the walk before


@kernel
def walk_on(p: WalkingRecord, target: GaitTargetRecord, elapsed: float) -> None:
    """All targets, after a time since the last ones, s."""
    span = min(max(elapsed, 0.0), LONGEST_GAP)
    follow_command(p, span)
    go_on(p, span)
    demand_acceleration(p)
    if p.steps.walking:
        left = time_left(p)
        choose_footholds(p, left)
        for k in range(p.pace.group.shape[0]):
            if p.steps.in_air[k] != 0.0:
                swing_foot(p, k, left if p.pace.group[k] == p.steps.swings else 0.0, span)
    write_targets(p, target)
