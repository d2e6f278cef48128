"""The log as the regression takes it: even in time, smoothed, with derivatives, and twice.

Every signal goes through the same window, and splines through what is left give velocities and
accelerations. That is done with every second row and again with those between: the noise of the
two halves is independent, which :mod:`harpy_pin.contrib.identify.regression` needs.
"""

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

WINDOW, BRIEF = 0.015, 0.008
"""Standard deviation of the Gaussian in the window, s, and of a robot whose steps are short."""
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
MIXED = 0.02  # share of the window in which a sample may be of another kind: still or cut off
OTHER_NAMES = {"q": "joint_position", "torque": "joint_torque"}
"""Names of the sensors (:class:`harpy_pin.Readings`), which are read in their stead."""


@dataclass(frozen=True, eq=False)
class Half:
    """What every second row says at the samples.

    Attributes:
        q: (n, nq) configurations; where the log has no base, it is held level at the origin.
        v: (n, nv) velocities.
        a: (n, nv) accelerations.
        sign: (n, joints) direction of the dry friction.
        back: (n, joints) torques of the motors' own feedback, which are not late, N·m.
        at: (n,) times of the samples, as if the log had no gap, s.
        late: the torques that come late, N·m, by these times.
    """

    q: Vector
    v: Vector
    a: Vector
    sign: Vector
    back: Vector
    at: Vector
    late: CubicSpline

    def torque(self, joint: int, delay: float) -> tuple[Vector, Vector]:
        """(n,) torque of a joint with a delay, N·m, and its rate where it comes late, N·m/s."""
        one = CubicSpline.construct_fast(self.late.c[:, :, joint], self.late.x)
        return one(self.at - delay) - self.back[:, joint], one(self.at - delay, 1)


@dataclass(frozen=True, eq=False)
class Samples:
    """Of all pieces of the log, one after the other.

    Attributes:
        t: (n,) times, s.
        halves: both, at these times.
        cut: (n, joints) whether a torque may be cut off.
        still: (n, joints) whether a joint may stand still.
        held: whether the base is held.
    """

    t: Vector
    halves: tuple[Half, Half]
    cut: NDArray[np.bool_]
    still: NDArray[np.bool_]
    held: bool


def read_samples(robot: Robot, log: Run | Mapping[str, Vector]) -> tuple[Samples, list[str]]:
    """Samples of a log, and what is wrong with it."""
    read, said, n = _signals(robot, log), list[str](), len(robot.joints)
    finite = np.all([np.isfinite(x).all(axis=1) for x in read.values()], axis=0)
    kept = np.flatnonzero(finite)
    kept = kept[np.diff(np.maximum.accumulate(read["t"][kept, 0]), prepend=-np.inf) > 0.0]
    if len(kept) < len(finite):
        missing = len(finite) - len(kept)
        said.append(f"{missing} of {len(finite)} rows are not finite, or not later than others")
    read = {name: x[kept] for name, x in read.items()}
    t = read.pop("t")[:, 0]
    period = float(np.median(np.diff(t))) if len(t) > 1 else np.inf
    if period > SLOWEST:
        raise InputError(f"rows must be at most {SLOWEST:g} s apart, got {period:.3g} s", name="t")
    breaks = np.flatnonzero(np.diff(t) > GAP * period) + 1
    if len(breaks):
        said.append(f"{len(breaks)} gaps, the longest of {np.diff(t).max():.3g} s")
    ends = [(x[0], x[-1]) for x in np.split(t, breaks) if x[-1] - x[0] > SHORTEST]
    if not ends:
        raise InputError(f"the log has no piece of {SHORTEST:g} s without a gap", name="t")
    # Pieces are put together: what a jump does to splines and windows is gone after EDGE.
    grids = [first + period * np.arange(int((last - first) / period) + 1) for first, last in ends]
    inner = np.concatenate([np.minimum(x - x[0], x[-1] - x) > EDGE for x in grids])
    held, grid = read["q"].shape[1] == n, np.concatenate(grids)
    window = max(WINDOW if held else BRIEF, LEAST_ROWS * period)
    line = np.asarray(period * np.arange(len(grid)), float)
    kept = np.flatnonzero(inner)[:: round(SPACING / period)]
    even = _on(grid, t, read)
    angle = even["q"][:, -n:]
    velocity = np.gradient(gaussian_filter1d(angle, window / period, axis=0), period, axis=0)
    whole = np.abs(even["late"] - even["k_p"] * angle - even["k_d"] * velocity)
    largest = whole.max(axis=0)
    often = np.mean(whole >= SAME * largest, axis=0) > 0.01  # cut off below the peak torque
    limit = np.where(often, np.minimum(largest, robot.torque_limit), robot.torque_limit)
    cut, still = (
        gaussian_filter1d(kind.astype(float), window / period, axis=0)[kept] > MIXED
        for kind in (whole >= FULL * limit, np.abs(velocity) < STILL)
    )
    first, second = (
        _half(
            _on(grid[k::2], t[k::2], {name: x[k::2] for name, x in read.items()}),
            line[k::2],
            line[kept],
            window,
            robot,
        )
        for k in (0, 1)
    )
    return Samples(grid[kept], (first, second), cut, still, held), said


