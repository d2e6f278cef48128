"""What a run achieved, by the measures of equations.md §3."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.log import optional
from harpy_pin.log.archive import release
from harpy_pin.log.measure_words import WORDS
from harpy_pin.log.run import Run
from harpy_pin.log.slip import DEBOUNCE
from harpy_pin.log.walk_measures import WalkSums
from harpy_pin.model.state import Vector

__all__ = ["Chattering", "Measures", "body_angles", "chattering", "measure"]

MIN_NORMAL_FORCE = 20.0
SLIDING_SPEED = 0.01
STUMBLE = 0.5
LATE = 0.05
BLOCK = 1 << 16
"""Rows that are measured at a time."""


@dataclass(frozen=True)
class Measures:
    """Measures of a run. Slip counts whenever a foot touches the ground, planned or not.

    A robot without feet has no slip: all measures of slip, sliding and contact forces are NaN.

    Attributes:
        fell: whether the robot fell or the simulation diverged.
        ending: how the run ended.
        duration_s: simulated time logged.
        distance_m: way of the body along x.
        steps: duration over the gait's step duration.
        slip_mm_per_step: path of the feet along the ground while they touch it, both feet, per step; summed over the
            physics steps (:mod:`harpy_pin.log.slip`).
        net_slip_mm_per_step: distance between the places of touchdown and of last touch, both feet, per step (NaN
            where it was not logged).
        late_slip_mm_per_step: the part of it later than 50 ms after touchdown.
        sliding: share of the feet's contact time in which they move faster than 10 mm/s.
        low_force: share of time in which the ground's total normal force is under 20 N.
        no_contact: share of time in which no foot touches the ground.
        tracking_rms_mm: distance of the body from its target x_r, root mean square (NaN without a logged target, and
            under :class:`~harpy_pin.gaits.WalkingGait`, which has a velocity for its target: see velocity_rms_m_s).
        thrust_rms_n: root mean square of the sum of both thrusts' magnitudes.
        thrust_max_n: largest magnitude of one thrust.
        torque_max_nm: largest joint torque.
        roll_max_rad: largest magnitude.
        pitch_max_rad: largest magnitude.
        yaw_max_rad: largest magnitude.
        solver_failures: ticks whose quadratic program gave no usable solution.
        tilt_max_rad: largest angle between the body's z axis and the vertical.
        stumbled: whether the body tilted by more than 0.5 rad (29°), whether it fell or not: what comes through such a
            tilt is not a walk that went well, even where it ends upright.
        bad_samples: ticks whose measurements were no numbers, where the controller counts them.
        cost_of_transport: positive work of the joints over weight times path; NaN for a path under 0.1 m.
        joint_power_w: mean of the joints' positive power.
        thrust_power_w: mean electrical power of the thrusters, were each a fan of 18 N from 1 kW, an assumption
            (:data:`harpy_pin.log.power.PRESETS`).
        velocity_rms_m_s: horizontal velocity of the body less the one that the gait applies, both averaged over two
            steps, root mean square (NaN without a logged command).
        turning_rms_rad_s: likewise of the velocity about the vertical.
        pressure_margin_mm: distance to its edge that the centre of pressure of a flat foot keeps in 95 % of the time in
            which it carries a fifth of the weight (NaN without flat feet).
    """

    fell: bool
    ending: str
    duration_s: float
    distance_m: float
    steps: float
    slip_mm_per_step: float
    net_slip_mm_per_step: float
    late_slip_mm_per_step: float
    sliding: float
    low_force: float
    no_contact: float
    tracking_rms_mm: float
    thrust_rms_n: float
    thrust_max_n: float
    torque_max_nm: float
    roll_max_rad: float
    pitch_max_rad: float
    yaw_max_rad: float
    solver_failures: int
    tilt_max_rad: float
    stumbled: bool
    bad_samples: int
    cost_of_transport: float = math.nan
    joint_power_w: float = math.nan
    thrust_power_w: float = math.nan
    velocity_rms_m_s: float = math.nan
    turning_rms_rad_s: float = math.nan
    pressure_margin_mm: float = math.nan

    def __str__(self) -> str:
        """One line for each measure that there is, in words and with its unit."""
        lines = []
        for name, value in self.as_dict().items():
            if isinstance(value, float) and math.isnan(value):
                continue
            shown = ("yes" if value else "no") if isinstance(value, bool) else value
            lines.append(f"{WORDS[name]}: {shown:.4g}" if isinstance(shown, float) else f"{WORDS[name]}: {shown}")
        return "\n".join(lines)

    def as_dict(self) -> dict[str, float | bool | str]:
        """Names and values, ready for JSON."""
        return asdict(self)


def body_angles(q: Vector) -> Vector:
    """Roll, pitch and yaw (z-y-x angles) of configurations.

    Args:
        q: (n, nq).

    Returns:
        (n, 3), rad.
    """
    x, y, z, w = q[:, 3], q[:, 4], q[:, 5], q[:, 6]
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return np.stack((roll, pitch, yaw), axis=1)


class _ContactClock:
    """Time since touchdown of each foot, row by row; see :func:`contact_age`.

    Args:
        feet: how many.
        period: time between rows, s.
    """

    def __init__(self, feet: int, period: float) -> None:
        self._period = period
        self._since = [0.0] * feet
        self._away = [np.inf] * feet

    def read(self, touching: NDArray[np.bool_]) -> Vector:
        """(n, feet) the next rows' ages, s."""
        age = np.zeros(touching.shape)
        for k in range(touching.shape[1]):
            since, away = self._since[k], self._away[k]
            for i, on in enumerate(touching[:, k]):
                if on:
                    since = 0.0 if away > DEBOUNCE else since
                    away = 0.0
                    age[i, k] = since
                else:
                    away += self._period
                since += self._period
            self._since[k], self._away[k] = since, away
        return age


