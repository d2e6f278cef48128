"""The paper's first simulation: the reduced-order model under its thruster law, with or without a
governor.

A point mass on a leg of variable length, its foot fixed at the origin, follows a reference that
circles over the foot in heading, angle and length (paper, section VLIP Model).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.governors.erg import ExplicitReferenceGovernor
from harpy_pin.governors.governor import Governor
from harpy_pin.governors.point_mass import Law, PointMassRecord, model_record
from harpy_pin.governors.rows import ConstraintRows, ForceRows, StackedRows
from harpy_pin.governors.thrust import CentreGains, centre_feedback
from harpy_pin.kernels import kernel
from harpy_pin.model.record import fields, make_record
from harpy_pin.model.state import Vector
from reproduction.chattering import chattering
from reproduction.margin import MarginGovernor
from reproduction.vlip_model import (
    AngleRow,
    PolarAngleRow,
    PolarRows,
    leg_force,
    polar_to_cartesian,
)

STARTS = ("paper", "inside")
COORDINATES = ("polar", "cartesian")
VLIP_GOVERNORS = ("none", "paper", "margin")
LEG = (0.1, 0.8)
"""Shortest and longest leg that the governors beyond the paper's keep to, m."""
PROJECTED = int(Law.PROJECTED)
INSIDE_ANGLE = 0.3
"""Leg angle of the start ``inside``, rad."""
PAPER_GAINS = CentreGains(k_pt=660.0, k_dt=60.0, k_pr=660.0, k_dr=60.0)


@dataclass(frozen=True, kw_only=True)
class VlipParameters(checks.Checked):
    """Settings of the VLIP run; defaults are the paper's, with equations.md §3 where it is
    silent.
    """

    mass: float = checks.setting(4.0, low=1e-3, high=1e6)  # m, kg, from 1e-3 to 1e6
    # μ_s, at most 10
    mu: float = checks.setting(0.45, low=0.0, high=checks.MAX_FRICTION, called="friction mu")
    min_normal_force: float = checks.setting(20.0, low=0.0)  # N
    # least leg angle of the reference, rad
    min_angle: float = checks.setting(float(np.deg2rad(5.0)), low=0.0)
    # magnitude of gravity, m/s²
    g: float = checks.setting(9.81, low=0.0, strict=True)
    # control and integration step, s
    dt: float = checks.setting(1e-3, low=0.0, strict=True)
    duration: float = 4.0  # s
    # of the governed reference: polar (θ, φ, l), the paper's, or cartesian
    coordinates: str = checks.setting("polar", checks.one_of, valid=COORDINATES)
    # paper starts at the target, which already violates friction (equations.md W2); inside starts
    # body and applied
    # reference at an angle of 0.3 rad, inside the friction cone
    start: str = checks.setting("paper", checks.one_of, valid=STARTS)
    gains: CentreGains = PAPER_GAINS  # of the thruster law
    # the thrust also compensates the part of gravity across the leg: the setting in which, with
    # K_pt = m k_pr and K_dt
    # = m k_dr, the model is exactly linear
    gravity_compensation: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.ticks(checks.number("duration", self.duration, low=self.dt), self.dt)


@dataclass(frozen=True, eq=False)
class VlipRun:
    """Log of a VLIP run, one row per tick."""

    t: Vector  # (n,) s
    position: Vector  # (n, 3) c, m
    velocity: Vector  # (n, 3) ċ, m/s
    x_r: Vector  # (n, 6) target reference [c_t; ċ_t]
    x_w: Vector  # (n, 6) applied reference [c_w; ċ_w]
    h_r: Vector  # (n, rows) the governor's rows at the target; no columns without a governor
    h_w: Vector  # (n, rows) the governor's rows at the applied reference
    thrust: Vector  # (n, 3) thrust, N
    infeasible: Vector  # (n,) whether the governor said that no reference satisfies its rows
    force: Vector  # (n, 3) contact force with the applied reference, N
    target_force: (
        Vector  # (n, 3) contact force that the target reference would cause at the same state, N
    )
    parameters: VlipParameters  # settings

    def margins(self, force: Vector) -> Vector:
        """(n, 3) force constraints: μ u_gz − |u_gx|, μ u_gz − |u_gy|, u_gz − u_min, N.

        Args:
            force: (n, 3), N.
        """
        p = self.parameters
        friction = p.mu * force[:, 2:] - np.abs(force[:, :2])
        return np.concatenate((friction, force[:, 2:] - p.min_normal_force), axis=1)

    def summary(self) -> VlipSummary:
        """How often and how far the constraints were violated, and how much the force chattered."""
        worst = self.margins(self.force).min(axis=1)
        target = self.margins(self.target_force).min(axis=1)
        measured = chattering(self.force[:, 2], period=self.parameters.dt)
        deviation = np.linalg.norm(self.x_w[:, :3] - self.x_r[:, :3], axis=1)
        return VlipSummary(
            violation_share=float(np.mean(worst < 0.0)),
            worst_violation_n=float(max(-worst.min(), 0.0)),
            target_violation_share=float(np.mean(target < 0.0)),
            reversals_per_s=measured.reversals_per_s,
            deviation_rms_m=float(np.sqrt(np.mean(deviation**2))),
            deviation_max_m=float(deviation.max()),
            deviation_max_time_s=float(self.t[int(deviation.argmax())]),
            thrust_rms_n=float(np.sqrt(np.mean(np.sum(self.thrust**2, axis=1)))),
            infeasible_share=float(np.mean(self.infeasible)),
        )


