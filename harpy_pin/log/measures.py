"""What a run achieved, by the measures of equations.md §3."""

import math
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.log import optional
from harpy_pin.log.run import Run
from harpy_pin.log.slip import DEBOUNCE
from harpy_pin.log.walk_measures import walk_measures
from harpy_pin.model.state import Vector

MIN_NORMAL_FORCE = 20.0
SLIDING_SPEED = 0.01
STUMBLE = 0.5
LATE = 0.05
CAUSES = ("joint_tracking_rms_rad", "force_mismatch", "clipped")
"""Measures that say why a walk fell."""


def _called(words: str) -> Any:
    """A measure, and what it is called where it is shown, with its unit."""
    return field(metadata={"words": words})


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
        slip_mm_per_step: path of the feet along the ground while they touch it, both feet, per
            step; summed over the physics steps (:mod:`harpy_pin.log.slip`).
        net_slip_mm_per_step: distance between the places of touchdown and of last touch, both feet,
            per step (NaN where it was not logged).
        late_slip_mm_per_step: the part of it later than 50 ms after touchdown.
        sliding: share of the feet's contact time in which they move faster than 10 mm/s.
        low_force: share of time in which the ground's total normal force is under 20 N.
        no_contact: share of time in which no foot touches the ground.
        tracking_rms_mm: distance of the body from its target x_r, root mean square (NaN without a
            logged target, and under :class:`~harpy_pin.gaits.WalkingGait`, which has a velocity for
            its target: see velocity_rms_m_s).
        thrust_rms_n: root mean square of the sum of the thrusts' magnitudes; NaN, as all of
            thrusts, without thrusters.
        thrust_max_n: largest magnitude of one thrust.
        torque_max_nm: largest joint torque.
        roll_max_rad: largest magnitude.
        pitch_max_rad: largest magnitude.
        yaw_max_rad: largest magnitude, from that at the beginning.
        solver_failures: ticks whose quadratic program gave no usable solution.
        solver_fallbacks: ticks in which the solver of the program did not finish, and the dual
            active-set method followed it.
        tilt_max_rad: largest angle between the body's z axis and the vertical.
        stumbled: whether the body tilted by more than 0.5 rad (29°), whether it fell or not: what
            comes through such a tilt is not a walk that went well, even where it ends upright.
        bad_samples: ticks whose measurements were not finite, where the controller counts them.
        cost_of_transport: positive work of the joints over weight times path; NaN for a path under
            0.1 m.
        joint_power_w: mean of the joints' positive power.
        thrust_power_w: mean electrical power of the thrusters, were each a fan of 18 N from 1 kW,
            an assumption (:data:`harpy_pin.log.power.PRESETS`).
        velocity_rms_m_s: horizontal velocity of the body less the one that the gait applies, both
            averaged over two steps, root mean square (NaN without a logged command).
        turning_rms_rad_s: the same error of the velocity about the vertical.
        pressure_margin_mm: distance to its edge that the centre of pressure of a flat foot keeps in
            95 % of the time in which it bears a fifth of the weight and does not roll (NaN without
            flat feet).
        joint_tracking_rms_rad: joints less the targets of the motors' law, root mean square (NaN
            without a law).
        force_mismatch: contact forces after a tick less those that were planned, norm over all
            feet, root mean square, over the weight (NaN without a plan). Friction, armature or
            delay that the controller does not know, soft ground, and feet that slip make it large.
        clipped: share of ticks in which a torque is at its limit (NaN where none is limited).
        estimate_off_m: distance of the estimated place from the body's at the end (NaN without an
            estimate).
    """

    fell: bool = _called("fell")
    ending: str = _called("ending")
    duration_s: float = _called("simulated time, s")
    distance_m: float = _called("distance along x, m")
    steps: float = _called("steps")
    slip_mm_per_step: float = _called("slip, mm per step")
    net_slip_mm_per_step: float = _called("net slip, mm per step")
    late_slip_mm_per_step: float = _called("slip later than 50 ms after touchdown, mm per step")
    sliding: float = _called("share of contact time sliding")
    low_force: float = _called("share of time with normal force under 20 N")
    no_contact: float = _called("share of time without contact")
    tracking_rms_mm: float = _called("distance from the target, mm rms")
    thrust_rms_n: float = _called("sum of the thrusts, N rms")
    thrust_max_n: float = _called("largest thrust, N")
    torque_max_nm: float = _called("largest joint torque, N·m")
    roll_max_rad: float = _called("largest roll, rad")
    pitch_max_rad: float = _called("largest pitch, rad")
    yaw_max_rad: float = _called("largest yaw, rad")
    solver_failures: int = _called("ticks without a QP solution")
    solver_fallbacks: int = _called("ticks in which the dual method followed the QP's solver")
    tilt_max_rad: float = _called("largest tilt, rad")
    stumbled: bool = _called("stumbled")
    bad_samples: int = _called("ticks with invalid measurements")
    cost_of_transport: float = _called("cost of transport (positive work / weight / path)")
    joint_power_w: float = _called("power of the joints without braking, W")
    thrust_power_w: float = _called("power of the thrusters at 1 kW for 18 N, W")
    velocity_rms_m_s: float = _called("error of the velocity over two steps, m/s rms")
    turning_rms_rad_s: float = _called("error of turning over two steps, rad/s rms")
    pressure_margin_mm: float = _called("centre of pressure inside a sole for 95 % of the time, mm")
    joint_tracking_rms_rad: float = _called("joints less their targets, rad rms")
    force_mismatch: float = _called("contact forces less those planned, share of the weight rms")
    clipped: float = _called("share of ticks with a torque at its limit")
    estimate_off_m: float = _called("estimated place at the end, m off")

    def __str__(self) -> str:
        """One line for each measure that there is, in words and with its unit."""
        lines = []
        for name, value in self.as_dict().items():
            if isinstance(value, float) and math.isnan(value):
                continue
            shown = ("yes" if value else "no") if isinstance(value, bool) else value
            lines.append(
                f"{WORDS[name]}: {shown:.4g}"
                if isinstance(shown, float)
                else f"{WORDS[name]}: {shown}"
            )
        return "\n".join(lines)

    @property
    def causes(self) -> str:
        """What may have felled the robot, in words."""
        found = ((WORDS[name], getattr(self, name)) for name in CAUSES)
        return "; ".join(f"{words}: {value:.2g}" for words, value in found if not math.isnan(value))

    def as_dict(self) -> dict[str, float | bool | str]:
        """Names and values, ready for JSON."""
        return asdict(self)


WORDS = {entry.name: str(entry.metadata["words"]) for entry in fields(Measures)}
"""The measures in words, with their units."""


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
    """Time since touchdown of each foot, s; a break shorter than 20 ms is a bounce, not a new
    touchdown.

    Args:
        touching: (n, feet) whether the foot touches the ground.
        period: time between rows, s.

    Returns:
        (n, feet); zero in swing.
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
        InputError: the run ended before its first tick, or a signal or a setting that is used is
            not what its name says.
    """
    checks.instance("run", run, Run)
    if len(run) == 0:
        raise InputError("the run has no ticks to measure", name="run")
    period = optional.control_period(run)
    if step_duration is None:
        step_duration = optional.step_duration(run)
    checks.number("step_duration", step_duration, low=0.0, strict=True)
    duration = len(run) * period
    steps = duration / step_duration
    q, status = run["q"], optional.optional_signal(run, "qp_status")
    thrust = np.linalg.norm(run["thrust"], axis=2)
    thrusters = 1.0 if thrust.size else math.nan
    angles = body_angles(q)
    angles[:, 2] -= angles[0, 2]
    angles[:, 2] -= 2.0 * np.pi * np.round(angles[:, 2] / (2.0 * np.pi))
    roll, pitch, yaw = np.abs(angles).max(axis=0).tolist()
    estimated = run["estimated_q"] if "estimated_q" in run else np.full_like(q, np.nan)
    known = estimated.shape == q.shape and estimated.dtype.kind == "f"
    cosine = np.clip(1.0 - 2.0 * (q[:, 3] * q[:, 3] + q[:, 4] * q[:, 4]), -1.0, 1.0)
    tilt = float(np.arccos(cosine).max())
    return Measures(
        fell=run.fell,
        ending=run.ending,
        duration_s=duration,
        distance_m=float(q[-1, 0] - q[0, 0]),
        steps=steps,
        **_contact_measures(run, period, steps),
        tracking_rms_mm=_tracking(run),
        thrust_rms_n=float(np.sqrt(np.sum(thrust.sum(axis=1) ** 2) / len(run))) * thrusters,
        thrust_max_n=float(np.max(thrust, initial=0.0)) * thrusters,
        torque_max_nm=float(np.max(np.abs(optional.given_torque(run)), initial=0.0)),
        roll_max_rad=roll,
        pitch_max_rad=pitch,
        yaw_max_rad=yaw,
        solver_failures=0
        if status is None
        else int((~(status <= 1)).sum()),  # a status that is not finite, too
        solver_fallbacks=optional.last_count(run, "qp_fallbacks"),
        tilt_max_rad=tilt,
        stumbled=not tilt <= STUMBLE,
        bad_samples=optional.last_count(run, "bad_samples"),
        **walk_measures(run, period=period, step_duration=step_duration),
        estimate_off_m=float(np.linalg.norm(estimated[-1, :3] - q[-1, :3])) if known else math.nan,
    )


def _contact_measures(run: Run, period: float, steps: float) -> dict[str, float]:
    """Slip of the feet, and how long the ground pushes; NaN without feet."""
    force, slip_net = run["foot_force"], optional.optional_signal(run, "slip_net")
    touching = force[:, :, 2] > 0.0
    path = _paths(run, touching)
    late = contact_age(touching, period)[1:] > LATE
    speed = np.linalg.norm(run["foot_velocity"][:, :, :2], axis=2)
    # No step has been taken at the first row, so no force has been measured yet.
    total = (force[1:] if len(run) > 1 else force)[:, :, 2].sum(axis=1)
    feet = math.nan if force.shape[1] == 0 else 1.0
    net = math.nan if slip_net is None else (slip_net[-1] - slip_net[0]).sum()
    return {
        "slip_mm_per_step": float(1e3 * path.sum() / steps) * feet,
        "net_slip_mm_per_step": float(1e3 * net / steps) * feet,
        "late_slip_mm_per_step": float(1e3 * (path * late).sum() / steps) * feet,
        "sliding": int(((speed > SLIDING_SPEED) & touching).sum())
        / max(int(touching.sum()), 1)
        * feet,
        "low_force": int((total < MIN_NORMAL_FORCE).sum()) / len(total) * feet,
        "no_contact": int((total <= 0.0).sum()) / len(total) * feet,
    }


def _tracking(run: Run) -> float:
    """Distance of the body from its target, root mean square, mm; NaN without one."""
    target = optional.optional_signal(run, "x_r")
    if target is None or not optional.has_target(run):
        return math.nan
    distance = np.linalg.norm(run["q"][:, :3] - target[:, :3], axis=1)
    return float(1e3 * np.sqrt(np.sum(distance**2) / len(run)))


def _paths(run: Run, touching: NDArray[np.bool_]) -> Vector:
    """(rows − 1, feet) path of each foot from row to row, m.

    A log without that signal (of another plant, or an older one) has positions only: then a foot
    slips between two rows if it touches the ground at either.
    """
    logged = optional.optional_signal(run, "slip_path")
    if logged is not None:
        return np.diff(logged, axis=0)
    steps = np.diff(run["foot_position"][:, :, :2], axis=0)
    path: Vector = np.linalg.norm(steps, axis=2) * (touching[1:] | touching[:-1])
    return path
