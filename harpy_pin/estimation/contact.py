"""Contact forces from motor torques, and which feet touch the ground.

The rows of the equations of motion that belong to the joints leave over the torques of the contact
forces,

    τ_f = M a + n + D v − τ − J_tᵀ u,

with the acceleration of the body from the accelerometer and those of the joints from two measured
velocities. A low-pass of the rate K makes of it the observer of the generalised momentum (De Luca
and Mattone, ICRA 2003): the difference of velocities, low-passed, is no noisier than they are. The
joints j that a leg shares with no other one give the least forces that explain their torques, f =
J_j (J_jᵀ J_j + ε)⁻¹ τ_j.

The log-odds that a foot touches add up: of its normal force, (f_z / weight − load) / width; of the
gait, which expects it on the ground or not (less surely a landing than a lift-off, which it
commands); and of its speed, which no foot in contact has. For the gait a foot has also landed that
is at rest where the ground is, late in its swing; the filter holds on to it when it carries load.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.estimation.record import ContactRecord
from harpy_pin.kernels import kernel
from harpy_pin.model.cholesky import factorise, solve_vector
from harpy_pin.model.dynamics import DynamicsRecord
from harpy_pin.model.state import Vector
from harpy_pin.model.terms import inverse_dynamics

EARLIEST, LATEST = 0.3, 0.5
"""Shares of a swing between which the gait begins to expect the touchdown."""
LIKELY = 0.5
"""Probability from which on a foot is in contact."""
LIFTED = 0.05
"""Share of a swing from which on a foot has left the ground."""
MEMORY = 2.0
"""Time constant of the forgetting, s of swing."""
KNEE = 0.1
"""Velocity at which dry friction is mostly there, rad/s."""
RIDGE = (1e5, 100.0, 10.0)
"""Sums of squares of acceleration, velocity and sign that draw the fit half-way to zero."""
SWEEPS = 4
"""Of the fit at each step; the next step goes on from there."""
CERTAIN = 30.0
"""Largest log-odds."""


@kernel
def observe_torques(
    c: ContactRecord, d: DynamicsRecord, v: Vector, torque: Vector, thrust: Vector, period: float
) -> None:
    """Low-pass the joint torques of the contact forces, at the state and acceleration of this step.

    ``torque`` (joints,), N·m, and ``thrust`` (thrust variables,), N, are those since the last step.
    """
    weight, left = 1.0 - np.exp(-c.rate * period), c.left
    inverse_dynamics(d.tree, v, c.acceleration, left)  # M a + n
    left[6:] += d.damping[6:] * c.velocity[6:] - torque
    if thrust.shape[0] > 0:
        left -= thrust @ d.thruster_jacobian
    c.residual += weight * (left[6:] - c.residual)
    c.motion[:, 0] += weight * (c.acceleration[6:] - c.motion[:, 0])
    c.motion[:, 1] += weight * (c.velocity[6:] - c.motion[:, 1])
    c.motion[:, 2] += weight * (np.tanh(c.velocity[6:] / KNEE) - c.motion[:, 2])
    c.external[:] = c.residual + np.sum(c.joint * c.motion, axis=1)


@kernel
def learn_joints(c: ContactRecord, stance: Vector, phase: Vector, period: float) -> None:
    """Fit what the model of the joints lacks, where the gait says that a leg swings and touches
    nothing.
    """
    keep = 1.0 - min(period / MEMORY, 1.0)
    for leg in range(c.leg_joints.shape[0]):
        there = c.leg_feet[leg] >= 0
        k = np.where(there, c.leg_feet[leg], 0)
        away = (stance[k] == 0.0) & (phase[k] > LIFTED) & (phase[k] < EARLIEST)
        swings = np.all(np.where(there, away, True))
        for i in range(c.leg_joints.shape[1]):
            j = c.leg_joints[leg, i] - 6
            if swings and j >= 0:
                _fit_joint(c.motion[j], -c.residual[j], c.sums[j], c.joint[j], keep)


@kernel
def _fit_joint(x: Vector, y: float, s: Vector, found: Vector, keep: float) -> None:
    """Least squares with forgetting, y = found · x, drawn to zero; none of the three is
    negative.
    """
    s *= keep
    s[:3] += x[0] * x
    s[3:5] += x[1] * x[1:]
    s[5] += x[2] * x[2]
    s[6:] += y * x
    a, b, c = s[0] + RIDGE[0], s[3] + RIDGE[1], s[5] + RIDGE[2]
    for _ in range(SWEEPS):  # Gauss–Seidel on the bounded problem
        found[0] = max((s[6] - s[1] * found[1] - s[2] * found[2]) / a, 0.0)
        found[1] = max((s[7] - s[1] * found[0] - s[4] * found[2]) / b, 0.0)
        found[2] = max((s[8] - s[2] * found[0] - s[4] * found[1]) / c, 0.0)


@kernel
def leg_forces(c: ContactRecord, d: DynamicsRecord) -> None:
    """The forces of every leg's feet, world axes: J (Jᵀ J + damping)⁻¹ τ."""
    joints, feet = c.leg_joints.shape[1], c.leg_feet.shape[1]
    for leg in range(c.leg_joints.shape[0]):
        jacobian, there = np.zeros((3 * feet, joints)), c.leg_joints[leg] >= 0
        column = np.where(there, c.leg_joints[leg], 6)
        torque = np.where(there, c.external[column - 6], 0.0)
        for n in range(feet):
            k = c.leg_feet[leg, n]
            if k >= 0:
                own = d.foot_jacobian[3 * k : 3 * k + 3, column]
                jacobian[3 * n : 3 * n + 3] = np.where(there, own, 0.0)
        normal = jacobian.T @ jacobian + c.damping * np.eye(joints)
        factorise(normal, normal)
        solve_vector(normal, torque)
        for n in range(feet):
            if c.leg_feet[leg, n] >= 0:
                c.force[c.leg_feet[leg, n]] = jacobian[3 * n : 3 * n + 3] @ torque