@dataclass(frozen=True)
class VlipSummary:
    """Numbers of a VLIP run."""

    violation_share: float  # share of ticks with a violated force constraint
    worst_violation_n: float  # largest violation of one, N
    target_violation_share: float  # share of ticks at which the target reference would violate one
    reversals_per_s: float  # changes of direction of the normal force, 1/s
    deviation_rms_m: float  # distance of the applied from the target reference, root mean square, m
    deviation_max_m: float  # largest distance, m
    deviation_max_time_s: float  # when it was largest, s
    thrust_rms_n: float  # root mean square of the thrust
    infeasible_share: float  # share of ticks at which the governor promised nothing


def cartesian(theta: float, phi: float, length: float) -> Vector:
    """(3,) position c − u of the body at leg angle θ from the vertical, heading φ (rad), leg length
    l (m).
    """
    out, derivative = np.empty(6), np.empty((6, 6))
    polar_to_cartesian(np.array([theta, phi, length, 0.0, 0.0, 0.0]), np.zeros(3), out, derivative)
    return out[:3]


def paper_reference(t: float) -> Vector:
    """(6,) the paper's target (θ, φ, l, θ̇, φ̇, l̇) at time t, s: its reference equation, with zero
    rates.
    """
    s = np.sin(np.pi * t - np.pi)
    return np.array(
        [0.45 + 0.45 * s, -1.5 * s, 0.4 + 0.1 * np.cos(np.pi * t - np.pi), 0.0, 0.0, 0.0]
    )


def vlip_setting(name: str, parameters: VlipParameters | None = None) -> VlipParameters:
    """The run's parameters as a governor needs them: Cartesian references beyond the paper's, and
    for ``margin`` the exactly linear model (K_pt = m k_pr, K_dt = m k_dr, gravity across the leg
    compensated).

    Args:
        name: one of :data:`VLIP_GOVERNORS`.
        parameters: of the run.

    Raises:
        InputError: an unknown name.
    """
    p = parameters if parameters is not None else VlipParameters()
    checks.one_of("governor", name, VLIP_GOVERNORS)
    if name == "margin":
        k_pr, k_dr = p.gains.k_pr, p.gains.k_dr
        gains = CentreGains(k_pt=p.mass * k_pr, k_dt=p.mass * k_dr, k_pr=k_pr, k_dr=k_dr)
        return replace(p, coordinates="cartesian", gains=gains, gravity_compensation=True)
    return p


def vlip_governor(
    parameters: VlipParameters | None = None, *, name: str = "paper", evaluate_at: str = "measured"
) -> Governor | None:
    """A governor of the VLIP run.

    Args:
        parameters: of the run, for this governor (:func:`vlip_setting`).
        name: one of :data:`VLIP_GOVERNORS`. The paper's has its force rows and least leg angle, and
            rates (1, 5, 2); none gives none.
        evaluate_at: of the paper's force rows (equations.md R1, R2).

    Raises:
        InputError: an unknown name.
    """
    p = parameters if parameters is not None else VlipParameters()
    checks.one_of("governor", name, VLIP_GOVERNORS)
    if name == "none":
        return None
    if name == "margin":
        least, k_p, k_d = p.min_normal_force, p.gains.k_pr, p.gains.k_dr
        return MarginGovernor(
            mass=p.mass, mu=p.mu, k_p=k_p, k_d=k_d, min_normal_force=least, leg=LEG, g=p.g
        )
    force = ForceRows(
        mass=p.mass,
        mu=p.mu,
        min_normal_force=p.min_normal_force,
        gains=p.gains,
        law=Law.PROJECTED,
        evaluate_at=evaluate_at,
        g=p.g,
    )
    rows: list[ConstraintRows] = [force, AngleRow(min_angle=p.min_angle)]
    if p.coordinates == "polar":
        rows = [PolarRows(force), PolarAngleRow(min_angle=p.min_angle)]
    return ExplicitReferenceGovernor(StackedRows(rows), alpha_r=1.0, alpha_t=5.0, alpha_n=2.0)


