"""Arrays, views and records in kernels: what C gives is what plain Python gives, in every bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from needs import needs_compiler
from oracle import four, same

from harpy_pin.kernels import kernel

pytestmark = needs_compiler
SCALE = 2.5


@kernel
def trace(m, weight=SCALE):
    total = 0.0
    for i in range(m.shape[0]):
        for j in range(m.shape[1]):
            total = 0.9 * total + weight * m[i, j]
    return total


@kernel
def length(v):
    total = 0.0
    for i in range(v.size):
        total = 0.7 * total + v[i]
    v[0] = -1.0
    return total


@kernel
def views(m, n):
    rows, columns = m.shape
    column, row, part = m[:, 1], m[n], m[1:3, 0:2]
    total = trace(part) + trace(m[n:, 1:], 2.0) + trace(m[:2])
    total += length(column)
    total += length(row)
    block = m[0:2, :].reshape(2 * m.shape[1])
    block[n] = 7.0
    square = block[0:4].reshape((2, 2))
    m[3, :] = m[0, :]
    m[2, 1:3] = block[1]
    m[n + 1 :, 0] = 3.0
    part[:, :] = 0.25
    part[0, :] = square[1, 0]
    column[:] *= 2.0
    m[1] += n
    again = m[n : n + 2][1][0:2]
    return (
        total,
        square[1, 1],
        again[1],
        part.shape[0] * 10 + part.shape[1],
        block.size + m.size + rows * columns,
    )


@given(st.integers(0, 1), st.lists(st.floats(-9, 9), min_size=12, max_size=12))
def test_views(n, numbers):
    same(views, np.array(numbers).reshape(4, 3), n)


@kernel
def reshaped(a):
    columns = 2
    grid = a.reshape(2, columns)
    columns = 7
    return grid[1, 0] * columns, grid.shape[1]


def test_a_view_keeps_its_sizes():
    assert same(reshaped, four()) == (21.0, 2)


@kernel
def shorter(a, n):
    k, total = n, 0.0
    for i in range(2):
        v = a[i:k]
        k = k - 1
        total += v.shape[0]
    return v.shape[0], total + v[0]


def test_the_size_of_a_view_after_its_loop():
    assert same(shorter, four(), 4) == (2, 8.0)


@kernel
def lengths(a, n):
    return 2 * a[: n - 1].shape[0], 7 - a[n - 2 :].size, a[1 : n + 1].reshape(n, 1).shape[0] * 3


def test_the_size_of_a_slice_is_one_number():
    assert same(lengths, four(), 3) == (4, 4, 9)


@kernel
def work(a):
    x, y = np.zeros(3), np.empty((2, 2))
    x[1:] = a[0:2]
    first = x
    x = np.zeros(3)
    x[0] = 9.0
    y[:, :] = 0.5
    nothing = np.zeros((0, 3))
    for i in range(nothing.shape[0]):
        x[0] += nothing[i, 0]
    for n in range(2):
        inner = np.zeros(2)  # zero again in every round
        inner[n] += 1.0
        y[0, 0] += inner[0]
    return first[0], first[1], x[0], y[0, 0] + y[1, 1], nothing.size


def test_work_space():
    assert same(work, four()) == (0.0, 1.0, 9.0, 2.0, 0)


@kernel
def kinds(counts, flags, nothing):
    counts[0] = 2.7 + counts[1]
    counts[1] += counts[2] // 2
    flags[0] = counts[0] > 2
    flags[1] = flags[0] and not flags[1]
    total = 0.0
    for i in range(nothing.shape[0]):
        total += nothing[i]
    for i in range(2):
        counts[2] += flags[i]
    return total, counts[0] * 0.5, flags[0], nothing.shape[0]


def test_arrays_of_other_kinds_and_of_no_elements():
    counts, flags = np.array([1, 2, 7]), np.array([False, True])
    assert same(kinds, counts, flags, np.zeros(0)) == (0.0, 2.0, True, 0)
    assert counts.tolist() == [4, 5, 8]
    assert flags.tolist() == [True, False]


@kernel
def single(values, out):
    total = 0.0
    for i in range(values.shape[0]):
        total += values[i] * 0.1 + values[i] ** 2
        out[i] = total
    return total


def test_single_precision_is_only_how_elements_are_kept():
    values = np.linspace(0.1, 0.7, 5, dtype=np.float32)
    single(values, out := np.zeros(5, dtype=np.float32))
    exact = values.astype(np.float64)
    doubles = np.cumsum(exact * 0.1 + exact**2)
    np.testing.assert_array_equal(out, doubles.astype(np.float32))
    with pytest.raises(
        TypeError
    ):  # the first call decides; nothing is compiled in the middle of a run
        single(exact, np.zeros(5))


@kernel
def sized(large, a):
    space = np.zeros(4 if large else 2)
    space[0] = a[0]
    return space[0] + space.shape[0]


@kernel
def known_when_compiling(fixed: bool, a):
    return sized(True, a) + sized(False, a) if fixed else 0.0


def test_sizes_that_follow_from_a_known_truth_value():
    assert same(known_when_compiling, True, np.array([1.5])) == 9.0


INNER = np.dtype(
    [("gain", np.float64, (2,)), ("count", np.int64), ("double", np.float64)], align=True
)
OUTER = np.dtype(
    [
        ("mass", np.float64),
        ("legs", INNER, (3,)),
        ("body", INNER),
        ("marks", np.bool_, (2,)),
        ("none", np.float64, (0, 3)),
        ("matrix", np.float64, (2, 2)),
    ],
    align=True,
)


@kernel
def change(leg, by):
    leg.gain[:] *= by
    leg.count += 2
    leg.double = leg.gain[0] - leg.count


@kernel
def records(p, many, n):
    legs = p.legs
    change(legs[n], 2.0)
    change(p.body, SCALE)
    for i in range(legs.shape[0]):
        legs[i].gain[1] = legs[i].gain[0] + p.body.count
        p.mass += legs[i].gain[1]
    p.marks[1] = p.marks[0] or p.mass > 3.0
    one, leg = many[n], legs[n]
    p.mass += leg.gain[leg.count - 2]
    one.mass = p.mass
    p.matrix[0], p.matrix[n, 1] = 2.0, p.mass
    for i in range(p.none.shape[0]):
        p.mass += p.none[i, 0] + length(p.none[i])
    legs[0].gain[:] = legs[1].gain
    return one.legs[1].count + p.none.shape[0]


def test_records():
    p, many = np.zeros(1, OUTER), np.zeros(2, OUTER)
    p["legs"]["gain"] = np.arange(6.0).reshape(1, 3, 2)
    p["mass"] = 0.1
    same(records, p[0], many, 1)
    assert many["mass"][1] == p["mass"][0]
    assert p["legs"]["count"].tolist() == [[0, 2, 0]]
