"""The log as the regression takes it: even in time, smoothed, with derivatives, and twice.

Every signal goes through the same window, and splines through what is left give velocities and
accelerations. That is done with every second row and again with those between: the noise of the
two halves is independent, which :mod:`harpy_pin.contrib.identify.regression` needs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

WINDOW = 0.015  # standard deviation of the Gaussian in the window, s
LEAST_ROWS = 4.0  # the same in rows of the log, at least
SLOWEST = 0.01  # largest period of a log, s
SPACING = 0.01  # between samples of the regression, s
EDGE = 0.15  # left out where a piece of the log begins and ends, s: windows and delays reach so far
GAP = 3.0  # A break is longer than so many median periods
SHORTEST = 1.0  # least length of a piece between two gaps, s
STILL = 0.2
"""Velocity, rad/s, below which dry friction may be anything: such rows are left out of a robot that
hangs.
"""
SLOW = 0.02  # velocity that turns dry friction around, rad/s: friction is tanh(v / SLOW)
FULL = 0.98  # share of the peak torque from which on a torque may be cut off
SAME = 0.9999  # torques are alike from this ratio on
LOADED = 0.02  # share of the robot's weight from which on a foot is in contact
MIXED = 0.02
"""Share of the window in which a sample may be of another kind: still, cut off, other contacts."""
GRAVITY = 9.81
OTHER_NAMES = {"q": "joint_position", "torque": "joint_torque"}
"""Names of the sensors (:class:`harpy_pin.Readings`), which are read in their stead."""


@dataclass(frozen=True, eq=False)
class Half:
    """What every second row says at the samples.

    Attributes:
        t: (n,) times of the samples, s.
        q: (n, joints) angles, rad.
        v: (n, joints) rad/s.
        a: (n, joints) rad/s².
        sign: (n, joints) direction of the dry friction.
        back: (n, joints) torques of the motors' own feedback, which are not late, N·m.
        base: (n, 7), (n, 6) and (n, 6) pose, velocity and acceleration of the base, which is held
            level where the log has none.
        late: the torques that come late, N·m, by the time, and how many samples they are for, of
            each piece of the log without a gap.
    """

    t: Vector
    q: Vector
    v: Vector
    a: Vector
    sign: Vector
    back: Vector
    base: tuple[Vector, Vector, Vector]
    late: tuple[tuple[CubicSpline, int], ...]

    def torque(self, joint: int, delay: float) -> tuple[Vector, Vector]:
        """(n,) torque of a joint with a delay, N·m, and its rate where it comes late, N·m/s."""
        ends = np.cumsum([size for _, size in self.late])
        times = np.split(self.t - delay, ends[:-1])
        splines = [CubicSpline.construct_fast(x.c[:, :, joint], x.x) for x, _ in self.late]
        value, rate = (
            np.concatenate([spline(t, order) for spline, t in zip(splines, times, strict=True)])
            for order in (0, 1)
        )
        return value - self.back[:, joint], rate

    def state(self, k: int) -> tuple[Vector, Vector, Vector]:
        """Configuration, velocity and acceleration of a sample with the base."""
        pose, twist, rate = (part[k] for part in self.base)
        return (np.append(pose, self.q[k]), np.append(twist, self.v[k]), np.append(rate, self.a[k]))


@dataclass(frozen=True, eq=False)
class Samples:
    """Of all pieces of the log, one after the other.

    Attributes:
        t: (n,) times, s.
        halves: both, at these times.
        cut: (n, joints) whether a torque may be cut off.
        still: (n, joints) whether a joint may stand still.
        stance: (n, feet) whether a foot is in contact; of no column where the base is held.
        steady: (n,) whether the contacts have not just changed.
    """

    t: Vector
    halves: tuple[Half, Half]
    cut: NDArray[np.bool_]
    still: NDArray[np.bool_]
    stance: NDArray[np.bool_]
    steady: NDArray[np.bool_]


def read_samples(robot: Robot, log: Run | Mapping[str, Vector]) -> tuple[Samples, list[str]]:
    """Samples of a log, and what is wrong with it."""
    signals = _signals(robot, log)
    t, rows = signals.pop("t"), len(signals["q"])
    finite = [np.isfinite(part).all(axis=1) for part in (t[:, None], *signals.values())]
    kept = np.flatnonzero(np.all(finite, axis=0))
    kept = kept[np.diff(np.maximum.accumulate(t[kept]), prepend=-np.inf) > 0.0]
    t, said = t[kept], list[str]()
    if len(t) < rows:
        said.append(f"{rows - len(t)} of {rows} rows are not finite, or not later than others")
    period = float(np.median(np.diff(t))) if len(t) > 1 else np.inf
    if period > SLOWEST:
        raise InputError(f"rows must be at most {SLOWEST:g} s apart, got {period:.3g} s", name="t")
    breaks = np.flatnonzero(np.diff(t) > GAP * period) + 1
    if len(breaks):
        said.append(f"{len(breaks)} gaps, the longest of {np.diff(t).max():.3g} s")
    spans = np.split(np.arange(len(t)), breaks)
    pieces = [
        _piece(robot, t[span], {name: x[kept[span]] for name, x in signals.items()}, period)
        for span in spans
        if t[span[-1]] - t[span[0]] > SHORTEST
    ]
    if not pieces:
        raise InputError(f"the log has no piece of {SHORTEST:g} s without a gap", name="t")
    joined = [
        np.concatenate(column) for column in zip(*(kinds for kinds, _ in pieces), strict=True)
    ]
    first, second = (_joined([halves[k] for _, halves in pieces]) for k in (0, 1))
    return Samples(first.t, (first, second), *joined), said


def _signals(robot: Robot, log: Run | Mapping[str, Vector]) -> dict[str, Vector]:
    """The signals that are used, (rows, columns) each, and t."""
    known = dict(log)
    law = "k_p" in known
    for name, other in OTHER_NAMES.items():
        if name not in known and other in known and not (law and name == "torque"):
            known[name] = known[other]
    for name in ("t", "q"):
        checks.one_of("signal", name, known)
    if "torque" not in known and not law:
        raise InputError("the log has neither torque nor the motors' k_p", name="torque")
    t, n, nq = checks.array("t", known["t"], None).ravel(), len(robot.joints), robot.model.nq
    wide = np.shape(known["q"])[-1] if np.ndim(known["q"]) == 2 else 0
    if wide not in (n, nq):
        message = f"q must have {n} angles of joints, or {nq} numbers with the base, in a row"
        raise InputError(f"{message}, got {wide}", name="q")
    columns = {"q": wide, **dict.fromkeys(("torque", "target_q", "target_v", "k_p", "k_d"), n)}
    for name in {"k_p", "k_d"} & known.keys():
        if np.ndim(known[name]) < 2:  # they never change
            known[name] = np.tile(checks.gains(name, known[name], n), (len(t), 1))
    if wide == nq:
        columns |= {"v": robot.model.nv, "stance": len(robot.feet)}
        if "stance" not in known and "foot_force" in known:
            force = checks.array("foot_force", known["foot_force"], (len(t), len(robot.feet), 3))
            known["stance"] = np.linalg.norm(force, axis=2) > LOADED * robot.mass * GRAVITY
    return {"t": t} | {
        name: checks.array(name, known[name], (len(t), size))
        for name, size in columns.items()
        if name in known
    }


def _joined(halves: list[Half]) -> Half:
    """Halves of all pieces, one after the other."""
    names = ("t", "q", "v", "a", "sign", "back")
    parts = {name: np.concatenate([getattr(half, name) for half in halves]) for name in names}
    pose, v, a = (np.concatenate([half.base[k] for half in halves]) for k in range(3))
    late = tuple(late for half in halves for late in half.late)
    return Half(**parts, base=(pose, v, a), late=late)


def _piece(
    robot: Robot, times: Vector, read: Mapping[str, Vector], period: float
) -> tuple[tuple[Any, ...], list[Half]]:
    """Kinds of the samples of rows without a gap, as :class:`Samples` has them, and both halves."""
    n, window = len(robot.joints), max(WINDOW, LEAST_ROWS * period)
    t = times[0] + period * np.arange(int((times[-1] - times[0]) / period) + 1)
    even = {
        name: np.stack([np.interp(t, times, x) for x in part.T], axis=1)
        for name, part in read.items()
    }
    first, last = np.searchsorted(t, (t[0] + EDGE, t[-1] - EDGE))
    kept = slice(first, last, max(round(SPACING / period), 1))

    def share(kind: NDArray[np.bool_]) -> Vector:
        return np.asarray(gaussian_filter1d(kind.astype(float), window / period, axis=0)[kept])

    angle, zero = even["q"][:, -n:], np.zeros((len(t), n))
    torque, q, v, k_p, k_d = (
        even.get(name, zero) for name in ("torque", "target_q", "target_v", "k_p", "k_d")
    )
    even["late"] = torque + k_p * q + k_d * v
    velocity = np.gradient(gaussian_filter1d(angle, window / period, axis=0), period, axis=0)
    whole = np.abs(even["late"] - k_p * angle - k_d * velocity)
    largest = whole.max(axis=0)
    often = np.mean(whole >= SAME * largest, axis=0) > 0.01  # cut off below the peak torque
    limit = np.where(often, np.minimum(largest, robot.torque_limit), robot.torque_limit)
    in_stance = share(even.get("stance", zero[:, :0]) > 0.5)
    kinds = (
        share(whole >= FULL * limit) > MIXED,
        share(np.abs(velocity) < STILL) > MIXED,
        in_stance > 0.5,
        np.all(np.minimum(in_stance, 1.0 - in_stance) < MIXED, axis=1),
    )
    return kinds, [_half(even, t, k, t[kept], window) for k in (0, 1)]


def _half(even: Mapping[str, Vector], t: Vector, first: int, at: Vector, window: float) -> Half:
    """The samples of every second row alone, at times ``at``."""
    rows = slice(first, None, 2)
    t, n = t[rows], even["late"].shape[1]

    def smooth(x: Vector) -> CubicSpline:
        return CubicSpline(t, _smoothed(x, window / (t[1] - t[0])))

    q = smooth(even["q"][rows, -n:])
    back = np.zeros((len(at), n))
    for order, name in enumerate(("k_p", "k_d")):
        if name in even:
            back = back + smooth(even[name][rows])(at) * q(at, order)
    still = np.zeros((len(at), 6))
    base = np.eye(7)[np.full(len(at), 6)], still, still
    if even["q"].shape[1] > n:
        pose = smooth(even["q"][rows, :7])(at)
        pose[:, 3:] /= np.linalg.norm(pose[:, 3:], axis=1)[:, None]
        v = smooth(even["v"][rows, :6] if "v" in even else np.zeros((len(t), 6)))
        base = pose, v(at), v(at, 1)
    sign = smooth(np.tanh(q(t, 1) / SLOW))(at)
    late = ((smooth(even["late"][rows]), len(at)),)
    return Half(at, q(at), q(at, 1), q(at, 2), sign, back, base, late)


def _smoothed(x: Vector, window: float) -> Vector:
    """Through a Gaussian less its bend, which leaves slow motion as it is: a frequency ω passes as
    (1 + x) exp(-x), x = (ω window)² / 2. What is nonlinear in a motion passes like the motion then.
    """
    plain, bend = (gaussian_filter1d(x, window, axis=0, order=order) for order in (0, 2))
    return np.asarray(plain - 0.5 * window**2 * bend)