class VlipRecord(PointMassRecord):
    """What the simulation knows of the model."""

    gravity: Vector  # vector, m/s²
    foot: Vector  # its place, m
    carry: float  # mass whose gravity across the leg the thrust compensates, kg


def simulate_vlip(
    governor: Governor | None,
    parameters: VlipParameters | None = None,
    *,
    reference: Callable[[float], Vector] = paper_reference,
) -> VlipRun:
    """Run the reduced-order model.

    Args:
        governor: between target and thruster law; none applies the target.
        parameters: settings.
        reference: t ↦ (6,) polar target (θ, φ, l and rates); the paper's by default.
    """
    p = parameters if parameters is not None else VlipParameters()
    n = checks.ticks(p.duration, p.dt)
    foot = np.zeros(3)
    model = make_record(
        VlipRecord,
        gravity=np.array([0.0, 0.0, -p.g]),
        foot=foot,
        carry=p.mass if p.gravity_compensation else 0.0,
        **fields(model_record(mass=p.mass, g=p.g, gains=p.gains, law=Law.PROJECTED)),
    )
    start = reference(0.0).copy()
    if p.start == "inside":
        start[0] = INSIDE_ANGLE
    scratch = np.empty((6, 6))
    x_r, x_w, measured = np.zeros(6), np.zeros(6), np.zeros(9)
    polar_to_cartesian(start, foot, measured[:6], scratch)
    measured[3:6] = 0.0
    polar = p.coordinates == "polar"
    if governor is not None:
        governor.reset(start if polar else np.concatenate((measured[:3], np.zeros(3))))
    rows = 0 if governor is None else len(governor.status.h_r)
    sizes = {
        "c": 6,
        "x_r": 6,
        "x_w": 6,
        "h_r": rows,
        "h_w": rows,
        "u": 3,
        "u_r": 3,
        "thrust": 3,
        "bad": 1,
    }
    log = {name: np.zeros((n, size)) for name, size in sizes.items()}
    times: Vector = p.dt * np.arange(n, dtype=np.float64)
    for k, t in enumerate(times):
        target = reference(float(t))
        polar_to_cartesian(target, foot, x_r, scratch)
        if governor is None:
            x_w = x_r
        elif polar:
            polar_to_cartesian(governor.update(measured, target, p.dt), foot, x_w, scratch)
        else:
            x_w = governor.update(measured, x_r, p.dt)
        if governor is not None:
            log["h_r"][k], log["h_w"][k] = governor.status.h_r, governor.status.h_w
            log["bad"][k] = governor.status.infeasible
        log["c"][k], log["x_r"][k], log["x_w"][k] = measured[:6], x_r, x_w
        _law(measured, x_r, model, log["thrust"][k], log["u_r"][k])
        _law(measured, x_w, model, log["thrust"][k], log["u"][k])
        _runge_kutta(measured, x_w, model, p.dt)
        if not np.isfinite(measured).all():
            raise InputError(
                f"the model diverged at t = {t:.3f} s: the step {p.dt:g} s is too long", name="dt"
            )
    return VlipRun(
        t=times,
        position=log["c"][:, :3],
        velocity=log["c"][:, 3:],
        x_r=log["x_r"],
        x_w=log["x_w"],
        h_r=log["h_r"],
        h_w=log["h_w"],
        thrust=log["thrust"],
        infeasible=log["bad"][:, 0],
        force=log["u"],
        target_force=log["u_r"],
        parameters=p,
    )


@kernel
def _law(measured: Vector, reference: Vector, p: VlipRecord, thrust: Vector, force: Vector) -> None:
    """Thrust and contact force of the model under the projected law."""
    r = measured[:3] - p.foot
    u_r = centre_feedback(r, measured[:3], measured[3:6], reference, PROJECTED, p, thrust)
    thrust -= p.carry * (p.gravity - r * (r @ p.gravity / (r @ r)))
    leg_force(r, p.mass, p.gravity, thrust, u_r, np.zeros(3), force)


@kernel
def _derivative(x: Vector, reference: Vector, p: VlipRecord, out: Vector) -> None:
    thrust, force = np.empty(3), np.empty(3)
    _law(x, reference, p, thrust, force)
    out[:3] = x[3:]
    out[3:] = p.gravity + (thrust + force) / p.mass


@kernel
def _runge_kutta(measured: Vector, reference: Vector, p: VlipRecord, dt: float) -> None:
    """One classical fourth-order step of the closed loop with the reference held."""
    x = measured[:6]
    k1, k2, k3, k4 = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    _derivative(x, reference, p, k1)
    _derivative(x + 0.5 * dt * k1, reference, p, k2)
    _derivative(x + 0.5 * dt * k2, reference, p, k3)
    _derivative(x + dt * k3, reference, p, k4)
    x += dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
