"""Robust regression for the numbers of a joint.

The torque τ that its motor reports is, with ``known`` what the rigid model needs,

    τ(t − d) = (known + I a + D v + F s − b) / k.

It is linear in 1 / k, I / k and so on, but not in the delay d: a line search finds that first, then
steps of Gauss and Newton.

Least squares would be biased: noise of encoders is in the accelerations, and in the torques that
answer to it. The two halves A₁ and A₂ of the log (:mod:`harpy_pin.contrib.identify.signals`) have
independent noise, so each is the other's instrument. With a prior of precision P about x₀, and
noise of variance σ² in a row,

    (N / σ² + P) x = (A₁ᵀ W y₂ + A₂ᵀ W y₁) / 2 σ² + P x₀,   N = (A₁ᵀ W A₂ + A₂ᵀ W A₁) / 2.

Weights W are Huber's. Standard errors are those of blocks of the log (the sandwich estimate), so
that what is left may be correlated in time.
"""

from dataclasses import dataclass

import numpy as np

from harpy_pin.contrib.identify.equations import Rows
from harpy_pin.contrib.identify.signals import Samples
from harpy_pin.model.state import Vector

NUMBERS = ("torque_scale", "bias", "armature", "damping", "friction", "delay")
"""Of each joint, in the order of the unknowns."""
POSITIVE = slice(2, 5)
DELAYS = np.arange(-0.004, 0.0241, 0.002)  # where the line search looks, s
STEPS, FIRST, SETTLED = 15, 4, 1e-6
"""Of Gauss, Newton and the weights, at most; how many may pass negative numbers; and change of the
delay at which they end, s.
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
NEVER, WEAK = 1e12, 1e-12
"""Precision of a number that came out negative and is held at zero, and of one that nothing is
known of before, in a row's.
"""


@dataclass(frozen=True, eq=False)
class Solution:
    """What rows say.

    Attributes:
        values: in the order of :data:`NUMBERS`.
        error: standard errors of them; infinite of what is held at zero.
        negative: of what came out negative and is held at zero, the rms of its part as a share of
            that of the torque.
        measured: (rows,) the logged torques, N·m.
        predicted: (rows,) the same by these numbers.
    """

    values: Vector
    error: Vector
    negative: Vector
    measured: Vector
    predicted: Vector

    @property
    def size(self) -> float:
        """Rms of the torque, N·m; NaN of no row."""
        return float(np.sqrt(np.mean(self.measured**2))) if len(self.measured) else np.nan

    @property
    def left(self) -> float:
        """Rms of what is not explained over that of the torque."""
        rest = self.measured - self.predicted
        return float(np.sqrt(np.mean(rest**2))) / self.size if len(rest) else np.nan


def unknown() -> Solution:
    """Of a joint that hardly moves."""
    values = np.full(len(NUMBERS), np.nan)
    return Solution(values, values + np.inf, np.zeros(len(NUMBERS)), np.zeros(0), np.zeros(0))


def columns(samples: Samples, rows: Rows, delay: float) -> tuple[Vector, Vector]:
    """(2, rows, 6) matrix of 1 / k − 1, b / k, I / k, D / k, F / k and a change of the delay, and
    (2, rows) left side, the torque less what the rigid model needs.
    """
    matrix, left, j, k = [], [], rows.joint, rows.sample
    for half, known in zip(samples.halves, rows.known, strict=True):
        torque, rate = half.torque(j, delay)
        motion = half.a[k, 6 + j], half.v[k, 6 + j], half.sign[k, j]
        matrix.append(np.transpose([known, np.full(len(k), -1.0), *motion, rate[k]]))
        left.append(torque[k] - known)
    return np.array(matrix), np.array(left)


def solve(samples: Samples, rows: Rows, prior: Vector, precision: Vector) -> Solution:
    """The numbers of these rows.

    Args:
        samples: of the log.
        rows: their equations.
        prior: (6,) most probable x before the log is seen.
        precision: (6,) of each, one over its variance.
    """
    weight, x, costs = np.ones(len(rows.sample)), prior.copy(), []
    for delay in DELAYS:
        matrix, left = columns(samples, rows, delay)
        matrix[:, :, -1] = 0.0
        trial, _ = _solved(matrix, left, weight, float(np.mean(left**2)), prior, precision)
        costs.append(np.prod(left - matrix @ trial, axis=0).sum())  # noise of the halves drops out
    x[-1], noise = DELAYS[int(np.argmin(costs))], np.inf
    negative, held = np.zeros(len(x)), np.zeros(len(x), bool)
    for step in range(STEPS):
        late = x[-1]
        matrix, left = columns(samples, rows, late)
        noise = min(noise, float(np.mean(left**2)))
        known = np.where(held, 0.0, prior), np.where(held, NEVER, precision)
        x, inverse = _solved(matrix, left + matrix[:, :, -1] * late, weight, noise, *known)
        below = np.zeros(len(x), bool)
        below[POSITIVE] = (x[POSITIVE] * (1.0 + x[0]) < 0.0) & (step >= FIRST)
        below &= ~held
        effect = np.abs(x) * np.sqrt(np.mean(matrix[0] ** 2, axis=0) / np.mean(left**2))
        negative, held = np.where(below, effect, negative), held | below
        x[-1] = np.clip(x[-1], *DELAYS[[0, -1]])
        residual = left + matrix[:, :, -1] * late - matrix @ x
        size = np.abs(residual.mean(axis=0))
        weight = 1.0 / np.maximum(1.0, size / (HUBER * 1.4826 * np.median(size) + 1e-12))
        noise = float(np.mean(weight * residual**2)) + 1e-12
        if step > FIRST and not below.any() and abs(x[-1] - late) < SETTLED:
            break
    block = np.floor(samples.t[rows.sample] / BLOCK)
    scores = 0.5 * sum(matrix[h] * (weight * residual[1 - h])[:, None] for h in (0, 1))
    scores = np.add.reduceat(scores, np.flatnonzero(np.diff(block, prepend=-np.inf)), axis=0)
    lacks = max(float(np.sum(weight * residual[0] * residual[1])), 0.0)  # noise drops out
    meat = (scores.T @ scores + ALIKE**2 * lacks * _between(matrix, weight)) / noise**2
    covariance = inverse @ (meat + np.diag(precision)) @ inverse
    measured = (left + rows.known).mean(axis=0)
    # From 1 / k - 1, I / k, ... to k, I, ...
    k = 1.0 / (1.0 + x[0])
    slope = np.diag([-k, k, k, k, k, 1.0])
    slope[:-1, 0] = -k * k * x[:-1]
    slope[0, 0] = -k * k
    values = np.array([k, *k * x[1:-1], x[-1]])
    error = np.where(held, np.inf, np.sqrt(np.diag(slope @ covariance @ slope.T)))
    return Solution(values, error, negative, measured, measured - residual.mean(axis=0))


def _between(matrix: Vector, weight: Vector) -> Vector:
    """The matrix N of both halves."""
    cross = matrix[0].T @ (weight[:, None] * matrix[1])
    return np.asarray(0.5 * (cross + cross.T))


def _solved(
    matrix: Vector, left: Vector, weight: Vector, noise: float, prior: Vector, precision: Vector
) -> tuple[Vector, Vector]:
    """The numbers by the weighted instruments and the prior, and (N / σ² + P)⁻¹."""
    weak = WEAK * (np.sum(matrix**2, axis=(0, 1)) / noise + 1.0)
    whole = _between(matrix, weight) / noise + np.diag(precision + weak)
    right = 0.5 * sum(matrix[h].T @ (weight * left[1 - h]) for h in (0, 1)) / noise
    size = np.sqrt(np.abs(np.diag(whole)))
    inverse = np.linalg.inv(whole / size / size[:, None]) / size / size[:, None]
    return inverse @ (right + precision * prior), inverse
