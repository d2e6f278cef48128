"""What kernels may say, against plain Python, bit for bit; and what they may not, refused with its place."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from harpy_pin import InputError, KernelError
from harpy_pin.compiled import BACKEND, kernel
from harpy_pin.compiled.types import Array
from harpy_pin.model.record import make_record

pytestmark = pytest.mark.skipif(BACKEND != "c", reason="compares with C")
SIZE = 6
FACTOR = 2.5
LIMITS = (1.0, 2.0)
anything = st.floats(allow_nan=True, allow_infinity=True)
numbers = st.floats(-1e3, 1e3)
whole = st.integers(-50, 50)
vectors = arrays(np.float64, SIZE, elements=numbers)


def same(one, *arguments):
    """Call a kernel in C and in plain Python; results and everything that was written agree in every bit."""
    sides = []
    for call in (one, one.python):
        own = [a.copy() if isinstance(a, np.ndarray) else a for a in arguments]
        result = call(*own)
        flat = result if isinstance(result, tuple) else (result,)
        sides.append((flat, own))
    for a, b in zip(sides[0][0], sides[1][0], strict=True):
        assert (a is None and b is None) or np.array_equal(a, b, equal_nan=True), (a, b)
        if isinstance(a, float) and not math.isnan(a):
            assert math.copysign(1.0, a) == math.copysign(1.0, b)
    for a, b in zip(sides[0][1], sides[1][1], strict=True):
        if isinstance(a, np.ndarray):
            assert a.tobytes() == b.tobytes()
    return sides[0][0]


@kernel
def arithmetic(x: float, y: float, i: int, j: int):
    a = x + y - x * y / (1.0 + y * y)
    b = -(x**2) + y * x**2
    c = i // 3 + i % 7 - j // 5 * (j % 4)
    d = abs(i) + abs(x) + i * 0.5
    return a, b, c, d, x - (y - a), x / (y / 3.0) if y != 0.0 else 0.0


@given(numbers, numbers.filter(lambda y: y == 0.0 or abs(y) > 1e-100), whole, whole)
def test_arithmetic(x, y, i, j):
    same(arithmetic, x, y, i, j)


@kernel
def powers(x: float):
    return x**3, x**4


@given(numbers)
def test_higher_powers_are_products(x):
    """C and Numba multiply, Python asks its library."""
    ours, exact = powers(x), powers.python(x)
    np.testing.assert_array_max_ulp(np.array(ours), np.array(exact), maxulp=2)
    assert ours == powers.numba(x)


@kernel
def divided(i: int, j: int, x: float, y: float):
    return i // j, i % j, x % y


@given(whole, whole.filter(bool), numbers, numbers.filter(lambda y: abs(y) > 1e-3))
def test_division_rounds_down(i, j, x, y):
    same(divided, i, j, x, y)


@kernel
def extremes(x: float, y: float, z: float, i: int):
    return min(x, y), max(x, y), min(x, y, z), max(z, y, x), max(x, i), min(i, 3)


@given(anything, anything, anything, whole)
@example(0.0, -0.0, math.nan, 0)
@example(-0.0, 0.0, math.nan, 0)
def test_least_and_largest_are_those_of_python(x, y, z, i):
    same(extremes, x, y, z, i)


@kernel
def compared(x: float, y: float, i: int):
    between = 0.0 <= x < y
    either = x > 1.0 or (y > 1.0 and i != 0) or not i < 3
    chosen = 1 if x < y else (2 if x == y else 3)
    return between, either, chosen, i in (1, 3, 5), i not in (2, 4), np.isfinite(x) and not np.isnan(y)


@given(anything, anything, st.integers(0, 6))
def test_comparisons(x, y, i):
    same(compared, x, y, i)


@kernel
def library(x: float, y: float):
    bounded = min(max(x, -1.0), 1.0)
    return (
        np.sin(x) + np.cos(y),
        np.tanh(x) * np.exp(-abs(y)),
        np.arctan2(x, y) + np.arccos(bounded),
        np.hypot(x, y) + np.sqrt(abs(x)),
        np.copysign(y, x),
        np.floor(x) + np.ceil(y),
        int(np.floor(x)) + round(y) + int(x),
        float(int(y)) + np.pi,
    )


@given(numbers, numbers)
@example(0.5, 1.5)
@example(2.5, -0.5)
def test_library(x, y):
    same(library, x, y)


@kernel
def swaps(a, k: int):
    a[0], a[1] = a[1], a[0]
    a[2], a[3], a[4] = a[4], a[2], a[3]
    x, y = a[0], a[5]
    x, y = y, x + y
    a[5] = x
    a[k] = a[0] = y


@given(vectors, st.integers(0, SIZE - 1))
def test_values_are_read_before_they_are_overwritten(a, k):
    same(swaps, a, k)


@kernel
def views(m, out, count: int):
    rows, columns = m.shape
    top, corner = m[:count], m[1:3, 2:]
    column = 0.0
    for i in range(top.shape[0]):
        column += top[i, columns - 1]
    out[: corner.shape[1]] = corner[1]
    corner[0] = 7.0
    m[count - 1 :, 0] = 3.0
    last = m[rows - 1]
    last[0] += column
    flat = m.reshape(m.size)
    flat[columns] -= 1.0
    square = m[0, :4].reshape((2, 2))
    square[1, 0] = square[0, 1]
    return top.shape[0], corner.shape[1], m.size


@given(arrays(np.float64, (4, 5), elements=numbers), vectors, st.integers(1, 4))
def test_views_of_arrays(m, out, count):
    same(views, m, out, count)


@kernel
def window(m, k: int):
    inner = m[k : k + 2, k : k + 2]
    inner[:] = inner[0, 0]
    return total(inner) + total(m[:, k : k + 1])


@kernel
def total(m):
    s = 0.0
    for i in range(m.shape[0]):
        for j in range(m.shape[1]):
            s += m[i, j]
    return s


@given(arrays(np.float64, (4, 5), elements=numbers), st.integers(0, 2))
def test_views_keep_their_strides_in_other_kernels(m, k):
    same(window, m, k)


@kernel
def loops(a, n: int):
    found, s = -1, 0.0
    for i in range(n - 1, -1, -1):
        if a[i] < 0.0:
            continue
        if a[i] > 100.0:
            found = i
            break
        s += a[i]
    for x in (s, 1.0, FACTOR):
        s = 0.5 * (s + x)
    for k in (0, 2):
        a[k] += k
    k = n
    while k > 1 and s < 1e6:
        s = 2.0 * s + 1.0
        k -= 2
    for _ in range(2):
        for _ in range(3):
            s += 1.0
    return found, s, k


@given(vectors, st.integers(0, SIZE))
def test_loops(a, n):
    same(loops, a, n)


@kernel
def bounds_change(a):
    n = 3
    for i in range(n):
        n = n + i
        a[i] = n
    begin = 0
    for k in range(begin, begin + 2):
        begin += 1
        a[3 + k] = begin
    return n, begin


@given(vectors)
def test_a_range_is_what_it_was_at_the_beginning(a):
    same(bounds_change, a)


@kernel
def widened(a, n: int):
    s = 0
    for i in range(n):
        s += a[i]
    t = 1
    if s > 1.0:
        t = s
    x = a[0]
    x = a[:2]
    x[0] += t
    double, short, y1, index, I, printf = 1.0, 2.0, 3.0, 4, 5.0, 6.0  # noqa: E741
    return s, t, double + short + y1 + index + I + printf


@given(vectors, st.integers(0, SIZE))
def test_names_stand_for_other_things(a, n):
    same(widened, a, n)


@kernel
def tuples(a, k: int):
    pair = a[0], a[1]
    mixed = (k, a[2], k > 1)
    a[0], a[1] = pair[1], pair[0]
    three = (a[0], a[1], a[2])
    x, y = turned(*pair)
    count, value = several(a, k)
    return three[k], mixed[1] if mixed[2] else 0.0, x, y, count, value, passed(three, k)


@kernel
def turned(x, y):
    return (y, -x) if x > y else (x, y)


@kernel
def several(a, k):
    if a[k] < 0.0:
        return 0, 0.0
    return k, a[k]


@kernel
def passed(values, k):
    return values[k] + values[0]


@given(vectors, st.integers(0, 2))
def test_tuples(a, k):
    same(tuples, a, k)


@kernel
def effects(a):
    more = True
    more |= count_up(a, 0)  # called, although nothing depends on it
    less = count_up(a, 2) or a[1] > 0.0
    if more or count_up(a, 3):
        a[4] = 1.0
    return more, less, a[0] + 0.0


@kernel
def count_up(a, k):
    a[k] += 1.0
    return a[k] > 0.0


@given(vectors)
def test_calls_with_effects(a):
    same(effects, a)


@kernel
def work_space(a):
    x, m = np.empty(3), np.zeros((2, 3))
    y = np.zeros(2)
    for i in range(3):
        x[i] = a[i]
        m[1, i] = x[i] * FACTOR
    for n in range(2):
        inner = np.zeros(2)
        inner[n] += 1.0
        y[0] += inner[0]
    y[:] += 1.0
    m[0] = x
    m[:, 1] = 4.0
    return total(m), y[0], y[1]


@given(vectors)
def test_work_space(a):
    same(work_space, a)


@kernel(x=("n",), y=("n",), m=("n", 2))
def stated(x, y, m, scale=2.0):
    s = 0.0
    for i in range(x.shape[0]):
        s += scale * x[i] * y[i] + m[i, 1]
    return s


def test_stated_shapes_are_checked():
    x, m = np.arange(3.0), np.ones((3, 2))
    assert stated(x, x, m) == stated.python(x, x, m) == 13.0
    assert stated(x, x, m, scale=1.0) == stated(x, x, m, 1.0) == 8.0
    for wrong in ((x, x[:2].copy(), m), (x, x, m.T.copy()), (x, x, x), (x, [0.0] * 3, m), (x, x.astype(int), m)):
        with pytest.raises(InputError):
            stated(*wrong)


def example_record(**more):
    inner = make_record(values=np.arange(4.0), count=np.int64(2), nothing=np.zeros((0, 3)))
    return make_record(inner=inner, matrix=np.eye(3), on=True, rate=0.5, **more), np.concatenate((inner, inner))


@kernel
def recorded(record, legs, k: int):
    p, q = record[0], record[0].inner
    q.values[:] = p.matrix[k, 0] + p.rate
    p.rate += 1.0
    leg = legs[1]
    leg.values[k] = 9.0
    legs[0].count = k
    s = 0.0
    for i in range(q.nothing.shape[0]):
        s += q.nothing[i, 0] + deeper(q.nothing[i])
    if p.on:
        s += q.values[q.count]
    p.matrix[0], p.matrix[k, 1] = 2.0, s
    return s, legs[0].count + legs[1].count, q.nothing.size


@kernel
def deeper(row):
    return row[2]


@given(st.integers(0, 2))
def test_records(k):
    same(recorded, *example_record(), k)


@kernel
def applied(function, a, k: int):
    return function(a, k)


@kernel
def first_kind(a, k):
    return a[k] * 2.0


@kernel
def second_kind(a, k):
    return a[k] + 100.0


def test_kernels_as_arguments():
    a = np.arange(4.0)
    assert applied(first_kind, a, 3) == 6.0
    assert applied(second_kind, a, 3) == 103.0
    assert applied(first_kind, a, 2) == 4.0
    assert applied.python(second_kind, a, 1) == 101.0


@kernel
def flagged(given, out, on: bool):
    n = 0
    for i in range(given.shape[0]):
        if given[i] and on:
            out[i] = True
            n += given[i]
    return n


def test_truth_values():
    given_flags = np.array([True, False, True])
    for on in (True, False):
        same(flagged, given_flags, np.zeros(3, dtype=bool), on)


@kernel
def known_when_compiling(fixed: bool, a):
    return sized(True, a) + sized(False, a) if fixed else 0.0


@kernel
def sized(large, a):
    space = np.zeros(4 if large else 2)
    space[0] = a[0]
    return space[0] + space.shape[0]


def test_sizes_that_follow_from_a_known_truth_value():
    a = np.array([1.5])
    assert known_when_compiling(True, a) == known_when_compiling.python(True, a) == 9.0


def test_arrays_of_float32_are_read_and_written():
    a, out = np.linspace(0.1, 1.0, SIZE, dtype=np.float32), np.zeros(SIZE, dtype=np.float32)
    exact = np.zeros(SIZE)
    scaled(a, out)
    scaled.python(a.astype(np.float64), exact)
    np.testing.assert_array_equal(out, exact.astype(np.float32))
    with pytest.raises(TypeError):
        scaled(a.astype(np.float64), exact)  # the first call decides; nothing is compiled in the middle of a run


@kernel
def scaled(a, out):
    for i in range(a.shape[0]):
        out[i] = a[i] * 0.1 + a[i] ** 2


# --- what is refused -------------------------------------------------------------------------------------------------


def a_list(a):
    x = [1.0, 2.0]
    return x[0]


def a_dictionary(a):
    return {"a": 1.0}["a"]


def a_text(a):
    name = "text"
    return name


def a_trial(a):
    try:
        return a[0]
    except ValueError:
        return 0.0


def an_own_function(a):
    return sum_of(a)


def sum_of(a):
    return a[0]


def a_numpy_function(a):
    return np.linalg.norm(a)


def unknown_size(a, n=3):
    x = np.empty(n)
    x[0] = a[0]
    return x[0]


def from_the_end(a):
    return a[-1]


def beyond_the_end(a):
    x = np.zeros(3)
    return x[3]


def a_comprehension(a):
    return max(x for x in a)


def after_its_loop(a):
    for i in range(3):
        a[i] = 0.0
    return i


def before_a_value(a):
    if a[0] > 0.0:
        x = 1.0
        a[0] = x
    y = z  # noqa: F821
    return y


def two_kinds(a):
    x = a[0] if a[1] > 0.0 else a[:2]
    return x


def changes_its_range(a):
    for i in range(3):
        i = i + 1
        a[i] = 0.0


def a_step(a):
    b = a[::2]
    return b[0]


def an_array_as_result(a):
    return a[:2]


def a_missing_field(a):
    return a.nothing


def inner_function(a):
    def inner():
        return 1.0

    return inner()


REFUSED = (
    *(a_list, a_dictionary, a_text, a_trial, an_own_function, a_numpy_function, unknown_size, from_the_end),
    *(beyond_the_end, a_comprehension, after_its_loop, before_a_value, two_kinds, changes_its_range, a_step),
    *(an_array_as_result, a_missing_field, inner_function),
)


@pytest.mark.parametrize("function", REFUSED, ids=lambda function: function.__name__)
def test_what_is_no_kernel_is_refused_with_its_place(function):
    with pytest.raises(KernelError) as error:
        kernel(function)(np.arange(4.0))
    assert function.__name__ in str(error.value)
    first = function.__code__.co_firstlineno
    line = int(str(error.value).split("test_language.py:")[1].split(":")[0])
    assert first <= line <= first + 8


def test_a_kernel_that_calls_itself_is_refused():
    with pytest.raises(KernelError, match="calls itself"):
        endless(np.arange(3.0))


@kernel
def endless(a):
    return endless(a)


def test_types_of_arrays():
    packed = Array.packed(Array.packed, (3, "n"))  # type: ignore[arg-type]
    assert packed.strides == ("n", 1)
    assert packed.is_packed
    assert not Array(packed.element, (3, 4), (9, 1)).is_packed
