"""What kernels may not say: refused with its place. And what a known type of array says about
itself.
"""

import numpy as np
import pytest
from needs import needs_compiler

from harpy_pin.errors import KernelError
from harpy_pin.kernels import kernel
from harpy_pin.kernels.types import Array

pytestmark = needs_compiler


HEAD = "import math\n\nimport numpy as np\n\n\ndef sum_of(a):\n    return a[0]\n"
REFUSED = {
    "a_list": ["x = [1.0, 2.0]", "return x[0]"],
    "a_dictionary": ["return {'a': 1.0}['a']"],
    "a_text": ["name = 'text'", "return name"],
    "a_trial": ["try:", "    return a[0]", "except ValueError:", "    return 0.0"],
    "an_own_function": ["return sum_of(a)"],
    "a_numpy_function": ["return np.linalg.norm(a)"],
    "unknown_size": ["x = np.empty(n)", "x[0] = a[0]", "return x[0]"],
    "from_the_end": ["return a[-1]"],
    "beyond_the_end": ["x = np.zeros(3)", "return x[3]"],
    "a_comprehension": ["return max(x for x in a)"],
    "after_its_loop": ["for i in range(3):", "    a[i] = 0.0", "return i"],
    "before_a_value": ["if a[0] > 0.0:", "    x = 1.0", "    a[0] = x", "y = z", "return y"],
    "two_kinds": ["x = a[0] if a[1] > 0.0 else a[:2]", "return x"],
    "changes_its_range": ["for i in range(3):", "    i = i + 1", "    a[i] = 0.0"],
    "a_step": ["b = a[::2]", "return b[0]"],
    "a_missing_field": ["return a.nothing"],
    "a_member": ["return 1.0 if a[0] in a else 0.0"],
    "whole_work_space": ["x = np.zeros(3, dtype=np.int64)", "return x[0]"],
    "a_wider_argument": ["n = n + 0.5", "return n"],
    "a_module": ["return math.pi * a[0]"],
    "a_tuple_of_several_kinds": ["pair = (a[0], a)", "return pair[0]"],
    "inner_function": ["def inner():", "    return 1.0", "return inner()"],
}
"""What kernels of ``a`` and ``n=3`` may not say, line by line."""


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_kernel_is_refused_with_its_place(name, tmp_path, monkeypatch):
    lines = [f"def {name}(a, n=3):", *(f"    {line}" for line in REFUSED[name])]
    (tmp_path / f"say_{name}.py").write_text("\n".join((HEAD, *lines, "")))
    monkeypatch.syspath_prepend(tmp_path)
    function = getattr(__import__(f"say_{name}"), name)
    with pytest.raises(KernelError) as error:
        kernel(function)(np.arange(4.0))
    assert name in str(error.value)
    first = function.__code__.co_firstlineno
    line = int(str(error.value).split(f"say_{name}.py:")[1].split(":")[0])
    assert first <= line < first + len(lines)


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
