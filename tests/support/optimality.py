"""Whether many answers are optima of the whole-body program: by its KKT conditions, in closed form
and all at once.

The program is that of :mod:`whole_body_oracle`, in z = [a; f; u]: min |A z − b|² subject to E z =
e, C z ≤ d. An answer says which inequalities hold with equality. With these as equations, z and the
multipliers follow from one linear system; the program is strictly convex, so that z is its only
optimum if C z ≤ d and the multipliers are not negative.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ACTIVE = (1e-10, 1e-8)
"""How near to its bound an inequality of an answer holds with equality, relative to the size of z:
the second one where there is no optimum with the first.
"""
INSIDE = 1e-7
"""How far it may be missed, likewise."""
SOFT = 1e-13
"""Softness of the equations: two of them may say the same."""
REFINEMENTS = 3


@dataclass
class Programs:
    """Programs of one shape, stacked along the first axis."""

    a: np.ndarray
    b: np.ndarray
    equality: np.ndarray
    value: np.ndarray
    inequality: np.ndarray
    upper: np.ndarray

    @classmethod
    def of(cls, cases) -> Programs:
        return cls(*(np.array(part) for part in zip(*cases, strict=True)))


@dataclass
class Optima:
    """What the active inequalities of an answer give."""

    z: np.ndarray  # (n, variables)
    fits: np.ndarray  # (n,) whether it satisfies the KKT conditions: it is the optimum
    binding: np.ndarray  # (n, inequalities) which are active


def times(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", matrix, vector)


def optima_from(p: Programs, answer: np.ndarray) -> Optima:
    """The points that the active inequalities of answers give, and whether these are optima."""
    found = _optima(p, answer, ACTIVE[0])
    rest = np.flatnonzero(~found.fits)
    if len(rest):
        again = _optima(
            Programs(*(part[rest] for part in vars(p).values())), answer[rest], ACTIVE[1]
        )
        found.z[rest], found.fits[rest], found.binding[rest] = again.z, again.fits, again.binding
    return found


def _optima(p: Programs, answer: np.ndarray, active: float) -> Optima:
    n, size = answer.shape
    scale = 1.0 + np.abs(answer).max(axis=1, keepdims=True)
    binding = times(p.inequality, answer) > p.upper - active * scale
    most = max(int(binding.sum(axis=1).max()), 1)
    first = np.argsort(~binding, axis=1, kind="stable")[
        :, :most
    ]  # the active ones, then others that are left out
    chosen = np.take_along_axis(binding, first, axis=1)
    rows = np.where(
        chosen[:, :, None], np.take_along_axis(p.inequality, first[:, :, None], axis=1), 0.0
    )
    right = np.where(chosen, np.take_along_axis(p.upper, first, axis=1), 0.0)
    rows, right = (
        np.concatenate((p.equality, rows), axis=1),
        np.concatenate((p.value, right), axis=1),
    )
    equations = rows.shape[1]
    system = np.zeros((n, size + equations, size + equations))
    system[:, :size, :size] = np.einsum("nki,nkj->nij", p.a, p.a)
    system[:, size:, :size], system[:, :size, size:] = rows, rows.transpose(0, 2, 1)
    exact = system.copy()
    left_out = np.concatenate((np.zeros(p.value.shape, dtype=bool), ~chosen), axis=1)
    for matrix, soft in ((system, SOFT), (exact, 0.0)):
        matrix[:, range(size, size + equations), range(size, size + equations)] = np.where(
            left_out, -1.0, -soft
        )
    given = np.concatenate((np.einsum("nki,nk->ni", p.a, p.b), right), axis=1)
    inverse = np.linalg.inv(system)
    found = np.zeros_like(given)
    for _ in range(1 + REFINEMENTS):
        found += times(inverse, given - times(exact, found))
    z, multiplier = found[:, :size], found[:, size + p.value.shape[1] :]
    size_of = 1.0 + np.abs(z).max(axis=1, keepdims=True)
    error = np.abs(given - times(exact, found)).max(axis=1) / (1.0 + np.abs(given).max(axis=1))
    inside = (times(p.inequality, z) <= p.upper + INSIDE * size_of).all(axis=1)
    signs = (multiplier >= -1e-6 * (1.0 + np.abs(multiplier).max(axis=1, keepdims=True))).all(
        axis=1
    )
    return Optima(z, inside & signs & (error < 1e-9), binding)
