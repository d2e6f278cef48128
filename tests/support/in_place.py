"""Changes of arrays in place: of shape, length, type and flags, also of what an array is a view
of.
"""

import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import deepcopy
from itertools import product
from typing import Any

import numpy as np
from stateful import CASES, assert_equal, holders

import harpy_pin as hp

DTYPES = ("uint8", "float32", "int64", "bool", "complex128")
SHAPES: dict[str, Callable[[Any], object]] = {
    "flat": lambda array: setattr(array, "shape", (array.size,)),
    "one more axis": lambda array: setattr(array, "shape", (1, *array.shape)),
    "shorter": lambda array: array.resize((1,), refcheck=False),
    "longer": lambda array: array.resize((100 * array.size + 1,), refcheck=False),
    "no strides": lambda array: setattr(array, "strides", (0,) * array.ndim),
    "backwards": lambda array: setattr(array, "strides", tuple(-size for size in array.strides)),
    "far apart": lambda array: setattr(
        array, "strides", tuple(1000 * size for size in array.strides)
    ),
    "columns first": lambda array: setattr(array, "strides", array.strides[::-1]),
}
OTHERS = {kind: lambda array, kind=kind: setattr(array, "dtype", kind) for kind in DTYPES}
FLAGS = {"read only": lambda array: array.setflags(write=False)}
CHANGES: dict[str, Callable[[Any], object]] = SHAPES | OTHERS | FLAGS


def public_arrays(made: Any) -> Iterator[tuple[Any, str]]:
    """Public arrays of an object and of all that it leads to; those made at each access have
    nothing to lose.
    """
    for holder in holders(made, set()):
        for name in sorted(name for name in dir(holder) if not name.startswith("_")):
            array = getattr(holder, name, None)
            if (
                isinstance(array, np.ndarray)
                and getattr(holder, name).ctypes.data == array.ctypes.data
            ):
                yield holder, name


def change_all(name: str) -> int:
    """Change each public array of a case in place: errors are ours, or nothing changes; how many
    NumPy let pass.
    """
    make, use = CASES[name]
    made, count = make(), 0
    use(made)
    found, expected = list(public_arrays(made)), use(deepcopy(made))
    for (holder, attribute), changes in product(found, (SHAPES, OTHERS, FLAGS)):
        array = getattr(holder, attribute)
        for change, one in product(changes.values(), (array, array.base)):
            with (
                suppress(ValueError, TypeError, AttributeError),
                warnings.catch_warnings(action="ignore"),
            ):
                change(one)
                count += 1
        try:
            answers = use(deepcopy(made))
        except hp.HarpyError:
            continue
        for answer, wanted in zip(answers, expected, strict=True):
            try:
                assert_equal(name, answer, wanted)
            except AssertionError as error:
                raise AssertionError(
                    f"{type(holder).__name__}.{attribute}, {' or '.join(changes)}"
                ) from error
    return count
