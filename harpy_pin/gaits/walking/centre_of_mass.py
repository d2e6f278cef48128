"""The acceleration of the body with which the centre of mass has the one that is demanded.

Whole-body controllers are asked for the acceleration of the body's origin. Of a robot on soles arms, torso and legs are
heavy: when the body is set upright, or the torso comes back to its posture, the centre of mass moves against the body's
origin, and the centre of pressure goes to where nobody wanted it. What these tasks ask for is known. So is the motion
of the legs, whose feet stay or swing. Let c̈ = c̈₀ + C a with all of it, a the horizontal acceleration of the body:
then a = C⁻¹ (wanted − c̈₀).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from harpy_pin.compiled import kernel
from harpy_pin.gaits.walking.record import WalkingRecord
from harpy_pin.model.cholesky import factorise, solve_vector
from harpy_pin.model.state import Vector

if TYPE_CHECKING:
    from harpy_pin.gaits.gait import GaitTargetRecord

__all__ = ["ORIENTATION_GAINS", "POSTURE_GAINS", "SWING_GAINS"]

ORIENTATION_GAINS = SWING_GAINS = (400.0, 40.0)
"""(k_p, k_d) of the controller's tasks: turning of the body, and feet in the air, 1/s² and 1/s."""
POSTURE_GAINS = (100.0, 20.0)
"""Likewise of its joints."""
SINGULAR = 1e-7
"""Added to Jᵀ J of a leg, which may be stretched."""
LARGEST, LEAST = 15.0, 0.01
"""Largest acceleration of the body, m/s², and least determinant of C."""


@kernel
def note_posture(p: WalkingRecord, q: Vector, v: Vector) -> None:
    """What the posture task asks of every joint, rad/s².

    Args:
        p: element of the gait's record.
        q: (nq,) configuration.
        v: (nv,) generalised velocity.
    """
    t = p.tree
    for i in range(1, t.parent.shape[0]):
        error = p.angle[i] - q[t.place[i]]
        p.posture[i] = POSTURE_GAINS[0] * error - POSTURE_GAINS[1] * v[t.column[i]]


@kernel
def body_for_centre(p: WalkingRecord, o: GaitTargetRecord) -> tuple[float, float]:
    """Horizontal acceleration of the body for that of the centre of mass, world axes, m/s².

    Args:
        p: element of the gait's record.
        o: targets, of which the body's vertical acceleration and the heading are read.
    """
    t = p.tree
    bodies = t.parent.shape[0]
    root, joint = np.zeros((3, 6)), np.zeros((3, bodies))
    r, w = t.rotation, t.twist[0]
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        root[0, a] = r[2, a] * o.body[8] - w[3 + b] * w[c] + w[3 + c] * w[b]
        root[1, a], root[2, a] = r[0, a], r[1, a]
    _turning(p, o, root[0])
    for i in range(1, bodies):
        joint[0, i] = p.posture[i]
    for k in range(p.group.shape[0]):
        _leg(p, k, root, joint)
    found = np.empty((3, 3))
    for n in range(3):
        _centre_acceleration(p, root[n], joint[n], n == 0, found[n])
    x, y = p.demand[0] - found[0, 0], p.demand[1] - found[0, 1]
    whole = found[1, 0] * found[2, 1] - found[2, 0] * found[1, 1]
    if not abs(whole) > LEAST:
        return p.demand[0], p.demand[1]
    ax, ay = (found[2, 1] * x - found[2, 0] * y) / whole, (found[1, 0] * y - found[1, 1] * x) / whole
    return min(max(ax, -LARGEST), LARGEST), min(max(ay, -LARGEST), LARGEST)


@kernel
def _turning(p: WalkingRecord, o: GaitTargetRecord, root: Vector) -> None:
    """What the orientation task asks for, as the root's angular acceleration, body axes."""
    r, w = p.tree.rotation, p.tree.twist[0]
    c, s = np.cos(o.heading[0]), np.sin(o.heading[0])
    turned = np.empty((3, 3))
    for a in range(3):
        turned[0, a] = c * r[0, a] + s * r[1, a]
        turned[1, a] = c * r[1, a] - s * r[0, a]
        turned[2, a] = r[2, a]
    for a in range(3):
        b, d = (a + 1) % 3, (a + 2) % 3
        error = 0.5 * (turned[d, b] - turned[b, d])
        rate = w[3 + a] - r[2, a] * o.heading[1]
        root[3 + a] = r[2, a] * o.heading[2] - ORIENTATION_GAINS[0] * error - ORIENTATION_GAINS[1] * rate


