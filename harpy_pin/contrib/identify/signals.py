"""The log as the regression takes it: even in time, smoothed, with derivatives, and twice.

Every signal goes through the same Gaussian window, and splines through what is left give velocities and accelerations.
That is done with every second row and again with those between: the noise of the two halves is independent, which the
regression needs (:mod:`harpy_pin.contrib.identify.regression`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.log.run import Run
from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

WINDOW, LEAST_ROWS = 0.015, 4.0
"""Standard deviation of the Gaussian window, s, and in rows of the log at least."""
SLOWEST = 0.01
"""Largest period of a log, s."""
SPACING = 0.01
"""Between samples of the regression, s."""
EDGE = 0.15
"""Left out where a piece of the log begins and ends, s: windows and delays reach so far."""
GAP = 3.0
"""A break is longer than so many median periods."""
SHORTEST = 1.0
"""Least length of a piece between two gaps, s."""
STILL = 0.2
"""Velocity below which dry friction may be anything, rad/s: such rows are left out of a robot that hangs."""
SLOW = 0.02
"""Velocity that turns dry friction around, rad/s: friction is tanh(v / SLOW)."""
FULL = 0.98
"""Share of the peak torque from which on a torque may be cut off."""
ALIKE = 0.9999
"""Torques are alike from this ratio on."""
LOADED = 0.02
"""Share of the robot's weight from which on a foot is in contact."""
MIXED = 0.02
"""Share of the window in which a sample may be of another kind: still, cut off, with other contacts."""
GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class Half:
    """What every second row says at the samples.

    Attributes:
        q: (n, joints) angles, rad.
        v: (n, joints) rad/s.
        a: (n, joints) rad/s².
        sign: (n, joints) direction of the dry friction.
        back: (n, joints) torques of the motors' own feedback, which are not late, N·m.
        late: the torques that come late, N·m, by the time.
        base: (n, 7), (n, 6) and (n, 6) pose, velocity and acceleration of the base; None for one that is held level.
    """

    q: Vector
    v: Vector
    a: Vector
    sign: Vector
    back: Vector
    late: CubicSpline
    base: tuple[Vector, Vector, Vector] | None


@dataclass(frozen=True, eq=False)
class Piece:
    """A piece of the log without a gap.

    Attributes:
        t: (n,) times of the samples, s.
        halves: both, at these times.
        cut: (n, joints) whether a torque may be cut off.
        still: (n, joints) whether a joint may stand still.
        stance: (n, feet) whether a foot is in contact.
        steady: (n,) whether the contacts have not just changed.
    """

    t: Vector
    halves: tuple[Half, Half]
    cut: NDArray[np.bool_]
    still: NDArray[np.bool_]
    stance: NDArray[np.bool_]
    steady: NDArray[np.bool_]

    def torque(self, half: int, joint: int, delay: float) -> tuple[Vector, Vector]:
        """(n,) torque of a joint with a delay, N·m, and its rate where it comes late, N·m/s."""
        spline = CubicSpline.construct_fast(
            self.halves[half].late.c[:, :, joint], self.halves[half].late.x
        )
        return spline(self.t - delay) - self.halves[half].back[:, joint], spline(self.t - delay, 1)


