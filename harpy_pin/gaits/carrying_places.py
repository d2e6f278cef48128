"""Places that carry a foot: away from edges, where the cone about the normal of a riser would carry nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harpy_pin.compiled import kernel
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.gaits.straight import StraightGait
from harpy_pin.ground.surface import TerrainRecord, surface_height
from harpy_pin.model.record import Records

if TYPE_CHECKING:
    from harpy_pin.gaits.terrain_record import OnTerrainRecord

__all__: list[str] = []

STEEP = 1.0
"""Rise per metre from which on ground carries no foot."""
MARGIN = 0.025
"""Distance that a foothold keeps from such ground, along x and y, m."""
RADIUS, SAMPLES = 0.152, 38
"""How far a foothold is moved at most in each of eight directions, m, and how many places are looked at."""


@kernel
def place_that_carries(t: TerrainRecord, x: float, y: float, before_x: float, before_y: float) -> tuple[float, float]:
    """A place, or the best one around it that carries a foot; the place itself where there is none.

    Args:
        t: element of the terrain's record.
        x: of the place, m.
        y: of the place, m.
        before_x: a place to which it should be near, too, m.
        before_y: its other coordinate, m.
    """
    if carries(t, x, y):
        return x, y
    best, best_x, best_y = 1e9, x, y
    for i in range(-1, 2):
        for j in range(-1, 2):
            for n in range(1, SAMPLES + 1):
                dx, dy = i * n * RADIUS / SAMPLES, j * n * RADIUS / SAMPLES
                jump_x, jump_y = x + dx - before_x, y + dy - before_y
                cost = dx * dx + dy * dy + jump_x * jump_x + jump_y * jump_y
                if cost < best and carries(t, x + dx, y + dy):
                    best, best_x, best_y = cost, x + dx, y + dy
    return best_x, best_y


@kernel
def carries(t: TerrainRecord, x: float, y: float) -> bool:
    """Whether a place is as high as the ground around it along x and y, but for a slope."""
    height, most = surface_height(t, x, y), STEEP * MARGIN
    level = True
    for side in (-MARGIN, MARGIN):
        level = level and abs(surface_height(t, x + side, y) - height) < most
        level = level and abs(surface_height(t, x, y + side) - height) < most
    return level


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
