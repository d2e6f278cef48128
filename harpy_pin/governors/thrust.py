"""The paper's thruster feedback: on the body's position, left/right allocation, limits
(equations.md E5–E7).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harpy_pin import checks
from harpy_pin.kernels import kernel
from harpy_pin.model.record import RecordOf, Records, make_record
from harpy_pin.model.state import Vector


@dataclass(frozen=True, kw_only=True)
class CentreGains(checks.Checked):
    """Gains of the feedback on the body's position; defaults are those of the 3D run.

    Attributes:
        k_pt: K_pt of the thrust, N/m; a scalar or one per axis.
        k_dt: K_dt of the thrust, N·s/m; a scalar or one per axis.
        k_pr: k_pr of the leg's radial command, 1/s².
        k_dr: k_dr of the leg's radial command, 1/s.
    """

    k_pt: float | tuple[float, float, float] = checks.setting(400.0, checks.fixed_gains)
    k_dt: float | tuple[float, float, float] = checks.setting(40.0, checks.fixed_gains)
    k_pr: float = checks.setting(0.0, low=0.0)
    k_dr: float = checks.setting(0.0, low=0.0)

    @property
    def record(self) -> Records[CentreGainsRecord]:
        """The gains, for kernels."""
        k_pt, k_dt = checks.gains("k_pt", self.k_pt), checks.gains("k_dt", self.k_dt)
        return make_record(CentreGainsRecord, k_pt=k_pt, k_dt=k_dt, k_pr=self.k_pr, k_dr=self.k_dr)


class CentreGainsRecord(RecordOf, CentreGains):
    """Gains of :class:`CentreGains`, those of the thrust per axis: (3,)."""

    k_pt: Vector  # type: ignore[assignment]
    k_dt: Vector  # type: ignore[assignment]


@dataclass(frozen=True, kw_only=True)
class AttitudeGains(checks.Checked):
    """Gains of the roll and yaw feedback, on the force of each thruster (equations.md §3).

    Attributes:
        k_p: N/rad; times the lever arm of both mounts, 0.2 m, this is 40 N·m/rad.
        k_d: N·s/rad.
    """

    whose = "attitude "
    k_p: float = checks.setting(200.0, low=0.0)
    k_d: float = checks.setting(20.0, low=0.0)


@kernel(r=(3,), c=(3,), c_dot=(3,), reference=(6,), out=(3,))
def centre_feedback(
    r: Vector,
    c: Vector,
    c_dot: Vector,
    reference: Vector,
    law: int,
    gains: CentreGainsRecord,
    out: Vector,
) -> float:
    """Thrust u_t,c, N, into ``out``, and radial command u_r, m²/s², which is returned (equations.md
    E5, E6).

    u_t,c = (I − Y)(K_pt e + K_dt ė) with Y = r̂ r̂ᵀ (projected law) or Y = 0 (full law);
    u_r = rᵀ(k_pr e + k_dr ė), with r = c − u, m, in world axes, and the reference [c_w; ċ_w].
    """
    e, e_dot = reference[:3] - c, reference[3:] - c_dot
    out[:] = gains.k_pt * e + gains.k_dt * e_dot
    if law == 0:
        out -= r * (r @ out) / np.maximum(r @ r, 1e-24)  # a body on the foot has no direction
    return float(r @ (gains.k_pr * e + gains.k_dr * e_dot))


@kernel(rotation=(3, 3), angular_velocity=(3,), out=(4,))
def roll_yaw(rotation: Vector, angular_velocity: Vector, out: Vector) -> None:
    """Roll φ and yaw ψ of the body (z-y-x angles) and their rates into ``out``, [φ, ψ, φ̇, ψ̇], rad
    and rad/s.

    The rotation is from the body to the world, the angular velocity in body axes, rad/s.
    """
    sin_pitch = min(max(-rotation[2, 0], -1.0), 1.0)
    cos_pitch = max(np.sqrt(1.0 - sin_pitch * sin_pitch), 1e-6)
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    spin = (np.sin(roll) * angular_velocity[1] + np.cos(roll) * angular_velocity[2]) / cos_pitch
    out[:] = roll, yaw, angular_velocity[0] + sin_pitch * spin, spin


@kernel(centre=(3,), rotation=(3, 3), angles=(4,), out=(2, 3))
def allocate(
    centre: Vector, rotation: Vector, angles: Vector, k_p: float, k_d: float, out: Vector
) -> None:
    """Left and right thrust from u_t,c and the roll and yaw feedback (paper, left/right split;
    equations.md E7).

    u_t,l = u_t,c/2 + R [u_yaw, 0, u_roll], u_t,r = u_t,c/2 − R [u_yaw, 0, u_roll], with u_roll = −k
    φ − d φ̇ and u_yaw = k ψ + d ψ̇ for mounts on the left (+y) and right of the body, with the
    gains k, N/rad, and d, N·s/rad, and the angles of :func:`roll_yaw`. Thrusts are in world axes,
    N.
    """
    u_roll = -k_p * angles[0] - k_d * angles[2]
    u_yaw = k_p * angles[1] + k_d * angles[3]
    difference = rotation @ np.array([u_yaw, 0.0, u_roll])
    out[0] = 0.5 * centre + difference
    out[1] = 0.5 * centre - difference


@kernel(thrust=("n", 3))
def limit_thrust(thrust: Vector, limit: float) -> bool:
    """Shorten, in place, each thrust beyond the limit, N; its direction stays. Returns whether any
    was shortened.
    """
    limited = False
    for k in range(thrust.shape[0]):
        norm = np.sqrt(thrust[k] @ thrust[k])
        if norm > limit:
            limited = True
            thrust[k] *= limit / norm
    return limited
