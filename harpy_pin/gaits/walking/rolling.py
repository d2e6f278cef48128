"""A sole that leaves the ground rolls over the line of its toes, or of its heel when the robot walks backward.

So its leg reaches farther: the ankle rises and comes along. The foot that swings in a step has a pitch θ from the
step's beginning on, which is a smooth bump in time: it grows while both feet are down, the edge alone bears load then,
and is zero again well before the foot lands.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from harpy_pin.compiled import kernel
from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.gaits.walking.record import WalkingRecord

ROLL, MOST_ROLL = 0.85, 0.6
"""Largest pitch per way of a step in lengths of the leg, rad, and largest of all."""
BEGIN, FLAT_AGAIN = 0.3, 0.6
"""Share of its swing after which a foot is flat again."""
SAME_EDGE = 0.1
"""How much nearer to the middle of its foot than the edge a contact point may be that is on it, as a share."""


def edges_of(corner: Vector, foot: NDArray[np.int64]) -> tuple[Vector, Vector]:
    """Which contact points are on the edges of their feet, and where these are.

    Args:
        corner: (points, 2) places about the middles of the feet, x forward, m.
        foot: (points,) the foot that each is of.

    Returns:
        (points,) 1 for those on the line of the toes, −1 for those on that of the heel, 0 for others; (feet, 2) how far
        these two lines are ahead of the middle of each foot, m. All zero for points.
    """
    edge, ends = np.zeros(len(foot)), np.zeros((int(foot.max()) + 1, 2))
    for k in range(len(ends)):
        own, ahead = foot == k, corner[foot == k, 0]
        least = (1.0 - SAME_EDGE) * ahead.max(), (1.0 - SAME_EDGE) * ahead.min()
        if least[0] > 0.0 > least[1]:
            edge[own] = np.where(ahead >= least[0], 1.0, np.where(ahead <= least[1], -1.0, 0.0))
            ends[k] = ahead[ahead >= least[0]].mean(), ahead[ahead <= least[1]].mean()
    return edge, ends


@kernel
def plan_roll(p: WalkingRecord) -> None:
    """How far the foot rolls that swings in the step that begins: as the other foot is ahead of it."""
    p.pitch[:] = 0.0
    p.roll = 0.0
    if not p.soles or p.group.shape[0] != 2 or p.groups != 2 or not p.terrain.level:
        return
    m, k = p.measured, 0 if p.group[0] == p.swings else 1
    c, s = np.cos(m.turned[k]), np.sin(m.turned[k])
    way = c * (m.place[1 - k, 0] - m.place[k, 0]) + s * (m.place[1 - k, 1] - m.place[k, 1])
    p.roll = min(max(ROLL * way / p.leg, -MOST_ROLL), MOST_ROLL)


@kernel
def roll_on(p: WalkingRecord) -> None:
    """Pitch, its rate and its acceleration at the present phase: θ = 64 u³ (1 − u)³ of the largest one."""
    p.pitch[:] = 0.0
    begin = BEGIN * p.double_support
    length = p.double_support - begin + FLAT_AGAIN * (1.0 - p.double_support)
    u, rate = (p.phase - begin) / length, p.haste / (length * p.step_duration)
    if p.roll != 0.0 and u > 0.0 and u < 1.0:
        bump, slope, most = u * (1.0 - u), 1.0 - 2.0 * u, 64.0 * p.roll
        p.pitch[0] = most * bump * bump * bump
        p.pitch[1] = 3.0 * most * bump * bump * slope * rate
        p.pitch[2] = 6.0 * most * bump * (slope * slope - bump) * rate * rate
        _find_pivot(p)


@kernel
def _find_pivot(p: WalkingRecord) -> None:
    """Middle of the edge about which the foot rolls."""
    number = 0.0
    p.pivot[:] = 0.0
    for n in range(p.foot.shape[0]):
        if p.group[p.foot[n]] == p.swings and p.edge[n] * p.pitch[0] > 0.0:
            number += 1.0
            for i in range(3):
                p.pivot[i] += (p.measured.point[n, i] - p.pivot[i]) / number


@kernel
def is_lifted(p: WalkingRecord, n: int) -> bool:
    """Whether a contact point of a stance foot is off the ground, because the foot rolls."""
    rolls: bool = p.pitch[0] != 0.0 and p.group[p.foot[n]] == p.swings
    return rolls and p.phase <= p.double_support and p.edge[n] * p.pitch[0] <= 0.0


@kernel
def rolling_edge(p: WalkingRecord, k: int) -> float:
    """How far the edge about which foot k rolls is ahead of its middle, m."""
    return float(p.ends[k, 0 if p.pitch[0] > 0.0 else 1])


@kernel
def tip(p: WalkingRecord, o: GaitTargetRecord, n: int, heading: float) -> None:
    """Turn the target of a contact point of a flat foot about the edge of that foot."""
    if p.pitch[0] == 0.0 or p.group[p.foot[n]] != p.swings:
        return
    arm, rate, bend = rolling_edge(p, p.foot[n]) - p.corner[n, 0], p.pitch[1], p.pitch[2]
    c, s = arm * np.cos(p.pitch[0]), arm * np.sin(p.pitch[0])
    x, y = np.cos(heading), np.sin(heading)
    place, velocity, acceleration = o.foot_position[n], o.foot_velocity[n], o.foot_acceleration[n]
    ahead = arm - c
    place[0], place[1], place[2] = place[0] + x * ahead, place[1] + y * ahead, place[2] + s
    ahead = s * rate
    velocity[0], velocity[1], velocity[2] = velocity[0] + x * ahead, velocity[1] + y * ahead, velocity[2] + c * rate
    ahead = s * bend + c * rate * rate
    acceleration[0], acceleration[1] = acceleration[0] + x * ahead, acceleration[1] + y * ahead
    acceleration[2] += c * bend - s * rate * rate


@kernel
def lift_rolling(p: WalkingRecord, o: GaitTargetRecord, n: int) -> None:
    """Target of a contact point that is lifted: it turns about the edge, where that is, and bears no load."""
    m, k = p.measured, p.foot[n]
    arm, left = rolling_edge(p, k) - p.corner[n, 0], p.corner[n, 1]
    c, s = np.cos(m.turned[k]), np.sin(m.turned[k])
    place, velocity = o.foot_position[n], o.foot_velocity[n]
    place[0] = p.pivot[0] - c * arm - s * left - o.body[0]
    place[1] = p.pivot[1] - s * arm + c * left - o.body[1]
    place[2] = p.pivot[2] - o.body[2]
    velocity[2] = -o.body[5]
    tip(p, o, n, m.turned[k])
    o.load[n] = 0.0
