"""The classical explicit reference governor: dynamic safety margin times navigation field.

Its setting is the model made exactly linear: K_pt = m k_pr, K_dt = m k_dr, gravity across the leg
compensated, and a reference that stands still (ċ_w = 0), so that c̈ = k_p (c_w − c) − k_d ċ along
every axis. With X = [c − c_w, ċ] (rows: position, velocity), A the closed loop of one axis and P
from AᵀP + P A = −diag(1, θ), V = Σ_axes Xᵀ P X decreases while c_w rests. Each constraint holds on
a level set V ≤ Γ(c_w):

    pyramid face     aᵀ(c − u) ≥ 0, |a| = 1      Γ = s² / (P⁻¹)₁₁,   s = aᵀ(c_w − u)
    leg length       L_min ≤ |c − u| ≤ L_max     the same with s = min(|c_w − u| − L_min, L_max −
    |c_w − u|) normal force     u_gz ≥ u_min                Γ = A² / (κᵀP⁻¹κ),  κ = (k_p, k_d)

For the last, inside the pyramid r̂_z ≥ z₀ = 1/√(1 + 2 μ²), and u_gz = m (g r̂_z + r̂ᵀc̈) r̂_z ≥ m
(g z₀ − |c̈|) z₀ as long as |c̈| ≤ g z₀, so A = g z₀ − u_min/(m z₀).

The margin is Γ − V with the least Γ, and ċ_w = κ_m (Γ − V) ρ(c_r, c_w), ρ the attraction to the
target plus a push away from near constraints (Garone and Nicotra 2016). Per tick the step is taken
only as far as V(x, c_w⁺) ≤ Γ(c_w⁺): hence V ≤ Γ at every tick, between ticks V falls, and no
constraint is ever violated. That is a proof for this model, not for the robot.
"""

from __future__ import annotations

import numpy as np

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.governors.governor import GovernorStatus, check_update
from harpy_pin.kernels import kernel
from harpy_pin.model.entry import all_possible
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.record import RecordOf, field, make_record, sized
from harpy_pin.model.state import Vector

GAIN = 20.0
"""κ_m, of the margin (relative to the normal force's Γ), 1/s."""
SMOOTHING = 0.01
"""η, distance to the target within which the attraction fades, m."""
INFLUENCE, LEAST_SLACK = 0.05, 0.005
"""Slacks ζ, under which a constraint repels, and δ, at which it repels with the strength of the
attraction, m.
"""


class MarginRecord(RecordOf):
    """What the kernels of :class:`MarginGovernor` know and work in.

    Attributes:
        p_11, p_12, p_22: entries of the Lyapunov function's matrix P.
        inverse_11: (P⁻¹)₁₁.
        normal_level: Γ of the normal force.
        mu: μ_s.
        shortest: leg, m.
        longest: leg, m.
        newtons: per metre of slack, N/m.
        slack: (5,) of the faces and the leg, m.
        normals: (5, 3) directions away from them.
        field: (3,) ρ.
        trial: (3,) a trial of c_w, m.
        applied: (6,) [c_w; 0].
        rate: (6,) of ``applied``.
        h_r: (6,) rows at the target, N.
        h_w: (6,) rows at the applied reference, N.
    """

    p_11: float
    p_12: float
    p_22: float
    inverse_11: float
    normal_level: float
    mu: float
    shortest: float
    longest: float
    newtons: float
    slack: Vector = sized(5)
    normals: Vector = sized(5, 3)
    field: Vector = sized(3)
    trial: Vector = sized(3)
    applied: Vector = sized(6)
    rate: Vector = sized(6)
    h_r: Vector = sized(6)
    h_w: Vector = sized(6)


