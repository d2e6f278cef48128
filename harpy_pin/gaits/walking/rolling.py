"""A sole that leaves the ground rolls over the line of its toes, or of its heel when the robot
walks backward.

So its leg reaches farther: the ankle rises and comes along. The foot that swings in a step has a
pitch θ, which is a smooth bump in time. It begins while both feet are down; then the edge alone
bears load. It ends before the foot lands.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from harpy_pin.gaits.gait import GaitTargetRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector
from harpy_pin.model.vectors import rotation_in_plane

if TYPE_CHECKING:
    from harpy_pin.gaits.walking.record import WalkingRecord


def soles_of(corner: Vector, foot: NDArray[np.int64]) -> tuple[Vector, Vector]:
    """Where the contact points of rectangular soles are in the axes of their soles.

    Args:
        corner: (points, 2) places about the middles of the feet, x forward, m.
        foot: (points,) the foot that each is of.

    Returns:
        (points, 2) the same in the axes of each sole, whose sides they are along; (feet,) how far
        these axes are turned to the left, at most 45°, rad. A foot on one point is not turned.
    """
    own, askew = corner.copy(), np.zeros(int(foot.max()) + 1)
    for k in range(len(askew)):
        sides = corner[foot == k][1:] - corner[foot == k][0]
        if len(sides) > 1:
            x, y = sides[
                np.argsort(np.hypot(*sides.T))[0]
            ]  # the shortest of the three is no diagonal
            angle = np.arctan2(y, x)
            askew[k] = angle - 0.5 * np.pi * np.round(2.0 * angle / np.pi)
            c, s = np.cos(askew[k]), np.sin(askew[k])
            own[foot == k] = corner[foot == k] @ np.array(((c, -s), (s, c)))
    return own, askew


@kernel
def plan_roll(p: WalkingRecord) -> None:
    """How far the foot rolls that swings in the step that begins: as the other foot is ahead of
    it.
    """
    stay_flat(p)
    b, w, pace = p.build, p.tuned, p.pace
    if not b.soles or pace.group.shape[0] != 2 or pace.groups != 2 or not p.terrain.level:
        return
    m, k = p.measured, 0 if pace.group[0] == p.steps.swings else 1
    way = float((m.place[1 - k, :2] - m.place[k, :2]) @ ahead_of(p, k, m.turned[k]))
    size = min(max(w.roll * abs(way) / b.leg - w.flat_roll, 0.0), w.max_roll)
    p.roll.largest = size if way > 0.0 else -size


@kernel
def stay_flat(p: WalkingRecord) -> None:
    """No foot rolls."""
    p.roll.largest = 0.0
    p.roll.pitch[:] = 0.0


@kernel
def roll_on(p: WalkingRecord) -> None:
    """Pitch, its rate and its acceleration at the present phase: θ = 64 u³ (1 − u)³ of the largest
    one.
    """
    r, s = p.roll, p.steps
    r.pitch[:] = 0.0
    begin = p.tuned.roll_begin * s.double_support
    length = s.double_support - begin + p.tuned.roll_end * (1.0 - s.double_support)
    u, rate = (s.phase - begin) / length, s.haste / (length * s.duration)
    if r.largest != 0.0 and u > 0.0 and u < 1.0:
        bump, slope, most = u * (1.0 - u), 1.0 - 2.0 * u, 64.0 * r.largest
        r.pitch[0] = most * bump**3
        r.pitch[1] = 3.0 * most * bump**2 * slope * rate
        r.pitch[2] = 6.0 * most * bump * (slope**2 - bump) * rate**2
        _find_pivot(p)


@kernel
def _find_pivot(p: WalkingRecord) -> None:
    """Middle of the edge about which the foot rolls, where it is."""
    b = p.build
    ends = (p.pace.group[b.foot] == p.steps.swings) & (b.own[:, 0] * p.roll.largest > 0.0)
    share = ends / max(np.sum(ends), 1)
    p.roll.pivot[:] = share @ p.measured.point


@kernel
def rolls(p: WalkingRecord, k: int) -> bool:
    """Whether foot k has a pitch now."""
    rolling: bool = p.roll.pitch[0] != 0.0 and p.pace.group[k] == p.steps.swings
    return rolling


@kernel
def ahead_of(p: WalkingRecord, k: int, heading: float) -> Vector:
    """Horizontal direction (2,) in which the sole of foot k with this heading is long."""
    angle = heading + p.build.askew[k]
    return np.array([np.cos(angle), np.sin(angle)])


@kernel
def is_lifted(p: WalkingRecord, n: int) -> bool:
    """Whether a contact point of a stance foot is off the ground, because the foot rolls."""
    behind: bool = p.build.own[n, 0] * p.roll.largest < 0.0
    return rolls(p, p.build.foot[n]) and p.steps.phase <= p.steps.double_support and behind


@kernel
def share_of_edge(p: WalkingRecord, n: int) -> float:
    """Share of its usual load of a contact point of a stance foot: it falls to zero where the foot
    is about to roll.
    """
    b, s, largest = p.build, p.steps, p.roll.largest
    if largest == 0.0 or p.pace.group[b.foot[n]] != s.swings or b.own[n, 0] * largest > 0.0:
        return 1.0
    return float(min(max(1.0 - s.phase / (p.tuned.roll_begin * s.double_support), 0.0), 1.0))


@kernel
def tip(p: WalkingRecord, o: GaitTargetRecord, n: int, heading: float) -> None:
    """Turn the target of a contact point of a flat foot with this heading about the edge over which
    the foot rolls.
    """
    b, (pitch, rate, bend) = p.build, p.roll.pitch
    k, arm = b.foot[n], -2.0 * b.own[n, 0]
    if not rolls(p, k) or b.own[n, 0] * p.roll.largest > 0.0:
        return
    c, s, ahead = arm * np.cos(pitch), arm * np.sin(pitch), ahead_of(p, k, heading)
    o.foot_position[n] += np.array([*((arm - c) * ahead), s])
    o.foot_velocity[n] += rate * np.array([*(s * ahead), c])
    o.foot_acceleration[n] += np.array(
        [*((s * bend + c * rate**2) * ahead), c * bend - s * rate**2]
    )


@kernel
def lift_corner(p: WalkingRecord, o: GaitTargetRecord, n: int) -> None:
    """Target of a contact point that is lifted: it turns about the edge, where that is, and bears
    no load.
    """
    b, k = p.build, p.build.foot[n]
    heading = p.measured.turned[k]
    corner = np.array([2.0 * b.own[n, 0], b.own[n, 1]])
    o.foot_position[n] = p.roll.pivot - o.body[:3]
    o.foot_position[n, :2] += rotation_in_plane(heading + b.askew[k]) @ corner
    o.foot_velocity[n, 2] = -o.body[5]
    tip(p, o, n, heading)
    o.stance[n] = o.phase[n] = o.load[n] = 0.0


@kernel
def flat_place(p: WalkingRecord, k: int) -> Vector:
    """Where the middle of foot k would be, flat, with the edge where it is over which it rolls,
    m.
    """
    place: Vector = p.measured.place[k]
    if not rolls(p, k):
        return place
    end = 0.0
    b = p.build
    for n in range(b.foot.shape[0]):
        if b.foot[n] == k and b.own[n, 0] * p.roll.largest > 0.0:
            end = b.own[n, 0]
    return p.roll.pivot - end * np.array([*ahead_of(p, k, p.measured.turned[k]), 0.0])
