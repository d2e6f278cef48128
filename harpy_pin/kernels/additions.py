"""What the language adds to Python and NumPy; in Python it works, too."""

from __future__ import annotations

from typing import Any

import numpy as np


class ByPrecision(float):
    """A constant of a kernel's module that is another number where kernels compute in ``single``
    precision.
    """

    single: float

    def __new__(cls, double: float, *, single: float) -> ByPrecision:
        """The number itself is that in double precision."""
        made = super().__new__(cls, double)
        made.single = single
        return made


def diagonal(matrix: Any) -> Any:
    """The diagonal of a square matrix, as a part of it that can be written."""
    return np.einsum("ii->i", matrix)