def contact_age(touching: NDArray[np.bool_], period: float) -> Vector:
    """Time since touchdown of each foot, s; a break shorter than 20 ms is a bounce, not a new touchdown.

    Args:
        touching: (n, feet) whether the foot touches the ground.
        period: time between rows, s.

    Returns:
        (n, feet); zero in the air.
    """
    return _ContactClock(touching.shape[1], period).read(touching)


@dataclass
class _Sums:
    """What a run adds up to, block by block, so that the memory this takes does not grow with the run.

    Attributes:
        clock: of the feet's contact.
        path: of the touching feet along the ground, m.
        late_path: the part of it later than 50 ms after touchdown, m.
        contacts: feet that touch, counted over rows.
        slides: those that move faster than 10 mm/s.
        forces: rows with a measured force.
        low: of these, rows with little force.
        none: of these, rows with no force.
        error: squared distance from the target, m².
        thrust: squared sum of the thrusts' magnitudes, N².
        thrust_max: largest magnitude of a thrust, N.
        torque_max: largest magnitude of a torque, N·m.
        angles: (3,) largest roll, pitch and yaw, rad.
        tilt: largest tilt, rad.
        failures: rows whose program had no usable solution.
    """

    clock: _ContactClock
    path: float = 0.0
    late_path: float = 0.0
    contacts: int = 0
    slides: int = 0
    forces: int = 0
    low: int = 0
    none: int = 0
    error: float = 0.0
    thrust: float = 0.0
    thrust_max: float = 0.0
    torque_max: float = 0.0
    angles: Vector = field(default_factory=lambda: np.zeros(3))
    tilt: float = 0.0
    failures: int = 0

    def add(self, run: Run, begin: int, end: int) -> None:
        """Add rows ``begin`` to ``end``, the last one not included."""
        self._add_feet(run, begin, end)
        self._add_body(run, slice(begin, end))
        self._add_inputs(run, slice(begin, end))

    def _add_feet(self, run: Run, begin: int, end: int) -> None:
        before = max(begin - 1, 0)  # a path leads from one row to the next
        force = run["foot_force"][before:end]
        touching = force[:, :, 2] > 0.0
        path = _paths(run, before, end, touching)
        own = touching[begin - before :]
        late = self.clock.read(own)[len(own) - len(path) :] > LATE
        self.path += path.sum()
        self.late_path += (path * late).sum()
        speed = np.linalg.norm(run["foot_velocity"][begin:end, :, :2], axis=2)
        self.contacts += int(own.sum())
        self.slides += int(((speed > SLIDING_SPEED) & own).sum())
        # No step has been taken at the first row, so no force has been measured yet.
        total = (force[1:] if len(run) > 1 else force)[:, :, 2].sum(axis=1)
        self.forces += len(total)
        self.low += int((total < MIN_NORMAL_FORCE).sum())
        self.none += int((total <= 0.0).sum())

    def _add_body(self, run: Run, rows: slice) -> None:
        q = run["q"][rows]
        self.angles = np.maximum(self.angles, np.abs(body_angles(q)).max(axis=0))
        x, y = q[:, 3], q[:, 4]
        cosine = np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)
        self.tilt = float(np.maximum(self.tilt, np.arccos(cosine).max()))
        target = optional.optional_signal(run, "x_r")
        if target is not None:
            self.error += np.sum(np.linalg.norm(q[:, :3] - target[rows, :3], axis=1) ** 2)

    def _add_inputs(self, run: Run, rows: slice) -> None:
        thrust = np.linalg.norm(run["thrust"][rows], axis=2)
        self.thrust += np.sum(thrust.sum(axis=1) ** 2)
        self.thrust_max = float(np.maximum(self.thrust_max, np.max(thrust, initial=0.0)))
        self.torque_max = float(np.maximum(self.torque_max, np.max(np.abs(run["torque"][rows]), initial=0.0)))
        status = optional.optional_signal(run, "qp_status")
        if status is not None:
            self.failures += int((~(status[rows] <= 1)).sum())  # a status that is not finite, too


