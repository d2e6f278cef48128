"""Cholesky factors of small symmetric matrices, for kernels: M = Lᵀ L with L lower triangular.

Elimination runs from the last row to the first. For a mass matrix that is from the tips of the
kinematic tree to its root, so that the zeros between branches stay zeros (Featherstone's sparse
factorisation), and zeros are skipped. The inner loops run along rows, over all right-hand sides at
once, which compilers turn into vector instructions. A factor keeps the reciprocals of its diagonal
in the diagonal's place.
"""

from __future__ import annotations

import numpy as np

from harpy_pin.kernels import kernel
from harpy_pin.model.state import Vector


@kernel(matrix=("n", "n"), lower=("n", "n"))
def factorise(matrix: Vector, lower: Vector, floor: float = 0.0) -> None:
    """Factor of a matrix; ``matrix`` and ``lower`` may be the same array.

    A matrix that is not positive definite gives entries that are not finite, or with a floor huge
    ones; no exception.

    Args:
        matrix: (n, n) its lower triangle is read.
        lower: (n, n) L; above the diagonal nothing is written.
        floor: least pivot, which keeps the factor of a singular matrix finite.
    """
    n = matrix.shape[0]
    for i in range(n):
        lower[i, : i + 1] = matrix[i, : i + 1]
    for k in range(n - 1, -1, -1):
        reciprocal = 1.0 / np.sqrt(max(lower[k, k], floor))
        lower[k, k] = reciprocal
        lower[k, :k] *= reciprocal
        for i in range(k):
            factor = lower[k, i]
            if factor != 0.0:
                lower[i, : i + 1] -= factor * lower[k, : i + 1]


@kernel(lower=("n", "n"), x=("n", "m"), columns="m")
def solve_transposed(lower: Vector, x: Vector, columns: int) -> None:
    """x ← L⁻ᵀ x for the leading columns of x (n, ≥ columns)."""
    for i in range(lower.shape[0] - 1, -1, -1):
        x[i, :columns] *= lower[i, i]
        for k in range(i):
            if lower[i, k] != 0.0:
                x[k, :columns] -= lower[i, k] * x[i, :columns]


@kernel(lower=("n", "n"), x=("n", "m"), columns="m")
def solve_factor(lower: Vector, x: Vector, columns: int) -> None:
    """x ← L⁻¹ x for the leading columns of x (n, ≥ columns)."""
    for i in range(lower.shape[0]):
        for k in range(i):
            if lower[i, k] != 0.0:
                x[i, :columns] -= lower[i, k] * x[k, :columns]
        x[i, :columns] *= lower[i, i]


@kernel(lower=("n", "n"), x=("n",))
def solve_vector(lower: Vector, x: Vector) -> None:
    """x ← M⁻¹ x = L⁻¹ L⁻ᵀ x for a vector x (n,)."""
    n = lower.shape[0]
    for i in range(n - 1, -1, -1):
        x[i] *= lower[i, i]
        x[:i] -= x[i] * lower[i, :i]
    for i in range(n):
        x[i] = (x[i] - lower[i, :i] @ x[:i]) * lower[i, i]


@kernel
def add_product(a: Vector, b: Vector, out: Vector) -> None:
    """out ← out + A B; zeros of A are skipped."""
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            if a[i, k] != 0.0:
                out[i] += a[i, k] * b[k]


@kernel
def add_gram(columns: Vector, y: Vector, gram: Vector, product: Vector) -> None:
    """Lower triangle of G ← G + Cᵀ C, and p ← p + Cᵀ y; zeros of C are skipped."""
    for i in range(columns.shape[0]):
        for a in range(columns.shape[1]):
            x = columns[i, a]
            if x != 0.0:
                product[a] += x * y[i]
                gram[a, : a + 1] += x * columns[i, : a + 1]


@kernel(matrix=("n", "n"))
def mirror(matrix: Vector) -> None:
    """Copy the lower triangle above the diagonal."""
    for i in range(matrix.shape[0]):
        for k in range(i):
            matrix[k, i] = matrix[i, k]
