"""Numbers and control flow in kernels: what C gives is what plain Python gives, in every bit."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from needs import needs_compiler
from oracle import REALS, same

from harpy_pin.kernels import kernel

pytestmark = needs_compiler
wholes = st.integers(-50, 50)
SCALE = np.float64(2.5)  # whose text is not that of a number


@kernel
def parts(a, n, m, out, counts):
    x, y = a[0], a[1]
    out[0], out[1], out[2], out[3] = x + y, x - y * x, -x / y, x % y
    out[4], out[5], out[6] = -(-x), abs(x - y), 0.5 * (x - (y - x))  # noqa: B002
    out[7], out[8], out[9] = x - (y + x), x / (y / 2.0), x * n - m / n
    out[10], out[11], out[12] = x**2, (x + 1.0) ** 3, y**4
    counts[0], counts[1], counts[2], counts[3] = n + m, n - (m - n), -n * m, n // m
    counts[4], counts[5], counts[6], counts[7] = n % m, abs(n), n // -3, n % -3
    counts[8], counts[9], counts[10] = (n + m) // 2 * 3, int(0.7 * n), -(n > 2) + (n > 1)
    counts[11], out[13] = int(np.floor(0.3 * n)) + m // 5 * (m % 4), float(n) + np.pi


@given(REALS, REALS, wholes.filter(bool), wholes.filter(bool))
def test_arithmetic(x, y, n, m):
    same(parts, np.array([x, y]), n, m, np.zeros(14), np.zeros(12, dtype=np.int64))


@kernel
def functions(a, out):
    x, y = a[0], a[1]
    out[0], out[1], out[2] = np.sqrt(x), np.sin(x), np.cos(y)
    out[3], out[4], out[5] = np.tanh(x), np.exp(y), np.arctan2(x, y)
    out[6], out[7], out[8] = np.arccos(x), np.hypot(x, y), np.copysign(x, y)
    out[9], out[10], out[11] = (
        np.floor(x),
        np.ceil(y),
        float(np.isfinite(x)) + 2.0 * float(np.isnan(y)),
    )


@given(REALS, REALS)
def test_functions(x, y):
    """Those of C's library on both sides."""
    same(functions, np.array([x, y]), np.zeros(12))


@kernel
def extremes(a, n, m):
    x, y, z = a[0], a[1], a[2]
    return (
        min(x, y),
        max(x, y),
        min(x, y, z),
        max(x, y, z),
        min(x, n),
        max(n, m),
        min(n, m, 3),
        max(n > 0, m > 0),
        max(x, n),
    )


@given(REALS, REALS, REALS, wholes, wholes)
def test_extremes_with_signed_zeros_and_no_numbers(x, y, z, n, m):
    same(extremes, np.array([x, y, z]), n, m)


@kernel
def comparisons(a, n, m):
    x, y = a[0], a[1]
    return (
        x < y,
        x <= y < 2.0,
        x == y,
        not x != y,  # noqa: SIM202
        not (x < y and y < 3.0),
        n < m or n == 5 or x > y,
        (n > 0) & (m > 0),
        (n > 0) | (m > 0),
        n in (1, 2, m),
        (n, m) == (1, 2),
        (n, m) != (m, n),
        1 if n else 2 if m else 3,
        (n & 6) | (m & 1),
    )


@given(REALS, REALS, wholes, wholes)
def test_comparisons(x, y, n, m):
    same(comparisons, np.array([x, y]), n, m)


@kernel
def widened(a, n):
    total, best, count = 0, n, True
    for i in range(a.shape[0]):
        total += a[i]
        if a[i] > 1.0:
            best = a[i] / 2
            count = 3
    return total, best / 4, count


@given(st.lists(st.floats(-10, 10), max_size=5), wholes)
def test_whole_numbers_become_real_ones(numbers, n):
    same(widened, np.array(numbers), n)


@kernel
def loops(a, n):
    total, last = 0.0, -1
    for i in range(n, a.shape[0]):
        if a[i] < 0.0:
            continue
        if a[i] > 9.0:
            last = i
            break
        total += a[i]
    for i in range(a.shape[0] - 1, -1, -2):
        total = 0.5 * total + a[i]
    for x in (total, a[0], SCALE):
        for i in range(2):
            total += x * i
    for i in (2, 5, n):
        total += i
    for k in (0, n % a.size):
        a[k] += k
    k = 0
    while True:
        k += 1
        if k * k > n:
            break
        if k % 2:
            continue
        total -= k
    while k > 0 and total < 100.0:
        k -= 1
        total += 1.0
    return total, last, k


@given(st.lists(st.floats(-10, 12), min_size=1, max_size=8), st.integers(0, 8))
def test_loops(numbers, n):
    same(loops, np.array(numbers), n)


@kernel
def ranges(n, m):
    total = 0
    for n in range(n, n + m):  # noqa: B020
        total = 3 * total + n
    i = m
    for i in range(i, 7):  # noqa: B020
        m += 2  # the range was counted before
        total += i
    for j in range(m):
        m = m - 1
        total += j * m
    return total


@given(st.integers(0, 6), st.integers(0, 6))
def test_ranges_are_counted_once(n, m):
    same(ranges, n, m)


@kernel
def leaves(x, flag):
    if flag:
        if x > 1.0:
            return 1
        elif x > 0.0:  # noqa: RET505
            y = 0.5
        else:
            return x
    else:
        y = 2
    return y * 3


@given(st.floats(-2, 3), st.booleans())
def test_early_returns(x, flag):
    same(leaves, x, flag)
