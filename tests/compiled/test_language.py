"""What kernels may not say: refused with its place. And what a known type of array says about itself."""

import math

import numpy as np
import pytest

from harpy_pin.compiled import BACKEND, kernel
from harpy_pin.compiled.types import Array
from harpy_pin.errors import KernelError

pytestmark = pytest.mark.skipif(BACKEND != "c", reason="C alone refuses")


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


def a_member(a):
    return 1.0 if a[0] in a else 0.0


def whole_work_space(a):
    x = np.zeros(3, dtype=np.int64)
    return x[0]


def a_wider_argument(a, n=3):
    n = n + 0.5
    return n


def a_module(a):
    return math.pi * a[0]


def a_tuple_of_several_kinds(a):
    pair = (a[0], a)
    return pair[0]


def inner_function(a):
    def inner():
        return 1.0

    return inner()


REFUSED = (
    *(a_list, a_dictionary, a_text, a_trial, an_own_function, a_numpy_function, unknown_size, from_the_end),
    *(beyond_the_end, a_comprehension, after_its_loop, before_a_value, two_kinds, changes_its_range, a_step),
    *(an_array_as_result, a_missing_field, a_member, whole_work_space, a_wider_argument, a_module),
    *(a_tuple_of_several_kinds, inner_function),
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
