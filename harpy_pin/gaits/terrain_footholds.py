"""Feet of a gait of flat ground that are set beside edges: the foothold is moved to the nearest place that carries.

It is for gaits that walk along x at a constant speed: of these it is known where a foot in the air will land. A foot
goes over to its new foothold in the course of its swing, and stays as far beside the gait's own while it carries.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.gaits.carrying_places import place_that_carries
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.gaits.straight import StraightGait
from harpy_pin.model.record import Records

if TYPE_CHECKING:
    from harpy_pin.gaits.terrain_record import OnTerrainRecord

__all__: list[str] = []


def know_footholds(record: Records[OnTerrainRecord], gait: object) -> None:
    """Write down where the feet of a gait land, if it is one that walks straight on.

    Args:
        record: of the gait on terrain.
        gait: of flat ground.
    """
    if type(gait) is not StraightGait or gait.standing:
        return
    ahead, aside = gait.swing_curve[-1, :2]
    record["swing_time"] = gait.step_duration * (1.0 - gait.double_support)
    record["landing"][0] = (ahead, aside), (ahead, -aside)


@kernel
def note_time(p: OnTerrainRecord, t: float) -> None:
    """At time zero, and where the clock has gone back by more than a swing, every foot is where the gait says.

    Args:
        p: element of the record.
        t: of the present update, s.
    """
    if t <= 0.0 or t < p.time - p.swing_time:
        p.aside[:] = 0.0
        p.next_aside[:] = 0.0
        p.moving[:] = 0.0
    p.time = t


@kernel
def beside_edges(p: OnTerrainRecord, g: GaitTargetRecord, k: int, o: GaitTargetRecord) -> None:
    """Move the target of a foot along the ground.

    Args:
        p: element of the record.
        g: the gait's targets on flat ground.
        k: the foot.
        o: out, a copy of these.
    """
    if p.swing_time == 0.0:
        return
    if g.stance[k] != 0.0:
        if p.moving[k] != 0.0:
            p.moving[k] = 0.0
            p.aside[k] = p.next_aside[k]
        for i in range(2):
            o.foot_position[k, i] += p.aside[k, i]
        return
    u = g.phase[k]
    if p.moving[k] == 0.0:
        p.moving[k] = 1.0
        x = g.body[0] + g.body[3] * (1.0 - u) * p.swing_time + p.landing[k, 0]
        y = p.landing[k, 1]
        at = place_that_carries(p.terrain, x, y, x, y)
        p.next_aside[k, 0], p.next_aside[k, 1] = at[0] - x, at[1] - y
    rate = 1.0 / p.swing_time
    share = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
    speed = 30.0 * u * u * (1.0 - u) * (1.0 - u) * rate
    bend = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) * rate * rate
    for i in range(2):
        way = p.next_aside[k, i] - p.aside[k, i]
        o.foot_position[k, i] += p.aside[k, i] + share * way
        o.foot_velocity[k, i] += speed * way
        o.foot_acceleration[k, i] += bend * way
