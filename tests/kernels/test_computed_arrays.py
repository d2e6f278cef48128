"""Arrays that kernels compute: what C gives is what NumPy gives, in every bit but for the order of
sums.

Which of two zeros of different signs is the larger one NumPy leaves open, too: ``0.0 +`` makes them
one.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from needs import needs_compiler
from oracle import REALS, same

from harpy_pin.errors import KernelError
from harpy_pin.kernels import diagonal, kernel

pytestmark = needs_compiler


def reals(*shape):
    """Arrays of numbers of all kinds."""
    count = int(np.prod(shape))
    return st.lists(REALS, min_size=count, max_size=count).map(
        lambda numbers: np.array(numbers).reshape(shape)
    )


@kernel
def skew(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@kernel
def turned(rotation, v):
    return rotation @ v


@kernel(r=(3, 3), a=(3,), b=(3,), out=(3,))
def three(r, a, b, out, s: float):
    x = r @ a + np.cross(a, b) * s
    out[:] = x - b / s
    out += r.T @ x
    m = np.array([[1.0, s, 2.0], a, b])
    r[:] = r @ m + np.outer(a, b) - np.eye(3)
    u, v, w = a
    a[:] = b[2], b[0], u
    a[1:] *= np.where(b[1:] > 0.0, -v, s)
    y = turned(skew(a), 2.0 * b)
    r[1] -= turned(r, y)
    return (
        np.sqrt(abs(a @ b)),
        np.sum(-a),
        0.0 + np.max(np.abs(b)),
        0.0 + np.min(a),
        np.dot(a, a - b),
        w,
        y[1],
    )


@given(reals(3, 3), reals(3), reals(3), reals(3), REALS)
def test_vectors_and_matrices_of_three(r, a, b, out, s):
    same(three, r, a, b, out, s)


@kernel(a=(3,))
def copied(a):
    before = np.array(a)
    a *= 2.0
    return before[0], before[2], np.array((a[1], before[1]))[1]


@given(reals(3))
def test_an_array_of_an_array_is_a_copy(a):
    same(copied, a)


@kernel(a=(3,), rows=(4, 3), columns=(3, 4), out=(4, 3))
def rows_of_three(a, rows, columns, out):
    out[:] = np.cross(a, rows) - np.cross(rows, columns.T)
    columns[:] += np.cross(a, columns.T).T + np.cross(rows, a).T


@given(reals(3), reals(4, 3), reals(3, 4), reals(4, 3))
def test_cross_products_of_rows(a, rows, columns, out):
    same(rows_of_three, a, rows, columns, out)


@kernel
def any_size(p, q, v):
    n = p.shape[0]
    for i in range(n):
        q[i] = p[i] @ v + q[i]
    q[:] = p @ v + 2.0 * q
    p[:] += np.outer(q, v)
    p[0, :n] = p[0, :n] * q - (0.0 + np.maximum(q, p[1, :n]))
    p[1, :2] -= 0.0 + np.minimum(p[0, :2], 1.0)
    p[:, 1] = np.sin(p[:, 0])
    return np.sum(q / 2.0), 0.0 + np.max(q), (p.T @ q)[2]


@given(reals(4, 9), reals(4), reals(9))
def test_sizes_that_are_known_at_run_time_only(p, q, v):
    same(any_size_of_nine, p, q, v)


@kernel(a=(3,))
def questions(a, b):
    b[:] = 0.0 + np.clip(b, -1.0, 3.0)
    a[:] = 0.0 + np.clip(a, b[:3], b[1:4])
    return (
        bool(a[0]),
        np.any(a > 1.0),
        np.all(a[:2] != b[:2]),
        np.all(b <= 3.0) | np.any(np.isnan(b)),
    )


@given(reals(3), reals(9))
def test_clipped_numbers_and_truth_values(a, b):
    same(questions, a, b)


@kernel
def stretched(m, row, column, block):
    m[:] = m * row - column[:, None] / (1.0 + row[None])
    m += column[:, None]
    block[:] = m * block + np.where(column[:, None] > row, row, block)
    block[1:] = row - m[1]
    block[:, :, 0] = column
    row[:] = block[0, 1] * m[1]
    m[:, :2] = row[:2]


@kernel(m=(3, 4), row=(4,), column=(3,), block=(2, 3, 4))
def stretched_of_known_sizes(m, row, column, block):
    stretched(m, row, column, block)
    d = m - np.sum(m, axis=0) / 3.0
    m[:] = d * np.sum(d * d, axis=1)[:, None]
    return d[0, 0]


@given(reals(3, 4), reals(4), reals(3), reals(2, 3, 4))
def test_rows_and_columns_count_for_all(m, row, column, block):
    same(stretched_of_known_sizes, m, row, column, block)


@given(reals(5, 1), reals(1), reals(5), reals(2, 5, 1))
def test_rows_and_columns_of_any_size(m, row, column, block):
    same(stretched_of_one, m, row, column, block)


@kernel
def stretched_of_one(m, row, column, block):
    m[:] = m * row + column[:, None]
    block[:] = block * m - row[0]


@kernel(m=(3, 9), out=(9,))
def along_an_axis(m, out):
    out[:] = np.sum(m, axis=0) - (0.0 + np.max(m, axis=0))
    sizes = np.full(3, 1.0 + out[0]) * np.sqrt(np.sum(m * m, axis=1))
    m[:] = m / sizes[:, None]
    found = np.isfinite(m)
    good = np.all(found, axis=1) & np.any(m > 0.0, axis=1)
    return (
        0.0 + np.max(abs(out), initial=0.0),
        0.0 + np.min(out[:2], initial=-1.0),
        0.0 + np.max(out[:0], initial=sizes[0]),
        np.sum(good),
        np.sum(out > 0.0),
        good[1],
        np.all(abs(out) < np.inf),
    )


@given(reals(3, 9), reals(9))
def test_along_an_axis(m, out):
    same(along_an_axis, m, out)


@kernel
def places(a, n: int):
    return np.argmax(a), np.argmin(abs(a[:n])), np.argmax(a[n:] > 0.0), np.argmax(a[1:2])


@given(st.lists(st.sampled_from([0.0, -1.0, 2.0, np.nan, np.inf]), min_size=5, max_size=9))
def test_places_of_extremes(numbers):
    same(places, np.array(numbers), 4)


@kernel(m=(6, 6), x=(3,))
def diagonals(m, x, k: int):
    d = diagonal(m)
    d[:] *= 2.0
    diagonal(m[k : k + 2, 1:3])[:] = x[:2]
    diagonal(m)[2:5] += x
    m[:3, 3:] += np.where(np.repeat(x, 2)[:3] > 0.0, diagonal(m)[:3], 1.0)
    return 0.0 + np.max(diagonal(m[1:3, 1:3])), np.sum(d), np.sum(np.repeat(x, k))


@given(reals(6, 6), reals(3), st.integers(1, 4))
def test_diagonals(m, x, k):
    same(diagonals, m, x, k)


@kernel(p=(4, 9), q=(4,), v=(9,))
def any_size_of_nine(p, q, v):
    total, largest, _ = any_size(p, q, v)
    return total, largest, v @ v


@kernel(m=(6, 6), x=(6,))
def chosen(m, joints, x, k: int):
    limb, before = joints[:3], joints[:3] - 1
    part = m[:, limb]
    y = m[limb, k] @ x[limb] + part[2] @ part[1]
    m[2:5, limb - 1] = 2.0 * part[:3]
    x[limb] -= part.T @ x
    x[before] *= 2.0 + before // 2
    return y, m[limb, 0][2]


@given(reals(6, 6), st.permutations([1, 2, 3, 4, 5]), reals(6), st.integers(0, 5))
def test_elements_chosen_by_indices(m, order, x, k):
    same(chosen, m, np.array(order[:3]), x, k)


@kernel(a=(4,), m=(4, 4))
def overlapping(a, m):
    a[1:] = a[:3] + 1.0
    m[:] = m.T * 2.0
    m[:] = m @ m
    m[0, :3], m[1, :3] = m[1, :3] + a[:3], m[0, :3]
    b = a
    b += 1.0
    c = a + 0.0
    c += 1.0
    return c[0], b[0]


@given(reals(4), reals(4, 4))
def test_what_is_written_is_read_before(a, m):
    same(overlapping, a, m)


@kernel
def eliminated(a, i: int, k: int):
    a[i, : i + 1] -= a[k, i] * a[k, : i + 1]


def test_rows_from_one_index_on_are_apart():
    """Also in C that checks every index, where the index is no constant."""
    same(eliminated, np.arange(1.0, 10.0).reshape(3, 3), 2, 1)
    assert "within(0, i + 1, a_columns" in eliminated.c_source(np.eye(3), 2, 1, debug=True)


@kernel
def product_into(a, b, out):
    out[:] = a @ b


@kernel
def product_in_place(a, b):
    product_into(a, b, a)


@kernel(a=(3, 4))
def unequal(a):
    a[:] = a[:, 0] + a


@kernel(a=(3, 4))
def too_many(a):
    a[:1] = 2.0 * a[:2]


@kernel(a=(3,))
def of_more_axes(a):
    a[:] = a[None] + a


@kernel(a=(3, 4))
def no_square(a):
    diagonal(a)[:] = 0.0


@kernel(a=(3, 6))
def row_of_itself(a):
    a[1:] = a[1]


@kernel(a=(3,))
def named_wrongly(a):
    a[0] = np.sum(a, initial=1.0)


@kernel
def nameless(a, b):
    c = a + b
    a[:] = c


@kernel
def chain(a):
    a[:] = np.where(0.0 < a < 1.0, a, 0.0)


@kernel(a=(3, 3))
def two_kinds(a, n: int):
    x = a[0] + 1.0
    if n > 0:
        x = a[1] + 1.0
    a[2] = x


@kernel
def moved(a):
    a[0] += 1.0
    return a[0]


@kernel
def at_a_moving_place(a, b):
    b[int(a[0])] += moved(a)


@kernel
def swapped_at_once(a, b):
    x, y = a[:2], b[:2]
    x, y = y, x
    x[0] = y[0]


@kernel(a=(3, 3))
def twice_chosen(a, rows):
    a[rows, rows] = 0.0


@pytest.mark.parametrize(
    ("function", "arguments", "reason"),
    [
        (at_a_moving_place, (np.ones(3), np.ones(3)), "give its result a name first"),
        (swapped_at_once, (np.ones(3), np.ones(3)), "give it a name first"),
        (twice_chosen, (np.eye(3), np.array([0, 1])), "anything but one vector of integers"),
        (product_in_place, (np.eye(3), np.eye(3)), "writes to 'out' what it reads as 'a'"),
        (unequal, (np.ones((3, 4)),), "where .* is needed"),
        (too_many, (np.ones((3, 4)),), "where .* is needed"),
        (of_more_axes, (np.ones(3),), "where .* is needed"),
        (no_square, (np.ones((3, 4)),), "where .* is needed"),
        (row_of_itself, (np.ones((3, 6)),), "both may overlap"),
        (named_wrongly, (np.ones(3),), "arguments by name"),
        (nameless, (np.ones(3), np.ones(3)), "size is not known"),
        (chain, (np.ones(3),), "a chain of comparisons"),
        (two_kinds, (np.eye(3), 1), "not the same kind of thing"),
        (skew, (np.ones(3),), "an array as result"),
    ],
)
def test_refusals_name_the_line(function, arguments, reason):
    with pytest.raises(
        KernelError, match=rf"test_computed_arrays.py:\d+: {function.py_func.__name__}: .*{reason}"
    ):
        function(*arguments)
