"""What gives way where motors are at their limits.

A motor that cannot follow a swing foot would otherwise make the body pay: the swing task's weight
is several times that of the body, and its error grows with the square of what is missing. So where
the optimum without limits of thrusts and torques needs torques τ° beyond theirs, the problem that
is solved with all limits has

- for a swing foot, only the share σ of its weight. σ falls from one to ``give_way`` while the
  largest |τ°| / τ_max of the joints that move the foot grows from 1 to 1 + ``SPAN``, so that
  nothing jumps.
- for a stance foot, ρ f_min in place of f_min, ρ = min τ_max / max(|τ°|, τ_max) over the joints
  that move the foot: a leg whose motors would need twice their limits has to bear half of the least
  force.

No torque at its limit: the problem, and every digit of its solution, are those without all this.
Both WBCs give way alike.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.kernels import ByPrecision, kernel
from harpy_pin.model.dynamics import EquationsRecord
from harpy_pin.model.state import Vector
from harpy_pin.wbc.targets import ProblemRecord

SPAN = 0.1
"""Excess of a torque over its limit, as a share of it, over which swing feet give way."""
NEAR = ByPrecision(1e-6, single=1e-3)
"""Distance of a thrust or torque from its limit, N and N·m, at which the optimum without limits is
looked at.
"""


@kernel
def at_a_limit(inputs: Vector, p: ProblemRecord) -> bool:
    """Whether a thrust or torque is at its limit, or not a number."""
    inside = (p.input_lower + NEAR < inputs) & (inputs < p.input_upper - NEAR)
    return not np.all(inside)


@kernel
def outside(values: Vector, lower: Vector, upper: Vector) -> bool:
    """Whether one of the values is out of its range, or not a number."""
    n = values.shape[0]
    return not np.all((lower[:n] <= values) & (values <= upper[:n]))


@kernel
def share_of_swing(
    d: EquationsRecord, torque: Vector, limit: Vector, give_way: float, k: int
) -> float:
    """σ of a contact point, with ``give_way`` the least share; the others as of
    :func:`share_of_least_force`.
    """
    excess = 1.0 / share_of_least_force(d, torque, limit, k) - 1.0
    return 1.0 - (1.0 - give_way) * min(excess / SPAN, 1.0)


@kernel
def share_of_least_force(d: EquationsRecord, torque: Vector, limit: Vector, k: int) -> float:
    """ρ of a contact point; the torques are τ° and the limits τ_max, N·m."""
    moves = np.any(d.foot_jacobian[3 * k : 3 * k + 3, 6:] != 0.0, axis=0)
    beyond = moves & (abs(torque) > limit)
    return float(np.min(np.where(beyond, limit / abs(torque), 1.0)))