def _signals(robot: Robot, log: Run | Mapping[str, Vector]) -> dict[str, Vector]:
    """The signals that are used, (rows, columns) each: t, q, v of the base, the gains, and what
    comes late.
    """
    known = dict(log)
    law, n, nq = "k_p" in known, len(robot.joints), robot.model.nq
    for name, other in OTHER_NAMES.items():
        if name not in known and other in known and not (law and name == "torque"):
            known[name] = known[other]
    for name in ("t", "q"):
        checks.one_of("signal", name, known)
    wide = np.shape(known["q"])[-1] if np.ndim(known["q"]) == 2 else 0
    if wide == nq:
        checks.one_of("signal", "v", known)
    if "torque" not in known and not law:
        raise InputError("the log has neither torque nor the motors' k_p", name="torque")
    if wide not in (n, nq):
        raise InputError(
            f"q must have {n} angles of joints, or {nq} numbers with the base, in a row, "
            f"got {wide}",
            name="q",
        )
    t = checks.array("t", known["t"], None).reshape(-1, 1)
    for name in {"k_p", "k_d"} & known.keys():
        if np.ndim(known[name]) < 2:  # they never change
            known[name] = np.tile(checks.gains(name, known[name], n), (len(t), 1))
    sizes = {"q": wide, **dict.fromkeys(("torque", "target_q", "target_v", "k_p", "k_d"), n)}
    sizes |= {"v": robot.model.nv} if wide == nq else {}
    zero = np.zeros((len(t), n))
    read = {
        name: checks.array(name, known[name], (len(t), size)) if name in known else zero
        for name, size in sizes.items()
    }
    late = read.pop("torque") + read["k_p"] * read.pop("target_q")
    return {"t": t, "late": late + read["k_d"] * read.pop("target_v")} | read


def _on(grid: Vector, t: Vector, read: Mapping[str, Vector]) -> dict[str, Vector]:
    """Signals of rows at times t, at those of a grid."""
    return {
        name: np.stack([np.interp(grid, t, column) for column in x.T], axis=1)
        for name, x in read.items()
    }


def _half(
    even: Mapping[str, Vector], line: Vector, at: Vector, window: float, robot: Robot
) -> Half:
    """The samples of every second row alone, at times ``at``."""

    def smooth(x: Vector) -> CubicSpline:
        return CubicSpline(line, _smoothed(x, window / (line[1] - line[0])))

    n = len(robot.joints)
    joints = smooth(even["q"][:, -n:])
    motion = [joints(at, order) for order in (0, 1, 2)]
    base = [np.eye(7)[np.full(len(at), 6)], *np.zeros((2, len(at), 6))]
    if "v" in even:
        pose, twist = smooth(even["q"][:, :7])(at), smooth(even["v"][:, :6])
        pose[:, 3:] /= np.linalg.norm(pose[:, 3:], axis=1)[:, None]
        base = [pose, twist(at), twist(at, 1)]
    q, v, a = (np.hstack(parts) for parts in zip(base, motion, strict=True))
    back = smooth(even["k_p"])(at) * motion[0] + smooth(even["k_d"])(at) * motion[1]
    sign = smooth(np.tanh(joints(line, 1) / SLOW))(at)
    return Half(q, v, a, sign, back, at, smooth(even["late"]))


def _smoothed(x: Vector, window: float) -> Vector:
    """Through a Gaussian less its bend, which leaves slow motion as it is: a frequency ω passes as
    (1 + x) exp(-x), x = (ω window)² / 2. What is nonlinear in a motion passes like the motion then.
    """
    plain, bend = (gaussian_filter1d(x, window, axis=0, order=order) for order in (0, 2))
    return np.asarray(plain - 0.5 * window**2 * bend)
