"""The small factorisation against NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harpy_pin.model.cholesky import factorise, solve_factor, solve_transposed, solve_vector


def positive(rng, n, sparse):
    """A well-conditioned symmetric matrix; of a tree with two branches if ``sparse``."""
    root = rng.normal(size=(n, n))
    if sparse:
        half = n // 3
        root[half : 2 * half, 2 * half :] = root[2 * half :, half : 2 * half] = 0.0
        root = np.tril(root)
        return root.T @ root + np.eye(n)
    return root @ root.T + np.eye(n)


@given(st.integers(0, 10_000), st.integers(1, 15), st.booleans(), st.integers(0, 4))
def test_factor_and_solutions(seed, n, sparse, columns):
    rng = np.random.default_rng(seed)
    matrix, lower = positive(rng, n, sparse), np.full((n, n), np.nan)
    factorise(matrix, lower)
    true = np.tril(lower)
    np.fill_diagonal(true, 1.0 / np.diag(lower))
    np.testing.assert_allclose(true.T @ true, matrix, rtol=0, atol=1e-12 * np.abs(matrix).max())
    x = rng.normal(size=(n, columns + 1))
    both = x.copy()
    solve_transposed(lower, both, columns)
    np.testing.assert_allclose(true.T @ both[:, :columns], x[:, :columns], atol=1e-10)
    solve_factor(lower, both, columns)
    np.testing.assert_allclose(matrix @ both[:, :columns], x[:, :columns], atol=1e-9)
    np.testing.assert_array_equal(both[:, columns], x[:, columns])  # further columns are left alone
    vector = x[:, -1].copy()
    solve_vector(lower, vector)
    np.testing.assert_allclose(matrix @ vector, x[:, -1], atol=1e-9)


def test_zeros_between_branches_stay():
    rng = np.random.default_rng(0)
    matrix = positive(rng, 12, True)
    lower = np.zeros((12, 12))
    factorise(matrix, lower)
    assert not matrix[4:8, 8:].any()
    assert not lower[8:, 4:8].any()


def test_in_place_and_singular():
    rng = np.random.default_rng(1)
    matrix = positive(rng, 6, False)
    lower, in_place = np.zeros((6, 6)), matrix.copy()
    factorise(matrix, lower)
    factorise(in_place, in_place)
    np.testing.assert_array_equal(np.tril(in_place), np.tril(lower))
    # Of rank one, with a floor: a system that has a solution is still solved.
    row = matrix[0] / np.linalg.norm(matrix[0])
    singular = np.outer(row, row)
    lower = np.zeros((6, 6))
    factorise(singular, lower, 1e-12)
    value = 3.0 * row
    solution = value.copy()
    solve_vector(lower, solution)
    np.testing.assert_allclose(singular @ solution, value, atol=1e-3)
    # Not positive definite: said by numbers that are none, or with a floor by huge ones.
    factorise(np.diag([-5.0, 1.0]), lower[:2, :2])
    assert not np.isfinite(lower[0, 0])
    factorise(np.diag([-5.0, 1.0]), lower[:2, :2], 1e-12)
    assert lower[0, 0] == pytest.approx(1e6)