class MarginGovernor(KeepsViews):
    """Explicit reference governor with a proof, on the exactly linear model.

    Args:
        mass: m, kg.
        mu: friction coefficient μ_s.
        k_p: along every axis, 1/s².
        k_d: 1/s.
        min_normal_force: u_min, N.
        leg: shortest and longest leg, m.
        g: magnitude of gravity, m/s².

    Attributes:
        applied: (6,) [c_w; 0].
        status: of the last update, rows in N: the slacks of faces and leg as V-margins times m k_p.

    Raises:
        InputError: a number out of its domain, or no reference at all can hold the normal force.
    """

    def __init__(
        self,
        *,
        mass: float,
        mu: float,
        k_p: float,
        k_d: float,
        min_normal_force: float = 20.0,
        leg: tuple[float, float] = (0.1, 0.7),
        g: float = 9.81,
    ) -> None:
        mass = checks.number("mass", mass, low=0.0, strict=True)
        mu = checks.number("mu", mu, low=0.0)
        k_p = checks.number("k_p", k_p, low=0.0, strict=True)
        k_d = checks.number("k_d", k_d, low=0.0, strict=True)
        upright = 1.0 / np.sqrt(1.0 + 2.0 * mu * mu)
        allowed = checks.number("g", g, low=0.0, strict=True) * upright
        allowed -= checks.number("min_normal_force", min_normal_force, low=0.0) / (mass * upright)
        if allowed <= 0.0:
            raise InputError(
                f"{mass:g} kg cannot keep a normal force of {min_normal_force:g} N everywhere in a "
                f"cone of {mu:g}",
                name="min_normal_force",
                value=min_normal_force,
            )
        lyapunov = _best_lyapunov(k_p, k_d)
        inverse = np.linalg.inv(lyapunov)
        slope = np.array([k_p, k_d])
        self._record = make_record(
            MarginRecord,
            p_11=lyapunov[0, 0],
            p_12=lyapunov[0, 1],
            p_22=lyapunov[1, 1],
            inverse_11=inverse[0, 0],
            normal_level=allowed**2 / float(slope @ inverse @ slope),
            mu=mu,
            shortest=checks.number("leg[0]", leg[0], low=0.0),
            longest=checks.number("leg[1]", leg[1], low=leg[0], strict=True),
            newtons=mass * k_p,
        )
        names = ("friction +x", "friction -x", "friction +y", "friction -y", "leg", "normal force")
        self.applied: Vector = field(self._record, "applied")
        h_r, h_w, rate = (field(self._record, name) for name in ("h_r", "h_w", "rate"))
        self.status = GovernorStatus(names, h_r, h_w, rate)

    def reset(self, x_r: Vector) -> None:
        """Start over with c_w = c_r, at rest. It should be inside the constraints: from outside
        nothing is promised.

        Args:
            x_r: (6,) target reference [c_t; ċ_t], m and m/s.
        """
        self.applied[:3] = checks.vector("x_r", x_r, 6)[:3]
        self.applied[3:] = 0.0
        self.status.bad_samples = 0

    def update(self, x: Vector, x_r: Vector, dt: float) -> Vector:
        """See :class:`harpy_pin.governors.governor.Governor`; the target's velocity is not used."""
        s = self.status
        try:
            margin = _margin_update(x, x_r, dt, self._record)
        except Exception:
            check_update(x, x_r, 6, dt)
            raise
        if margin == -np.inf:
            check_update(x, x_r, 6, dt)
            s.bad()
            return self.applied
        s.infeasible = margin < 0.0
        s.least_violation = max(-float(s.h_w.min()), 0.0) if s.infeasible else 0.0
        return self.applied


def _best_lyapunov(k_p: float, k_d: float) -> Vector:
    """(2, 2) P that lets the reference run furthest ahead under a bound on the acceleration: least
    (κᵀP⁻¹κ) P₁₁.
    """
    from scipy.linalg import solve_continuous_lyapunov  # here: a walk need not wait for it

    loop = np.array([[0.0, 1.0], [-k_p, -k_d]])
    slope = np.array([k_p, k_d])
    best, chosen = np.inf, np.eye(2)
    for theta in np.logspace(-8, 2, 401):
        p = solve_continuous_lyapunov(loop.T, -np.diag([1.0, theta]))
        cost = float(slope @ np.linalg.solve(p, slope) * p[0, 0])
        if cost < best:
            best, chosen = cost, p
    return np.asarray(chosen)


