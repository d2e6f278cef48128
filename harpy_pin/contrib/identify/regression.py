"""Robust regression for the numbers of joints whose equations may share rows.

The torque τ that a motor reports is, with ``known`` what the rigid model needs,

    τ(t − d) = (known + I a + D v + F s − b) / k.

It is linear in 1 / k, I / k and so on, but not in the delay d. On its feet a robot has rows with
shares e_j of several joints, and with a payload:

    Σ_j e_j k_j τ_j(t − d_j) = known + payload · p + Σ_j e_j (I_j a_j + D_j v_j + F_j s_j − b_j).

A line search finds the delay first, one for all joints of the rows; steps of Gauss and Newton then
find each joint's.

Least squares would be biased: noise of encoders is in the accelerations, and in the torques that
answer to it. The two halves A₁ and A₂ of the log (:mod:`harpy_pin.contrib.identify.signals`) have
independent noise, so each is the other's instrument. With a prior of precision P about x₀, and
noise of variance σ² in a row,

    (N / σ² + P) x = (A₁ᵀ W y₂ + A₂ᵀ W y₁) / 2 σ² + P x₀,   N = (A₁ᵀ W A₂ + A₂ᵀ W A₁) / 2.

Weights W are Huber's. Standard errors are those of blocks of the log (the sandwich estimate), so
that what is left may be correlated in time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harpy_pin.contrib.identify.equations import Rows
from harpy_pin.contrib.identify.signals import Samples
from harpy_pin.model.state import Vector

NUMBERS = ("torque_scale", "bias", "armature", "damping", "friction", "delay")
"""Of each joint, in the order of the unknowns."""
POSITIVE = ("armature", "damping", "friction")
DELAYS = np.arange(-0.004, 0.0241, 0.002)  # where the line search looks, s
STEPS, FIRST, SETTLED = 15, 4, 1e-6
"""Of Gauss, Newton and the weights, at most; how many may pass negative numbers; and change of the
delays at which they end, s.
"""
HUBER = 3.0
"""Residual from which on its weight falls, in standard deviations. It is far out: weights that know
the noise of both halves would make them depend on each other.
"""
BLOCK = 1.0  # length of the blocks, s
ALIKE = 0.05
"""Share of the rms that both halves of the log leave unexplained, which no noise is, that may look
like a number.
"""
WIDEST = 100.0
"""Standard deviation of what is not known before, as an effect over the torque in the log."""
NEVER = 1e9  # the same precision of a number that is held at zero because it came out negative


@dataclass(frozen=True, eq=False)
class Solution:
    """What rows say.

    Attributes:
        values: (6 joints + payload,) in the order of :data:`NUMBERS`, joint after joint.
        covariance: of them.
        negative: of what came out negative and is held at zero, the rms of its part as a share of
            that of what is measured.
        measured: (rows,) the logged torques as the numbers correct them, N·m or N.
        predicted: (rows,) the same by motion and numbers.
    """

    values: Vector
    covariance: Vector
    negative: Vector
    measured: Vector
    predicted: Vector

    @property
    def error(self) -> Vector:
        """Standard errors; infinite of what is held at zero."""
        return np.where(self.negative > 0.0, np.inf, np.sqrt(np.diag(self.covariance)))

    @property
    def size(self) -> float:
        """Rms of what is measured, N·m or N; NaN of no row."""
        return float(np.sqrt(np.mean(self.measured**2))) if len(self.measured) else np.nan

    @property
    def left(self) -> float:
        """Rms of what is not explained over that of what is measured."""
        rest = self.measured - self.predicted
        return float(np.sqrt(np.mean(rest**2))) / self.size if len(rest) else np.nan


def columns(samples: Samples, rows: Rows, delay: Vector) -> tuple[Vector, Vector, Vector]:
    """(2, rows, 6 joints + payload) matrix, (2, rows) left side, the torques less what is known,
    and (2, rows) torques, for (len(joints),) delays.

    The column of a scale k is that of k − 1, of a single joint of 1 / k − 1; of a delay that of its
    change.
    """
    matrix, torques, alone = [], [], len(rows.joints) == 1
    for half, known, payload in zip(samples.halves, rows.known, rows.payload, strict=True):
        parts, total = [], np.zeros(len(known))
        for k, j in enumerate(rows.joints):
            share = rows.select[:, k]
            motion = half.a[:, 6 + j], half.v[:, 6 + j], half.sign[:, j]
            torque, rate, *of_joint = (
                share * x[rows.sample] for x in (*half.torque(j, delay[k]), *motion)
            )
            total = total + torque
            parts += [known if alone else -torque, -share, *of_joint, rate]
        matrix.append(np.hstack((np.array(parts).T, payload)))
        torques.append(total)
    return np.array(matrix), np.array(torques) - rows.known, np.array(torques)


def solve(samples: Samples, rows: Rows, prior: Vector, precision: Vector) -> Solution:
    """The numbers of these rows.

    Args:
        samples: of the log.
        rows: their equations.
        prior: (6 joints + payload,) most probable values before the log is seen, scales less one.
        precision: of them, the inverse of their covariance.
    """
    many = len(rows.joints)
    kind = np.array([*NUMBERS * many, *["payload"] * rows.payload.shape[2]])
    late, scale, weight = kind == "delay", kind == "torque_scale", np.ones(len(rows.sample))
    taken = scale & (many > 1)  # masses are such as well: both scaled up are the same
    x, costs = prior.copy(), []
    for delay in DELAYS if many == 1 else ():
        matrix, left, _ = columns(samples, rows, np.full(many, delay))
        matrix[:, :, late] = 0.0
        trial, _ = _solved(matrix, left, weight, np.mean(left**2), prior, precision)
        costs.append(np.prod(left - matrix @ trial, axis=0).sum())  # noise of the halves drops out
    x[late] = DELAYS[int(np.argmin(costs))] if costs else x[late]
    negative, noise = np.zeros(len(x)), np.inf
    for step in range(STEPS):
        before = np.where(late, x, 0.0)
        matrix, left, torques = columns(samples, rows, x[late])
        noise = min(noise, np.mean(left**2))
        held = np.diag(
            np.where(taken | (negative > 0.0), NEVER * np.mean(matrix**2, axis=(0, 1)) / noise, 0.0)
        )
        x, inverse = _solved(
            matrix,
            left + matrix @ before,
            weight,
            noise,
            np.where(negative > 0.0, 0.0, prior),
            precision + held,
        )
        sign = 1.0 + x[0] if many == 1 else 1.0
        below = np.isin(kind, POSITIVE) & (x * sign < 0.0) & (step >= FIRST) & (negative == 0.0)
        effect = np.abs(x) * np.sqrt(np.mean(matrix[0] ** 2, axis=0) / np.mean(torques**2))
        negative = np.where(below, effect, negative)
        x[late] = np.clip(x[late], *DELAYS[[0, -1]])
        residual = left - matrix @ (x - before)
        size = np.abs(residual.mean(axis=0))
        weight = 1.0 / np.maximum(1.0, size / (HUBER * 1.4826 * np.median(size) + 1e-12))
        noise = float(np.mean(weight * residual**2)) + 1e-12
        if step > FIRST and not below.any() and np.abs(x - before)[late].max() < SETTLED:
            break
    # The sandwich: scores of blocks, what no noise is, and the prior.
    block = np.floor(samples.t[rows.sample] / BLOCK)
    scores = 0.5 * sum(matrix[h] * (weight * residual[1 - h])[:, None] for h in (0, 1))
    scores = np.add.reduceat(scores, np.flatnonzero(np.diff(block, prepend=-np.inf)), axis=0)
    lacks = max(float(np.sum(weight * residual[0] * residual[1])), 0.0)  # noise drops out
    between = _between(matrix, weight)
    meat = (scores.T @ scores + ALIKE**2 * lacks * between) / noise**2 + precision
    covariance = inverse @ meat @ inverse
    if many > 1:
        effect = inverse @ between[:, taken] / noise
        covariance += effect @ np.linalg.inv(precision[np.ix_(taken, taken)]) @ effect.T
    measured, rest = torques.mean(axis=0), residual.mean(axis=0)
    if many == 1:  # from 1 / k - 1, I / k, ... to k, I, ...
        k = 1.0 / (1.0 + x[0])
        slope = np.diag(np.where(late, 1.0, k))
        slope[:, 0] = np.where(late, 0.0, -x * k**2)
        slope[0, 0] = -(k**2)
        covariance = slope @ covariance @ slope.T
        x, measured, rest = np.where(scale, k, x * np.where(late, 1.0, k)), measured * k, rest * k
    else:
        x = x + scale
    return Solution(x, covariance, negative, measured, measured - rest)


def _between(matrix: Vector, weight: Vector) -> Vector:
    """The matrix N of both halves."""
    cross = matrix[0].T @ (weight[:, None] * matrix[1])
    return np.asarray(0.5 * (cross + cross.T))


def _solved(
    matrix: Vector, left: Vector, weight: Vector, noise: float, prior: Vector, precision: Vector
) -> tuple[Vector, Vector]:
    """The numbers by the weighted instruments and the prior, and (N / σ² + P)⁻¹."""
    weak = np.mean(matrix**2, axis=(0, 1)) / (WIDEST**2 * np.mean(left**2)) + 1e-12
    whole = _between(matrix, weight) / noise + precision + np.diag(weak)
    right = 0.5 * sum(matrix[h].T @ (weight * left[1 - h]) for h in (0, 1)) / noise
    size = np.sqrt(np.abs(np.diag(whole)))
    inverse = np.linalg.inv(whole / size / size[:, None]) / size / size[:, None]
    return inverse @ (right + precision @ prior), inverse
