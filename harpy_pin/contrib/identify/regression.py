"""Robust regression for the numbers of joints whose equations share rows.

The torque τ that the motor of a hanging robot's joint reports is

    τ(t − d) = (known + I a + D v + F s − b) / k,

with ``known`` what the rigid model needs. It is linear in 1 / k, I / k and so on, but not in the
delay d. On its feet a robot has rows with shares e_j of several joints, whose scales k are taken as
one, and with a payload:

    Σ_j e_j τ_j(t − d_j) = known + payload · p + Σ_j e_j (I_j a_j + D_j v_j + F_j s_j − b_j).

A line search finds the delay first, one for all joints of the rows; steps of Gauss and Newton then
find each joint's.

Least squares would be biased: noise of encoders is in the accelerations, and in the torques that
answer to it. The two halves A₁ and A₂ of the log (:mod:`harpy_pin.contrib.identify.signals`) have
independent noise, so each is the other's instrument: (A₁ᵀ W A₂ + A₂ᵀ W A₁) x = A₁ᵀ W y₂ + A₂ᵀ W y₁.
Weights W are Huber's. Standard errors are those of blocks of the log (the sandwich estimate), so
that what is left may be correlated in time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
SINGULAR = 1e-6
"""Eigenvalue of the scaled equations below which a combination of numbers is not found."""


@dataclass(frozen=True, eq=False)
class Solution:
    """What rows say.

    Attributes:
        values: (6 joints + payload,) in the order of :data:`NUMBERS`, joint after joint.
        error: standard errors of them; infinite for numbers that are not free.
        free: whether each is free: neither given, nor at zero because it came out negative.
        negative: of what came out negative before, the rms of its part as a share of that of what
            is measured.
        measured: (rows,) left side, the logged torques less what is known in rows of several
            joints, N·m or N.
        predicted: (rows,) the same by these numbers.
    """

    values: Vector
    error: Vector
    free: NDArray[np.bool_]
    negative: Vector
    measured: Vector
    predicted: Vector

    @property
    def size(self) -> float:
        """Rms of what is measured, N·m or N; NaN of no row."""
        return float(np.sqrt(np.mean(self.measured**2))) if len(self.measured) else np.nan

    @property
    def left(self) -> float:
        """Rms of what is not explained over that of what is measured."""
        rest = self.measured - self.predicted
        return float(np.sqrt(np.mean(rest**2))) / self.size if len(rest) else np.nan


def columns(samples: Samples, rows: Rows, delay: Vector) -> tuple[Vector, Vector]:
    """(2, rows, 6 joints + payload) matrix and (2, rows) left side, for (len(joints),) delays.

    A delay's column is that of its change.
    """
    matrix, left, alone = [], [], len(rows.joints) == 1
    for half, known, payload in zip(samples.halves, rows.known, rows.payload, strict=True):
        parts, total = [], np.zeros(len(known)) if alone else -known
        for k, j in enumerate(rows.joints):
            share = rows.select[:, k]
            motion = half.a[:, j], half.v[:, j], half.sign[:, j]
            torque, rate, *of_joint = (
                share * x[rows.sample] for x in (*half.torque(j, delay[k]), *motion)
            )
            total = total + torque
            parts += [known if alone else 0.0 * share, -share, *of_joint, rate]
        matrix.append(np.hstack((np.array(parts).T, payload)))
        left.append(total)
    return np.array(matrix), np.array(left)


def solve(samples: Samples, rows: Rows, given: Vector) -> Solution:
    """The numbers of these rows.

    Args:
        samples: of the log.
        rows: their equations.
        given: (6 joints + payload,) values of numbers that are not to be found; NaN for the others.
    """
    many = len(rows.joints)
    kind = np.array([*NUMBERS * many, *["payload"] * rows.payload.shape[2]])
    late, scale = kind == "delay", kind == "torque_scale"
    given = np.where(scale & (many > 1), 1.0, given)
    free, weight = np.isnan(given), np.ones(len(rows.sample))
    x = np.where(free, np.where(scale, 1.0, 0.0), given)
    if (late & free).any():
        costs = []
        for delay in DELAYS:
            trial = np.where(late & free, delay, x)
            matrix, left = columns(samples, rows, trial[late])
            matrix[:, :, late] = 0.0
            trial = _solved(matrix, left, weight, trial, free & ~late)
            costs.append(
                np.prod(left - matrix @ trial, axis=0).sum()
            )  # noise of the halves drops out
        x[late & free] = DELAYS[int(np.argmin(costs))]
    negative = np.zeros(len(x))
    for step in range(STEPS):
        before = np.where(late, x, 0.0)
        matrix, left = columns(samples, rows, x[late])
        x = _solved(matrix, left + matrix @ before, weight, x, free)
        below = np.isin(kind, POSITIVE) & (x * (x[0] if many == 1 else 1.0) < 0.0) & (step >= FIRST)
        effect = np.abs(x) * np.sqrt(np.mean(matrix[0] ** 2, axis=0) / np.mean(left**2))
        negative, x, free = (
            np.where(below, effect, negative),
            np.where(below, 0.0, x),
            free & ~below,
        )
        x[late] = np.clip(x[late], *DELAYS[[0, -1]])
        residual = left - matrix @ (x - before)
        size = np.abs(residual.mean(axis=0))
        weight = 1.0 / np.maximum(1.0, size / (HUBER * 1.4826 * np.median(size) + 1e-12))
        if step > FIRST and not below.any() and np.abs(x - before)[late].max() < SETTLED:
            break
    covariance = np.zeros((len(x), len(x)))
    block = np.floor(samples.t[rows.sample] / BLOCK)
    covariance[np.ix_(free, free)] = _covariance(matrix[:, :, free], weight, residual, block)
    predicted = (matrix @ (x - before)).mean(axis=0)
    if many == 1:  # from 1 / k, I / k, ... to k, I, ...
        share = np.where(late, 1.0, 1.0 / x[0])
        slope = np.diag(share)
        slope[:, 0] = np.where(late, 0.0, -x / x[0] ** 2)
        slope[0, 0] = -1.0 / x[0] ** 2
        covariance = slope @ covariance @ slope.T
        x = np.where(scale, 1.0 / x[0], x * share)
    error = np.where(free, np.sqrt(np.diag(covariance)), np.inf)
    return Solution(x, error, free, negative, left.mean(axis=0), predicted)


def _cross(matrix: Vector, weight: Vector) -> tuple[Vector, Vector]:
    """Inverse of A₁ᵀ W A₂ + A₂ᵀ W A₁ over two in columns of length one, and these lengths."""
    size = np.maximum(np.linalg.norm(matrix, axis=1).mean(axis=0), 1e-12)
    cross = (matrix[0] / size).T @ (weight[:, None] * matrix[1] / size)
    return np.linalg.pinv(0.5 * (cross + cross.T), rcond=SINGULAR, hermitian=True), size


def _solved(
    matrix: Vector, known: Vector, weight: Vector, x: Vector, free: NDArray[np.bool_]
) -> Vector:
    """The free numbers by the weighted instruments, with the others as in x."""
    right = weight * (known - matrix[:, :, ~free] @ x[~free])
    left = matrix[:, :, free]
    inverse, size = _cross(left, weight)
    x = x.copy()
    x[free] = inverse @ (0.5 * (left[0].T @ right[1] + left[1].T @ right[0]) / size) / size
    return x


def _covariance(matrix: Vector, weight: Vector, residual: Vector, block: Vector) -> Vector:
    """Of the numbers, where noise is independent from block to block, and what the model lacks
    looks like a number by a share of :data:`ALIKE`.
    """
    inverse, size = _cross(matrix, weight)
    scores = 0.5 * sum(matrix[h] * (weight * residual[1 - h])[:, None] for h in (0, 1)) / size
    scores = np.add.reduceat(scores, np.flatnonzero(np.diff(block, prepend=-np.inf)), axis=0)
    lacks = max(float(np.sum(weight * residual[0] * residual[1])), 0.0)  # noise drops out
    covariance = inverse @ (scores.T @ scores) @ inverse + ALIKE**2 * lacks * inverse
    return np.asarray(covariance / size / size[:, None])