def measure(run: Run, *, step_duration: float | None = None) -> Measures:
    """Measures of a run.

    Args:
        run: any run; targets and solver status are used where they were logged. It is read block by block: of a log
            that lies in its file, only one block at a time is in memory.
        step_duration: of the gait, s; from the run's metadata by default, else 0.75 s.

    Raises:
        InputError: the run ended before its first tick, or a signal or a setting that is used is not what its name
            says.
    """
    checks.instance("run", run, Run)
    if len(run) == 0:
        raise InputError("the run has no ticks to measure", name="run")
    period = optional.control_period(run)
    if step_duration is None:
        step_duration = optional.step_duration(run)
    checks.number("step_duration", step_duration, low=0.0, strict=True)
    bad_samples = optional.last_count(run, "bad_samples")
    slip_net = optional.optional_signal(run, "slip_net")
    feet = run["foot_force"].shape[1]
    sums = _Sums(_ContactClock(feet, period))
    walk = WalkSums(run, period=period, step_duration=step_duration)
    for begin in range(0, len(run), BLOCK):
        end = min(begin + BLOCK, len(run))
        sums.add(run, begin, end)
        walk.add(run, begin, end)
        release(run.signals.values())
    duration = len(run) * period
    steps = duration / step_duration
    if feet == 0:
        sums.path = sums.late_path = math.nan
    contacts = max(sums.contacts, 1) if feet else math.nan
    measured = sums.forces if feet else math.nan
    roll, pitch, yaw = sums.angles.tolist()
    return Measures(
        fell=run.fell,
        ending=run.ending,
        duration_s=duration,
        distance_m=float(run["q"][-1, 0] - run["q"][0, 0]),
        steps=steps,
        slip_mm_per_step=float(1e3 * sums.path / steps),
        net_slip_mm_per_step=float(1e3 * (slip_net[-1] - slip_net[0]).sum() / steps)
        if slip_net is not None and feet
        else math.nan,
        late_slip_mm_per_step=float(1e3 * sums.late_path / steps),
        sliding=sums.slides / contacts,
        low_force=sums.low / measured,
        no_contact=sums.none / measured,
        tracking_rms_mm=float(1e3 * np.sqrt(sums.error / len(run))) if optional.has_target(run) else math.nan,
        thrust_rms_n=float(np.sqrt(sums.thrust / len(run))),
        thrust_max_n=sums.thrust_max,
        torque_max_nm=sums.torque_max,
        roll_max_rad=roll,
        pitch_max_rad=pitch,
        yaw_max_rad=yaw,
        solver_failures=sums.failures,
        tilt_max_rad=sums.tilt,
        stumbled=not sums.tilt <= STUMBLE,
        bad_samples=bad_samples,
        cost_of_transport=walk.cost_of_transport,
        joint_power_w=walk.joint_power,
        thrust_power_w=walk.thrust_power,
        velocity_rms_m_s=walk.velocity_rms,
        turning_rms_rad_s=walk.turning_rms,
        pressure_margin_mm=1e3 * walk.pressure_margin,
    )


def _paths(run: Run, begin: int, end: int, touching: NDArray[np.bool_]) -> Vector:
    """(rows − 1, feet) path of each foot from row to row, m.

    A log without that signal (of another plant, or an older one) has positions only: then a foot slips between two rows
    if it touches the ground at either.
    """
    logged = optional.optional_signal(run, "slip_path")
    if logged is not None:
        return np.diff(logged[begin:end], axis=0)
    steps = np.diff(run["foot_position"][begin:end, :, :2], axis=0)
    path: Vector = np.linalg.norm(steps, axis=2) * (touching[1:] | touching[:-1])
    return path


@dataclass(frozen=True)
class Chattering:
    """How much a signal chatters.

    Attributes:
        variation_per_s: total variation per second, summed over the components, in units of the signal per s.
        reversals_per_s: changes of direction per second, summed over the components. A smooth signal has as many at a
            shorter step; one that chatters has more.
    """

    variation_per_s: float
    reversals_per_s: float


def chattering(signal: ArrayLike, *, period: float) -> Chattering:
    """Total variation and reversals of a sampled signal.

    Increments smaller than 1e-9 of the component's range are rounding, not motion: they end no direction.

    Args:
        signal: (n,) or (n, components).
        period: time between samples, s.

    Raises:
        InputError: fewer than two samples, or a period that is not positive.
    """
    period = checks.number("period", period, low=0.0, strict=True)
    values = checks.array("signal", signal, None)
    if values.ndim == 0 or len(values) < 2:
        raise InputError("chattering needs at least two samples", name="signal")
    values = values.reshape(len(values), -1)
    duration = (len(values) - 1) * period
    reversals = 0
    for column in values.T:
        steps = np.diff(column)
        moving = steps[np.abs(steps) > 1e-9 * np.ptp(column)]
        reversals += int(np.count_nonzero(np.diff(np.sign(moving))))
    return Chattering(float(np.abs(np.diff(values, axis=0)).sum() / duration), reversals / duration)