@kernel
def _leg(p: WalkingRecord, k: int, root: Vector, joint: Vector) -> None:
    """Accelerations of the joints of a leg, for three of the root: its foot stays, or swings as it should.

    Args:
        p: element of the gait's record.
        k: the foot.
        root: (3, 6) of the body, base axes; the last two are units, without velocities and what swings.
        joint: (3, bodies) of the joints, out.
    """
    t, m = p.tree, p.measured
    leg, joints = p.leg[k], p.leg.shape[1]
    u, want, moved = np.zeros(3), np.empty(6), np.empty(6)
    for a in range(3):
        for b in range(3):
            u[a] += t.rotation[b, a] * (m.place[k, b] - m.body[b])
    _wanted_of_foot(p, k, u, want)
    rows, normal, x = np.empty((6, joints)), np.zeros((joints, joints)), np.empty(joints)
    for n in range(joints):
        _at_point(t.screw[leg[n]], u, moved)
        for c in range(6):
            rows[c, n] = moved[c]
    for a in range(joints):
        for b in range(a + 1):
            for c in range(6):
                normal[a, b] += rows[c, a] * rows[c, b]
        normal[a, a] += SINGULAR
    factorise(normal, normal)
    for n in range(3):
        _at_point(root[n], u, moved)
        for a in range(joints):
            x[a] = 0.0
            for c in range(6):
                x[a] += rows[c, a] * ((want[c] if n == 0 else 0.0) - moved[c])
        solve_vector(normal, x)
        for a in range(joints):
            joint[n, leg[a]] = x[a]


@kernel
def _wanted_of_foot(p: WalkingRecord, k: int, u: Vector, want: Vector) -> None:
    """What root and joints have to give a foot, less what velocities add: it stays, or is on its path and back to it.

    Args:
        p: element of the gait's record.
        k: the foot.
        u: (3,) its middle, base axes, m.
        want: (6,) linear and angular acceleration, base axes, out.
    """
    t, m, last = p.tree, p.measured, p.leg[k, 0]
    r, w, speed, drift = t.rotation, t.twist[last], np.empty(6), np.empty(6)
    _at_point(w, u, speed)
    for c in range(6):
        want[c] = t.drift[0, c] - t.drift[last, c]
    _at_point(want, u, drift)
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        want[a], want[3 + a] = drift[a] - w[3 + b] * speed[c] + w[3 + c] * speed[b], drift[3 + a]
    if p.in_air[k] == 0.0:
        return
    swing, z = p.swing[k], p.lift[k]
    for a in range(3):
        want[a] -= SWING_GAINS[1] * speed[a]
        want[3 + a] += r[2, a] * swing[2, 2]
        for i in range(3):
            place, rate, bend = z[0], z[1], z[2]
            if i < 2:
                place, rate, bend = swing[0, i], swing[1, i], swing[2, i]
            want[a] += r[i, a] * (bend + SWING_GAINS[1] * rate + SWING_GAINS[0] * (place - m.place[k, i]))


@kernel
def _at_point(motion: Vector, u: Vector, out: Vector) -> None:
    """Linear and angular motion of a point that moves with a body.

    Args:
        motion: (6,) of the body, linear at the origin.
        u: (3,) of the point, m.
        out: (6,) out.
    """
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        out[a] = motion[a] + motion[3 + b] * u[c] - motion[3 + c] * u[b]
        out[3 + a] = motion[3 + a]


@kernel
def _centre_acceleration(p: WalkingRecord, root: Vector, joint: Vector, moving: bool, out: Vector) -> None:
    """Acceleration of the centre of mass, world axes, m/s².

    Args:
        p: element of the gait's record.
        root: (6,) of the body, base axes.
        joint: (bodies,) of the joints.
        moving: whether what the velocities add counts, too.
        out: (3,) out.
    """
    t = p.tree
    bodies = t.parent.shape[0]
    motion, u, here, total, weight = np.zeros((bodies, 6)), np.empty(3), np.empty(6), np.zeros(3), 0.0
    for c in range(6):
        motion[0, c] = root[c]
    for i in range(bodies):
        parent = t.parent[i]
        if i > 0:
            for c in range(6):
                motion[i, c] = motion[parent, c] + joint[i] * t.screw[i, c]
                if moving:
                    motion[i, c] += t.drift[i, c] - t.drift[parent, c]
        for a in range(3):
            u[a] = t.position[i, a]
            for b in range(3):
                u[a] += t.axes[i, a, b] * t.centre[i, b]
        _at_point(motion[i], u, here)
        for a in range(3):
            total[a] += t.mass[i] * here[a]
        if moving:
            w = t.twist[i]
            _at_point(w, u, here)
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                total[a] += t.mass[i] * (w[3 + b] * here[c] - w[3 + c] * here[b])
        weight += t.mass[i]
    for a in range(3):
        out[a] = 0.0
        for b in range(3):
            out[a] += t.rotation[a, b] * total[b] / weight
