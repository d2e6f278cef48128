"""Assignments, tuples, calls and names in kernels: what C gives is what plain Python gives, in
every bit.
"""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from needs import needs_compiler
from oracle import REALS, four, same

from harpy_pin.kernels import kernel
from harpy_pin.kernels.numbers import MATHEMATICS
from harpy_pin.kernels.unit import RESERVED

pytestmark = needs_compiler
N = 3


@kernel
def swaps(a, n):
    a[0], a[1] = a[1], a[0]
    a[n], a[n + 1], a[2] = a[2], a[n], a[n + 1]
    i, x = n, a[0]
    i, x = i + 1, x + i
    a[i], i = x, 0
    x, y, z = a[1], a[2], a[3]
    x, y, z = y, z, x
    (x, y), z = (y, x), x + y
    a[n] = a[0] = y
    u = v = a[3] * 2.0
    u += x
    return i, x, y, z, u, v


@given(st.integers(0, 2), st.lists(REALS, min_size=4, max_size=4))
def test_swaps(n, numbers):
    same(swaps, np.array(numbers), n)


@kernel
def swapped_arrays(a, b):
    x, y = a[0:2], b[1:3]
    for i in range(3):
        x[0] += 1.0 + i
        z = x
        x = y
        y = z
    row = a[1:4]
    row, first = row[1:3], row[0]
    return x[0], y[0], row[0], first


def test_arrays_are_swapped_by_name():
    assert same(swapped_arrays, four(), four() + 10.0) == (14.0, 5.0, 3.0, 2.0)


@kernel
def rebound(a, n):
    a_row = a[0]
    x = a_row * n
    row = x
    row = a[1:]
    total = row[0] + row[1] + x
    row = 3
    a = a[2:]
    return total + row + a[0]


def test_names_may_stand_for_another_kind_of_thing():
    assert same(rebound, four(), 2) == 13.0


@kernel
def several(a):
    return a[0], a[1] > 1.0, 3


@kernel
def receives(t, a):
    x, flag, n = several(a)
    _, again, _ = several(a)
    return t[0] * 10 + t[1][0] + x, flag == again, n + several(a)[2]


@kernel
def nested(a, n):
    x, same, _ = receives((a[0], a[1:]), a)
    return x + receives((n, a), a)[0], same


@kernel
def turned(x, y):
    return (y, -x) if x > y else (x, y)


@kernel
def found_or_nothing(a, k):
    if a[k] < 0.0:
        return 0, 0.0
    return k, a[k]


@kernel
def starred(a, k):
    a[0], a[1] = a[1], a[0]
    x, y = turned(*a[:2])
    count, value = found_or_nothing(a, k)
    return turned(*(y, x))[1], x, y, count, value


@given(st.lists(st.floats(-9, 9), min_size=3, max_size=3), st.integers(0, 2))
def test_tuples_of_results(numbers, k):
    same(starred, np.array(numbers), k)


def test_tuples():
    assert same(receives, (1.0, four()), four()) == (12.0, True, 6)
    assert same(receives, (1, four()), four()) == (12.0, True, 6)
    assert same(nested, four(), 4) == (55.0, True)
    with pytest.raises(TypeError):
        receives((1.0, 2.0, 3.0), [1.0])


@kernel
def twice(x):
    return 2.0 * x


@kernel
def repeated(x, times=2):
    for _ in range(times):
        x = twice(x) + 0.5
    return x


@kernel
def chosen(x, flag=False):
    if flag:
        return x
    return 10.0 * x if x > 0.0 else -x


@kernel
def calls(x):
    total = repeated(x) + repeated(x, times=1) + repeated(times=x > 0.0, x=twice(x))
    return total + chosen(x) + chosen(x, True) + chosen(x, flag=False) + chosen(x, x > 1.0)


@given(st.floats(-5, 5))
def test_calls_by_name_and_with_defaults(x):
    same(calls, x)


@kernel
def raised(a):
    a[0] += 1.0
    return a[0]


@kernel
def order(a):
    first = raised(a)
    a[int(a[0])] = raised(a)
    a[1] += raised(a)
    n = 0
    while raised(a) < 9.0:
        n += 1
    if a[2] > 100.0 and raised(a) > 0.0:
        n = 100
    inside = 0.0 < raised(a) < 50.0
    return first, n, inside, raised(a)


def test_calls_that_write_are_made_in_pythons_order():
    same(order, four())


@kernel
def either(a, b, n):
    if n > 1:  # noqa: SIM108
        v = a
    else:
        v = b
    v[0] = 7.0


@kernel
def short_circuits(a):
    more = True
    more |= raised(a) > 0.0  # called, although nothing depends on it
    less = raised(a[2:]) > 5.0 or a[1] > 0.0
    if more or raised(a[3:]) > 0.0:
        a[1] = 1.0
    return more, less, a[0] + 0.0


@given(st.lists(st.floats(-9, 9), min_size=4, max_size=4))
def test_calls_that_write_are_made_where_python_makes_them(numbers):
    same(short_circuits, np.array(numbers))


def test_what_is_written_through_another_name_must_be_writable():
    a, b = np.zeros(3), np.zeros(3)
    b.flags.writeable = False
    with pytest.raises(TypeError):
        either(a, b, 1)
    assert b[0] == 0.0


@kernel
def double(short, int_=1.0):
    return short * 2.0 + int_


@kernel
def y1(index):
    return index + 1.0


@kernel
def exp(x):
    return np.exp(x) + 1.0


@kernel
def entry(x):
    return x + 0.25


@kernel
def results_rr(x):
    return x, y1(x)


@kernel
def real_min(a_size, a):
    return min(a_size, a[0]) + a.shape[0]


@kernel
def capitals(J, J_, double_, NAN):
    M = J + N
    return M + 10 * J_ + 100 * double_ + 1000 * NAN


@kernel
def c_names(a):
    short, long, register, signed, union, default = 1.0, 2.0, 3.0, 4.0, 5.0, 6.0
    fabs, sqrt, real, integer, bool_, slot, inside = 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0
    result, value, values, next_, i_, j_, round = 14.0, 15.0, 16.0, 17.0, 18.0, 19.0, 20.0
    I, printf = 21.0, 22.0  # noqa: E741
    total = (
        short
        + long
        + register
        + signed
        + union
        + default
        + fabs
        + sqrt
        + real
        + integer
        + bool_
        + slot
        + inside
    )
    total += (
        result + value + values + next_ + i_ + j_ + round + I + printf + abs(-a[0]) + np.sqrt(a[3])
    )
    x, y = results_rr(a[0])
    total += (
        double(y1(x))
        + exp(y)
        + entry(x)
        + real_min(a_size=a[1], a=a[1:])
        + capitals(1.0, 2.0, 3.0, 4.0)
    )
    a[0:2] = total
    return total


def test_names_that_c_has_already():
    same(c_names, four())


def test_functions_of_c_are_reserved():
    """No variable of generated code hides one, and its page lists them."""
    assert {*MATHEMATICS.values()} <= RESERVED
    page = (Path(__file__).parents[2] / "docs" / "kernels.md").read_text()
    assert all(f"`{function.__name__}`" in page for function in MATHEMATICS)
