"""A tick of the walk: from the measured state to the targets of body and feet."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.gaits.gait import LONGEST
from harpy_pin.gaits.walking.body import demand_acceleration, write_targets
from harpy_pin.gaits.walking.commanding import choose_velocity, steer, take_command
from harpy_pin.gaits.walking.contacts import go_on, time_left
from harpy_pin.gaits.walking.footholds import choose_footholds
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.gaits.walking.swinging import swing_foot

if TYPE_CHECKING:
    from harpy_pin.gaits.gait import GaitTargetRecord

__all__: list[str] = []

LONGEST_GAP = 0.05
"""Time that counts between two updates, at most, s."""
LONG_AGO = 1e3
"""Time since the last touchdown of a foot that has not yet swung, s."""


@kernel
def advance(t: float, p: WalkingRecord, target: GaitTargetRecord) -> bool:
    """All targets at the time t, from the state that was measured last.

    Time zero, or one that is more than a step before the last, begins the walk anew; one that is less before it counts
    as the last. Returns False, with nothing done, where t is no time or the next row of the script begins before it.
    """
    if not (abs(t) < LONGEST and t < p.switch):
        return False
    if t <= 0.0 or p.time < 0.0 or t < p.time - p.usual_step:
        _restart(p)
        p.time = t
    span = min(max(t - p.time, 0.0), LONGEST_GAP)
    p.time = max(t, p.time)
    take_command(p)
    steer(p, span)
    choose_velocity(p)
    go_on(p, span)
    demand_acceleration(p)
    if p.walking:
        left = time_left(p)
        choose_footholds(p, left)
        for k in range(p.group.shape[0]):
            if p.in_air[k] != 0.0:
                swing_foot(p, k, left if p.group[k] == p.swings else 0.0, span)
    write_targets(p, target)
    return True


@kernel
def _restart(p: WalkingRecord) -> None:
    """Stand where the robot is."""
    m = p.measured
    p.path[0], p.path[1], p.path[2] = m.centre[0], m.centre[1], m.heading
    p.last_command[:] = 0.0
    p.velocity[:] = 0.0
    p.rate[:] = 0.0
    p.raised = p.refused = p.phase = 0.0
    p.walking = p.steps = p.swings = 0
    p.in_air[:] = 0.0
    p.felt[:] = 0.0
    p.touched[:] = 0.0
    p.settled[:] = 1.0
    p.since[:] = LONG_AGO
