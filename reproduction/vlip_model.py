"""The VLIP: the force along its leg, the row on the leg's angle, and rows on a reference w = (θ, φ,
l, θ̇, φ̇, l̇).
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from harpy_pin import checks
from harpy_pin.arguments import checked
from harpy_pin.governors.rows import ConstraintRows, check_outputs
from harpy_pin.kernels import kernel
from harpy_pin.model.memory import KeepsViews
from harpy_pin.model.state import Vector


class PolarRows(KeepsViews):
    """Rows on a Cartesian reference [c_w; ċ_w], seen from a polar one: h(x, c(w)), J_w = J_c ∂c/∂w
    (chain rule).

    Args:
        rows: on [c_w; ċ_w].
    """

    @checked
    def __init__(self, rows: ConstraintRows) -> None:
        self.rows = rows
        self.names: tuple[str, ...] = rows.names
        self._cartesian = np.zeros(6)
        self._derivative = np.zeros((6, 6))
        self._jacobian = np.zeros((len(self.names), 6))

    def evaluate(self, x: Vector, w: Vector, h: Vector, jacobian: Vector) -> None:
        """See :class:`harpy_pin.governors.rows.ConstraintRows`."""
        check_outputs(len(self.names), x, w, h, jacobian)
        polar_to_cartesian(w, x[6:9], self._cartesian, self._derivative)
        self.rows.evaluate(x, self._cartesian, h, self._jacobian)
        np.matmul(self._jacobian, self._derivative, out=jacobian)


class AngleRow(KeepsViews):
    """Least angle of the leg from the vertical, of the reference: θ(c_w − u) − θ_min ≥ 0 (paper,
    VLIP constraints).

    Args:
        min_angle: θ_min, rad (the paper's 5° by default).
    """

    of_the_paper: ClassVar[bool] = True
    names: tuple[str, ...] = ("leg angle",)

    def __init__(self, *, min_angle: float = float(np.deg2rad(5.0))) -> None:
        self.min_angle = checks.number("min_angle", min_angle, low=0.0, high=float(np.pi / 2))

    def evaluate(self, x: Vector, w: Vector, h: Vector, jacobian: Vector) -> None:
        """See :class:`~harpy_pin.governors.ConstraintRows`. At θ = 0 there is no gradient; it is
        set to zero (W8).
        """
        check_outputs(1, x, w, h, jacobian)
        angle_row(x, w, self.min_angle, h, jacobian)


class PolarAngleRow(AngleRow):
    """θ_w − θ_min ≥ 0, without the singularity that the Cartesian form has at θ = 0 (equations.md
    W8).

    Args:
        min_angle: θ_min, rad (the paper's 5° by default).
    """

    def evaluate(self, x: Vector, w: Vector, h: Vector, jacobian: Vector) -> None:
        """See :class:`harpy_pin.governors.rows.ConstraintRows`."""
        check_outputs(len(self.names), x, w, h, jacobian)
        h[0] = w[0] - self.min_angle
        jacobian[0] = 0.0
        jacobian[0, 0] = 1.0


@kernel(w=(6,), foot=(3,), out=(6,), derivative=(6, 6))
def polar_to_cartesian(w: Vector, foot: Vector, out: Vector, derivative: Vector) -> None:
    """[c; ċ] of a polar reference, c = u + l (sinθ cosφ, sinθ sinφ, cosθ), and its derivative.

    Args:
        w: (6,) θ, φ (rad), l (m) and their rates.
        foot: (3,) u, m.
        out: (6,) [c; ċ], m and m/s.
        derivative: (6, 6) ∂[c; ċ]/∂w out.
    """
    st, ct = np.sin(w[0]), np.cos(w[0])
    sp, cp = np.sin(w[1]), np.cos(w[1])
    length = w[2]
    derivative[:, :] = 0.0
    # Columns of ∂c/∂(θ, φ, l).
    a = derivative[:3, :3]
    a[:, 0] = length * ct * cp, length * ct * sp, -length * st
    a[:, 1] = -length * st * sp, length * st * cp, 0.0
    a[:, 2] = st * cp, st * sp, ct
    # Second derivatives times the rates: ∂ċ/∂(θ, φ, l).
    t, p, r = w[3], w[4], w[5]
    b = derivative[3:, :3]
    b[:, 0] = (
        -length * st * cp * t - length * ct * sp * p + ct * cp * r,
        -length * st * sp * t + length * ct * cp * p + ct * sp * r,
        -length * ct * t - st * r,
    )
    b[:, 1] = (
        -length * ct * sp * t - length * st * cp * p - st * sp * r,
        length * ct * cp * t - length * st * sp * p + st * cp * r,
        0.0,
    )
    b[:, 2] = ct * cp * t - st * sp * p, ct * sp * t + st * cp * p, -st * t
    out[:3] = foot + length * a[:, 2]
    out[3:] = a @ w[3:]
    derivative[3:, 3:] = a


@kernel(x=(9,), w=(6,), h=(1,), jacobian=(1, 6))
def angle_row(x: Vector, w: Vector, least: float, h: Vector, jacobian: Vector) -> None:
    """Angle of the leg from the vertical above its least value."""
    rx, ry, rz = w[0] - x[6], w[1] - x[7], w[2] - x[8]
    radial = np.hypot(rx, ry)
    squared = max(radial * radial + rz * rz, 1e-24)  # a reference on the foot has no direction
    h[0] = np.arctan2(radial, rz) - least
    jacobian[0, :] = 0.0
    if radial > 0.0:
        jacobian[0, 0] = rz * rx / (radial * squared)
        jacobian[0, 1] = rz * ry / (radial * squared)
    jacobian[0, 2] = -radial / squared


@kernel(r=(3,), gravity=(3,), thrust=(3,), cop_acceleration=(3,))
def multiplier(
    r: Vector, mass: float, gravity: Vector, thrust: Vector, u_r: float, cop_acceleration: Vector
) -> float:
    """Lagrange multiplier λ of the leg constraint J_s (c̈ − ü) = u_r with J_s = rᵀ (paper, eq. of
    λ; equations.md E4).

    Args:
        r: (3,) c − u, m.
        mass: m, kg.
        gravity: (3,) gravity vector, m/s².
        thrust: (3,) u_t,c, N.
        u_r: radial command r·c̈, m²/s² (equations.md E6).
        cop_acceleration: (3,) ü, m/s².

    Returns:
        λ, N/m: the contact force is r λ.
    """
    squared = np.maximum(r @ r, 1e-24)  # a body on the foot has no direction
    s = u_r + r @ (cop_acceleration - gravity - thrust / mass)
    return float(s * mass / squared)


@kernel(r=(3,), gravity=(3,), thrust=(3,), cop_acceleration=(3,), out=(3,))
def leg_force(
    r: Vector,
    mass: float,
    gravity: Vector,
    thrust: Vector,
    u_r: float,
    cop_acceleration: Vector,
    out: Vector,
) -> None:
    """Contact force u_g = J_sᵀ λ of the model, N (paper, eq. of u_g); arguments as
    :func:`multiplier`.

    Args:
        out: (3,) force on the body, world axes, N.
    """
    out[:] = multiplier(r, mass, gravity, thrust, u_r, cop_acceleration) * r
