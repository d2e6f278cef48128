"""What a run achieved, by the measures of equations.md §3."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.state import Vector
from harpy_pin.plant.run import Run

__all__ = ["Chattering", "Measures", "body_angles", "chattering", "measure"]

MIN_NORMAL_FORCE = 20.0
SLIDING_SPEED = 0.01
STUMBLE = 0.5
LATE = 0.05
DEBOUNCE = 0.02


@dataclass(frozen=True)
class Measures:
    """Measures of a run. Slip counts whenever a foot touches the ground, planned or not.

    Attributes:
        fell: whether the robot fell or the simulation diverged.
        ending: how the run ended.
        duration_s: simulated time logged.
        distance_m: way of the body along x.
        steps: duration over the gait's step duration.
        slip_mm_per_step: path of the feet along the ground while they touch it, both feet, per step.
        late_slip_mm_per_step: the part of it later than 50 ms after touchdown.
        sliding: share of the feet's contact time in which they move faster than 10 mm/s.
        low_force: share of time in which the ground's total normal force is under 20 N.
        no_contact: share of time in which no foot touches the ground.
        tracking_rms_mm: distance of the body from its target x_r, root mean square (NaN without a logged target).
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
    """

    fell: bool
    ending: str
    duration_s: float
    distance_m: float
    steps: float
    slip_mm_per_step: float
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


def contact_age(touching: NDArray[np.bool_], period: float) -> Vector:
    """Time since touchdown of each foot, s; a break shorter than 20 ms is a bounce, not a new touchdown.

    Args:
        touching: (n, feet) whether the foot touches the ground.
        period: time between rows, s.

    Returns:
        (n, feet); zero in the air.
    """
    age = np.zeros(touching.shape)
    for k in range(touching.shape[1]):
        since, away = 0.0, np.inf
        for i, on in enumerate(touching[:, k]):
            if on:
                since = 0.0 if away > DEBOUNCE else since
                away = 0.0
                age[i, k] = since
            else:
                away += period
            since += period
    return age


def measure(run: Run, *, step_duration: float | None = None) -> Measures:
    """Measures of a run.

    Args:
        run: any run; targets and solver status are used where they were logged.
        step_duration: of the gait, s; from the run's metadata by default, else 0.75 s.

    Raises:
        InputError: the run ended before its first tick.
    """
    if len(run) == 0:
        raise InputError("the run has no ticks to measure", name="run")
    period = float(run.metadata.get("control_period", 1e-3))
    if step_duration is None:
        gait = run.metadata.get("parameters", {}).get("gait", {})
        step_duration = float(gait.get("step_duration", 0.75))
    force, position, velocity = run["foot_force"], run["foot_position"], run["foot_velocity"]
    touching = force[:, :, 2] > 0.0
    duration = len(run) * period
    steps = duration / step_duration
    path = np.linalg.norm(np.diff(position[:, :, :2], axis=0), axis=2) * (touching[1:] & touching[:-1])
    late = contact_age(touching, period)[1:] > LATE
    speed = np.linalg.norm(velocity[:, :, :2], axis=2)
    contact_samples = max(int(touching.sum()), 1)
    # No step has been taken at the first row, so no force has been measured yet.
    total = force[1:, :, 2].sum(axis=1) if len(run) > 1 else force[:, :, 2].sum(axis=1)
    angles = np.abs(body_angles(run["q"])).max(axis=0)
    error = np.linalg.norm(run["q"][:, :3] - run["x_r"][:, :3], axis=1) if "x_r" in run else np.array([np.nan])
    thrust = np.linalg.norm(run["thrust"], axis=2)
    failures = int((run["qp_status"] > 1).sum()) if "qp_status" in run else 0
    x, y = run["q"][:, 3], run["q"][:, 4]
    tilt = float(np.arccos(np.clip(1.0 - 2.0 * (x * x + y * y), -1.0, 1.0)).max())
    return Measures(
        fell=run.fell,
        ending=run.ending,
        duration_s=duration,
        distance_m=float(run["q"][-1, 0] - run["q"][0, 0]),
        steps=steps,
        slip_mm_per_step=float(1e3 * path.sum() / steps),
        late_slip_mm_per_step=float(1e3 * (path * late).sum() / steps),
        sliding=float(((speed > SLIDING_SPEED) & touching).sum() / contact_samples),
        low_force=float(np.mean(total < MIN_NORMAL_FORCE)),
        no_contact=float(np.mean(total <= 0.0)),
        tracking_rms_mm=float(1e3 * np.sqrt(np.mean(error**2))),
        thrust_rms_n=float(np.sqrt(np.mean(thrust.sum(axis=1) ** 2))) if thrust.size else 0.0,
        thrust_max_n=float(thrust.max()) if thrust.size else 0.0,
        torque_max_nm=float(np.abs(run["torque"]).max()) if run["torque"].size else 0.0,
        roll_max_rad=float(angles[0]),
        pitch_max_rad=float(angles[1]),
        yaw_max_rad=float(angles[2]),
        solver_failures=failures,
        tilt_max_rad=tilt,
        stumbled=tilt > STUMBLE,
        bad_samples=int(run["bad_samples"][-1]) if "bad_samples" in run else 0,
    )


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
    checks.number("period", period, low=0.0, strict=True)
    values = np.asarray(signal, dtype=np.float64)
    values = values.reshape(len(values), -1)
    if len(values) < 2:
        raise InputError("chattering needs at least two samples", name="signal")
    duration = (len(values) - 1) * period
    reversals = 0
    for column in values.T:
        steps = np.diff(column)
        moving = steps[np.abs(steps) > 1e-9 * np.ptp(column)]
        reversals += int(np.count_nonzero(np.diff(np.sign(moving))))
    return Chattering(float(np.abs(np.diff(values, axis=0)).sum() / duration), reversals / duration)
