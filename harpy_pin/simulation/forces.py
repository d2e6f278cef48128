"""Forces on feet as arrays of any number of axes, checked."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from harpy_pin import checks
from harpy_pin.errors import InputError
from harpy_pin.model.state import Vector

__all__ = ["checked_forces"]


def checked_forces(force: ArrayLike, **others: ArrayLike) -> tuple[Vector, ...]:
    """Forces (..., 3), and other numbers for each of them, as arrays.

    Args:
        force: (..., 3) N.
        others: (...) or fewer axes, by their names.

    Raises:
        InputError: they are not numbers, or not of these shapes.
    """
    arrays = [checks.array("force", force, None)]
    shape = arrays[0].shape
    if not shape or shape[-1] != 3:
        raise InputError(f"force must have shape (..., 3), got {shape}", name="force", value=force)
    for name, value in others.items():
        array = checks.array(name, value, None)
        try:
            fits = np.broadcast_shapes(array.shape, shape[:-1]) == shape[:-1]
        except ValueError:
            fits = False
        if not fits:
            message = f"{name} must fit forces of shape {shape[:-1]}, got {array.shape}"
            raise InputError(message, name=name, value=value)
        arrays.append(np.broadcast_to(array, shape[:-1]))
    return tuple(arrays)
