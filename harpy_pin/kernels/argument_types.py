"""Types of what a kernel is called with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from harpy_pin.errors import KernelError
from harpy_pin.kernels.shapes import constant_shape
from harpy_pin.kernels.types import BOOLEAN, INTEGER, REAL, Array, Struct, Tuple, Type, element_of


def argument_types(kernel: Any, given: Mapping[str, Any]) -> tuple[Type, ...]:
    """Types of arguments; a :class:`KernelError` where a kernel takes nothing of that kind."""
    records = {
        name: value.dtype
        for name, value in given.items()
        if getattr(value, "dtype", None) is not None
    }
    return tuple(_type(kernel, name, value, records) for name, value in given.items())


def _type(
    kernel: Any, name: str, value: Any, records: Mapping[str, Any], *, whole: bool = True
) -> Type:
    """The type of an argument, or of a part of one that is a tuple."""
    if isinstance(value, np.ndarray):
        element = element_of(value.dtype, name)
        if isinstance(element, Struct) and (value.ndim == 0 or (value.shape == (1,) and whole)):
            return element
        stated = kernel._shapes.get(name)
        return Array.packed(element, constant_shape(stated, records, value.ndim))
    if isinstance(value, bool):
        return BOOLEAN
    if isinstance(value, int | float):
        stated_type = str(kernel.py_func.__annotations__.get(name, ""))
        integer = stated_type == "int" or (isinstance(value, int) and stated_type != "float")
        return INTEGER if integer else REAL
    if isinstance(value, tuple):
        return Tuple(tuple(_type(kernel, name, item, records, whole=False) for item in value))
    message = f"must be a number or an array, got {type(value).__name__}"
    raise KernelError(f"{name} of {kernel.py_func.__name__} {message}")