@kernel
def contact_probability(
    c: ContactRecord, d: DynamicsRecord, stance: Vector, phase: Vector, ground_height: Vector
) -> None:
    """Probability that each foot touches the ground.

    ``stance``, ``phase`` and ``ground_height`` (feet,), m, are the gait's, of
    :class:`~harpy_pin.gaits.gait.GaitTarget`; a stance of 0.5 expects nothing.
    """
    for k in range(c.force.shape[0]):
        expected = stance[k]
        if expected == 0.0:
            expected = min(max((phase[k] - EARLIEST) / (LATEST - EARLIEST), 0.0), 1.0)
        square = d.foot_velocity[k] @ d.foot_velocity[k]
        odds = (c.force[k, 2] / c.weight[k] - c.load) / c.load_width + c.prior * (
            3.0 * expected - 2.0
        )
        c.loaded[k] = 1 if odds > 0.0 else 0
        odds -= square / (c.foot_speed * c.foot_speed)
        c.probability[k] = _logistic(odds)
        if (
            stance[k] == 0.0
            and expected == 1.0
            and abs(d.foot_position[k, 2] - ground_height[k]) < c.near
        ):
            odds += c.rest * max(1.0 - square / (c.rest_speed * c.rest_speed), 0.0)
        share = _logistic(odds)
        c.share[k] = 0.0 if c.of_sole[k] and share < LIKELY else share
        if (
            stance[k] == 0.0 and share >= LIKELY
        ):  # it has landed: it carries what such a foot does at least
            c.force[k, 2] = max(c.force[k, 2], c.load * c.weight[k])


@kernel
def _logistic(odds: float) -> float:
    """Probability of log-odds."""
    return float(1.0 / (1.0 + np.exp(-min(max(odds, -CERTAIN), CERTAIN))))