@kernel
def _slacks(x: Vector, w: Vector, p: MarginRecord) -> None:
    """Distances of the steady state to faces and leg limits, m, and the directions away from
    them.
    """
    slack, normals, r = p.slack, p.normals, w[:3] - x[6:9]
    scale = 1.0 / np.sqrt(1.0 + p.mu * p.mu)
    normals[:4] = 0.0
    for k in range(4):
        axis = 0 if k < 2 else 1
        sign = -scale if k % 2 == 0 else scale
        normals[k, axis] = sign
        normals[k, 2] = p.mu * scale
        slack[k] = sign * r[axis] + p.mu * scale * r[2]
    length = np.sqrt(r @ r)
    side = 1.0
    slack[4] = length - p.shortest
    if p.longest - length < slack[4]:
        slack[4], side = p.longest - length, -1.0
    normals[4] = r * (side / np.maximum(length, 1e-12))


@kernel
def _margin(x: Vector, w: Vector, p: MarginRecord) -> tuple[float, float]:
    """Γ(c_w) − V(x, c_w), negative also where the steady state violates a constraint; V. Fills the
    slacks.
    """
    _slacks(x, w, p)
    e, v = x[:3] - w[:3], x[3:6]
    energy = np.sum(p.p_11 * e * e + 2.0 * p.p_12 * e * v + p.p_22 * v * v)
    level = min(p.normal_level, np.min(p.slack * np.abs(p.slack)) / p.inverse_11)
    return level - energy, energy


@kernel
def _possible(x: Vector, x_r: Vector, dt: float) -> bool:
    """Whether a measured state and a target have the right sizes and possible numbers, and dt is a
    time.
    """
    if x.shape != (9,) or x_r.shape != (6,) or not 0.0 <= dt < np.inf:
        return False
    return all_possible(x) and all_possible(x_r)


@kernel
def _margin_update(x: Vector, x_r: Vector, dt: float, p: MarginRecord) -> float:
    """One tick; returns the dynamic safety margin at the applied reference (negative: no
    promise).
    """
    x_w = p.applied
    if not _possible(x, x_r, dt):
        p.rate[:] = 0.0
        return -np.inf  # a reading that is no number: the reference stays
    # What c_r would ask.
    _, energy = _margin(x, x_r, p)
    _margin_rows(p, energy, p.h_r)
    margin, _ = _margin(x, x_w, p)
    _navigation(x_r, x_w, p)
    # κ_m relative to the normal force's level, times the distance that this level allows.
    speed = GAIN * max(margin, 0.0) / p.normal_level * np.sqrt(p.normal_level / p.p_11)
    share = _largest_share(x, x_w, dt, speed, p)
    step = share * dt * speed * p.field
    x_w[:3] += step
    p.rate[:3] = step / dt if dt > 0.0 else 0.0
    margin, energy = _margin(x, x_w, p)
    _margin_rows(p, energy, p.h_w)
    return margin


@kernel
def _navigation(x_r: Vector, x_w: Vector, p: MarginRecord) -> None:
    """Navigation field ρ: attraction to the target, and a push away from near constraints."""
    p.field[:] = x_r[:3] - x_w[:3]
    p.field /= np.maximum(np.sqrt(p.field @ p.field), SMOOTHING)
    for k in range(5):
        if p.slack[k] < INFLUENCE:
            p.field += (INFLUENCE - p.slack[k]) / (INFLUENCE - LEAST_SLACK) * p.normals[k]


@kernel
def _largest_share(x: Vector, x_w: Vector, dt: float, speed: float, p: MarginRecord) -> float:
    """Share of the step, halved until the margin holds after it; zero where it never does."""
    share = 1.0
    for _ in range(8):
        p.trial[:] = x_w[:3] + share * dt * speed * p.field
        after, _ = _margin(x, p.trial, p)
        if after >= 0.0:
            return share
        share *= 0.5
    return 0.0


@kernel
def _margin_rows(p: MarginRecord, energy: float, h: Vector) -> None:
    """Rows in N: how much further the level set reaches to a constraint, in metres, times m k_p."""
    reach = np.sqrt(energy * p.inverse_11)
    h[:5] = p.newtons * (p.slack - reach)
    h[5] = p.newtons * (np.sqrt(p.normal_level) - np.sqrt(energy)) * np.sqrt(p.inverse_11)