def read_pieces(robot: Robot, log: Run | Mapping[str, Vector]) -> tuple[list[Piece], list[str]]:
    """Pieces of a log, and what is wrong with it; see :func:`harpy_pin.contrib.identify.identify`."""
    for name in ("t", "q"):
        checks.one_of("signal", name, log.keys())
    if "torque" not in log and "k_p" not in log:
        raise InputError(
            "the log has neither torque nor the motors' targets and k_p", name="torque"
        )
    t, n = checks.array("t", log["t"], None).ravel(), len(robot.joints)
    width = {
        "q": np.shape(log["q"])[-1],
        "torque": n,
        "target_q": n,
        "target_v": n,
        "k_p": n,
        "k_d": n,
    }
    width |= {"v": robot.model.nv, "stance": len(robot.feet)}
    if width["q"] not in (n, robot.model.nq) or robot.model.nq != n + 7:
        message = (
            f"q must have {n} angles of joints, or {robot.model.nq} numbers with the base, in a row"
        )
        raise InputError(
            f"{message}, got {width['q']}; and no joint may turn without end", name="q"
        )
    if width["q"] == n:  # the base is held: what feet feel, and velocities, are not asked for
        del width["v"], width["stance"]
    read = {
        name: checks.array(name, log[name], (len(t), size))
        for name, size in width.items()
        if name in log
    }
    if width["q"] > n and "stance" not in read and "foot_force" in log:
        force = checks.array("foot_force", log["foot_force"], (len(t), len(robot.feet), 3))
        read["stance"] = np.where(
            np.linalg.norm(force, axis=2) > LOADED * robot.mass * GRAVITY, 1.0, 0.0
        )
    finite = np.isfinite(t) & np.all(
        [np.isfinite(part).all(axis=1) for part in read.values()], axis=0
    )
    kept = np.flatnonzero(finite)
    kept = kept[np.diff(np.maximum.accumulate(t[kept]), prepend=-np.inf) > 0.0]
    t, read, rows = t[kept], {name: part[kept] for name, part in read.items()}, len(t)
    said = (
        [f"{rows - len(t)} of {rows} rows are not finite, or not later than others"]
        if len(t) < rows
        else []
    )
    period = float(np.median(np.diff(t))) if len(t) > 1 else np.inf
    if period > SLOWEST:
        raise InputError(f"rows must be at most {SLOWEST:g} s apart, got {period:.3g} s", name="t")
    breaks = np.flatnonzero(np.diff(t) > GAP * period) + 1
    if len(breaks):
        said.append(f"{len(breaks)} gaps, the longest of {np.diff(t).max():.3g} s")
    spans = [
        span for span in np.split(np.arange(len(t)), breaks) if t[span[-1]] - t[span[0]] > SHORTEST
    ]
    if not spans:
        raise InputError(f"the log has no piece of {SHORTEST:g} s without a gap", name="t")
    return [
        _piece(robot, t[span], {name: x[span] for name, x in read.items()}, period)
        for span in spans
    ], said


def _piece(robot: Robot, times: Vector, read: Mapping[str, Vector], period: float) -> Piece:
    """The samples of rows without a gap."""
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
    k_p, k_d = even.get("k_p", zero), even.get("k_d", zero)
    late = (
        even.get("torque", zero)
        + k_p * even.get("target_q", zero)
        + k_d * even.get("target_v", zero)
    )
    velocity = np.gradient(gaussian_filter1d(angle, window / period, axis=0), period, axis=0)
    whole = np.abs(late - k_p * angle - k_d * velocity)
    largest = whole.max(axis=0)
    often = np.mean(whole >= ALIKE * largest, axis=0) > 0.01  # cut off below the peak torque
    limit = np.where(often, np.minimum(largest, robot.torque_limit), robot.torque_limit)
    stance = even.get("stance", np.zeros((len(t), 0)))
    in_stance = share(stance > 0.5)
    return Piece(
        t[kept],
        (_half(even, late, t, 0, t[kept], window), _half(even, late, t, 1, t[kept], window)),
        share(whole >= FULL * limit) > MIXED,
        share(np.abs(velocity) < STILL) > MIXED,
        in_stance > 0.5,
        np.asarray((np.minimum(in_stance, 1.0 - in_stance) < MIXED).all(axis=1)),
    )


def _smoothed(x: Vector, window: float) -> Vector:
    """Through a Gaussian window whose second moment is taken away, so that slow motion stays as it is:
    a frequency ω passes as (1 + x) exp(-x), x = (ω window)² / 2.
    """
    plain, bend = (gaussian_filter1d(x, window, axis=0, order=order) for order in (0, 2))
    return np.asarray(plain - 0.5 * window**2 * bend)


def _half(
    even: Mapping[str, Vector], late: Vector, t: Vector, first: int, at: Vector, window: float
) -> Half:
    """The samples of every second row alone, at times ``at``."""
    rows = slice(first, None, 2)
    t, n = t[rows], late.shape[1]
    step = t[1] - t[0]

    def smooth(x: Vector) -> CubicSpline:
        return CubicSpline(t, _smoothed(x, window / step))

    q = smooth(even["q"][rows, -n:])
    gains = (
        smooth(even[name][rows])(at) if name in even else np.zeros((1, n))
        for name in ("k_p", "k_d")
    )
    back = sum(gain * q(at, order) for order, gain in enumerate(gains))
    base = None
    if even["q"].shape[1] > n:
        pose = smooth(even["q"][rows, :7])(at)
        pose[:, 3:] /= np.linalg.norm(pose[:, 3:], axis=1)[:, None]
        v = smooth(even["v"][rows, :6] if "v" in even else np.zeros((len(t), 6)))
        base = pose, v(at), v(at, 1)
    sign = smooth(np.tanh(q(t, 1) / SLOW))(at)
    return Half(q(at), q(at, 1), q(at, 2), sign, back, smooth(late[rows]), base)
